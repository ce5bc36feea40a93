"""The mask that is being drawn on a sample: its tools' settings, its steps, its long work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from PyQt6.QtCore import QObject, QTimer, pyqtSignal

from app.panels.mask_work import (
    LARGEST_RADIUS,
    KnownLab,
    Lamp,
    MaskSettings,
    lab_of,
    let_go,
    warm,
)
from app.tasks import Tasks
from btfcore.btf.mask_history import Box, MaskHistory, difference
from btfcore.btf.mask_select import flood, similar
from btfcore.btf.mask_tools import (
    LEAST_RADIUS,
    MaskReport,
    brush,
    combined,
    feathered,
    grown,
    inverted,
    lasso,
    reach,
    report,
)
from btfcore.btf.sample import BtfSample
from btfcore.progress import Progress
from btfcore.types import F4

REPORT_MS = 300  # quiet time after which a mask is looked at
Edit = Callable[[F4], F4]


class MaskModel(QObject):
    """One mask (H, W) f4 on one sample; every change is one undoable step.

    Strokes are drawn at once; what looks at the whole sample runs in the background, and what
    is asked for meanwhile waits for its turn. Signals: mask_changed((left, top, right,
    bottom)); picture_changed: other colours are shown; settings_changed; state_changed: steps,
    work or report are others; failed(text).
    """

    mask_changed = pyqtSignal(object)
    picture_changed = pyqtSignal()
    settings_changed = pyqtSignal()
    state_changed = pyqtSignal()
    failed = pyqtSignal(str)

    def __init__(
        self,
        name: str,
        colour: F4,
        mask: F4 | None = None,
        *,
        tiles: bool = False,
        btf: BtfSample | None = None,
        curve: Callable[[float], float] | None = None,
        parent: QObject | None = None,
    ) -> None:
        """Take over a copy of `mask`, or start empty.

        colour (H, W, 3) f4, sRGB-coded; btf: the same sample, to be shown under other lights;
        curve: the brush's share of its radius at a pen's pressure, both 0–1.
        """
        super().__init__(parent)
        shape = colour.shape[:2]
        self.name, self.colour, self.tiles, self.btf = name, colour, tiles, btf
        self.mask = np.zeros(shape, np.float32) if mask is None else mask.astype(np.float32)
        self.settings = MaskSettings()
        self._curve = curve
        self.report: MaskReport | None = None
        self.history = MaskHistory()
        self.last_point: tuple[float, float] | None = None
        self._given = self.mask.copy()
        self._before: F4 | None = None  # the mask when the stroke began
        self._path: list[tuple[float, float, float]] = []
        self._drawn = 0  # points of the path that are in the mask
        self._ahead = 0  # of what waits, what was asked for before the stroke
        self._stroke_remove = False
        self._waiting: list[Callable[[], None]] = []
        self._wand: tuple[F4, tuple[int, int], bool] | None = None  # mask before, seed, remove
        self._refining = False
        self._lab: KnownLab | None = None
        self.work, self._reading = Tasks(self), Tasks(self)
        self.work.finished.connect(lambda _, done: done())
        self.work.failed.connect(lambda _, text: self.failed.emit(text))
        self.work.idle.connect(self._next)
        self._reading.finished.connect(self._reported)
        self._reading.failed.connect(lambda _, text: self.failed.emit(text))
        self._reading.idle.connect(self._read_again)
        self.lamp = None if btf is None else Lamp(btf, self)
        if self.lamp is not None:
            self.lamp.lit.connect(self._lit)
            self.lamp.failed.connect(self.failed)
        self._quiet = QTimer(self)
        self._quiet.setSingleShot(True)
        self._quiet.timeout.connect(self._read)
        self._stale = True
        self.work.start("warm", lambda progress, report: warm())
        self._quiet.start(REPORT_MS)

    @property
    def changed(self) -> bool:
        """Whether the mask is another than the one that was given."""
        return not np.array_equal(self.mask, self._given)

    @property
    def share(self) -> float:
        """Share of the sample that is feature."""
        return float(np.count_nonzero(self.mask > 0.5) / self.mask.size)

    @property
    def stroking(self) -> bool:
        """A stroke has begun and not ended."""
        return self._before is not None

    @property
    def busy(self) -> bool:
        """Work on the whole sample runs or waits."""
        return self.work.busy or bool(self._waiting)

    def set(self, **changes: Any) -> None:
        """Change settings; the last flood follows its own as long as it is the last step."""
        changes = {k: v for k, v in changes.items() if getattr(self.settings, k) != v}
        if "radius" in changes:
            changes["radius"] = min(max(changes["radius"], LEAST_RADIUS), LARGEST_RADIUS)
        if "hardness" in changes:
            changes["hardness"] = min(max(changes["hardness"], 0.0), 1.0)
        if not changes:
            return
        self.settings = replace(self.settings, **changes)
        self.settings_changed.emit()
        if changes.keys() & {"tolerance", "contiguous", "smoothing", "evening", "within"}:
            self._refine()

    def begin_stroke(
        self, x: float, y: float, *, pressure: float = 1.0, remove: bool = False, line: bool = False
    ) -> None:
        """Press the brush at (column, row); `line` starts it where the last stroke ended."""
        self.finish_stroke()
        self._before = self.mask
        self._stroke_remove = remove or self.settings.remove
        self._path, self._drawn, self._ahead = [], 0, len(self._waiting)
        if line and self.last_point is not None:
            self._path.append((*self.last_point, self._factor(pressure)))
        self.extend_stroke(x, y, pressure=pressure)

    def extend_stroke(self, x: float, y: float, *, pressure: float = 1.0) -> None:
        """Move the brush on to (column, row)."""
        if self._before is not None:
            self._path.append((x, y, self._factor(pressure)))
            self._draw()

    def finish_stroke(self) -> None:
        """Lift the brush: what was drawn is one step."""
        if self._before is None:
            return
        if not self._drawn:  # what was asked for before it still runs or waits
            path, settings, remove = self._path, self.settings, self._stroke_remove
            self._before = None
            self.last_point = path[-1][:2]
            change = self._stroke(path, settings, remove)
            self._waiting.insert(self._ahead, lambda: self._whole(self.tr("Stroke"), change))
            self._ahead = 0
            return
        before, self._before = self._before, None
        self.last_point = self._path[-1][:2]
        self._wand = None
        self._keep(self.tr("Stroke"), before)
        self._next()

    def cancel_stroke(self) -> None:
        """Take back the stroke that has begun."""
        if self._before is not None:
            before, self._before, self._ahead = self._before, None, 0
            if self._drawn:
                self.mask = before
                height, width = before.shape
                self._told((0, 0, width, height))
            self._next()

    def fill_outline(self, outline: Any, *, remove: bool = False) -> None:
        """Add what an outline (n, 2) encloses to the mask, or remove it."""
        remove = remove or self.settings.remove
        points, tiles = np.asarray(outline, np.float64), self.tiles
        self.edit(self.tr("Lasso"), lambda m: lasso(m, points, remove=remove, tiles=tiles))

    def flood_from(self, column: int, row: int, *, remove: bool = False) -> None:
        """Add the texels like the one at (column, row), or remove them."""
        remove = remove or self.settings.remove
        self._when_free(lambda: self._flood(self.mask, (column, row), remove))

    def mark_similar(self) -> None:
        """Mark whatever looks like something marked."""
        colour, settings, tiles = self.colour, self.settings, self.tiles
        known = self._lab

        def chosen(mask: F4) -> F4:
            lab = lab_of(colour, settings, tiles, known)[-1]
            return combined(mask, similar(lab, mask, tolerance=settings.likeness))

        self.edit(self.tr("Similar"), chosen)

    def invert(self) -> None:
        """Exchange feature and background."""
        self.edit(self.tr("Invert"), inverted)

    def clear(self) -> None:
        """Mark nothing."""
        self.edit(self.tr("Clear"), np.zeros_like)

    def grow(self, texels: float) -> None:
        """Move the edge outward, inward where negative."""
        label = self.tr("Grow") if texels > 0 else self.tr("Shrink")
        self.edit(label, lambda mask: grown(mask, texels, tiles=self.tiles))

    def feather(self, texels: float) -> None:
        """Soften the edge."""
        self.edit(self.tr("Feather"), lambda m: feathered(m, texels, tiles=self.tiles))

    def edit(self, label: str, change: Edit) -> None:
        """Apply a pure function of the mask in the background, as one step."""
        self._when_free(lambda: self._whole(label, change))

    def undo(self) -> None:
        """Take the last step back."""
        self._when_free(lambda: self._moved(self.history.undo(self.mask)))

    def redo(self) -> None:
        """Take the step again that was undone last."""
        self._when_free(lambda: self._moved(self.history.redo(self.mask)))

    def cancel_work(self) -> None:
        """Stop what runs and forget what waits."""
        self._waiting.clear()
        self._refining = False
        self.work.cancel()

    def close(self) -> None:
        """Stop everything, without waiting for what cannot be stopped at once."""
        self._quiet.stop()
        self._waiting.clear()
        let_go(self.work)
        let_go(self._reading)
        if self.lamp is not None:
            self.lamp.close()

    def _factor(self, pressure: float) -> float:
        if not self.settings.pressure:
            return 1.0
        pressure = min(max(pressure, 0.0), 1.0)
        return pressure if self._curve is None else min(max(self._curve(pressure), 0.0), 1.0)

    def _draw(self) -> None:
        """Draw the points that are new, unless the mask is being worked on."""
        if self.work.busy or self._ahead or self._before is None:
            return
        path = np.array(self._path[max(self._drawn - 1, 0) :])
        self._drawn = len(self._path)
        self.mask = self._stroke(path, self.settings, self._stroke_remove)(self.mask)
        self.mask_changed.emit(self._box(path))

    def _stroke(self, path: Any, settings: MaskSettings, remove: bool) -> Edit:
        tiles = self.tiles
        return lambda mask: brush(
            mask, path, radius=settings.radius, hardness=settings.hardness, remove=remove,
            tiles=tiles,
        )  # fmt: skip

    def _box(self, path: Any) -> Box:
        """Box that a stroke changes; all of a side over which it leaves a tile."""
        height, width = self.mask.shape
        far = reach(self.settings.radius, self.settings.hardness) + 1
        low = np.floor(path[:, :2].min(axis=0) - far).astype(int)
        high = np.ceil(path[:, :2].max(axis=0) + far).astype(int) + 1
        sides = np.array([width, height])
        if self.tiles:
            over = (low < 0) | (high > sides)
            low, high = np.where(over, 0, low), np.where(over, sides, high)
        low, high = np.clip(low, 0, sides), np.clip(high, 0, sides)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _flood(self, before: F4, seed: tuple[int, int], remove: bool) -> None:
        settings, colour, tiles, known = self.settings, self.colour, self.tiles, self._lab

        def chosen(mask: F4) -> F4:
            self._lab = lab_of(colour, settings, tiles, known)
            found = flood(
                self._lab[-1], seed, tolerance=settings.tolerance, contiguous=settings.contiguous,
                tiles=tiles,
            )  # fmt: skip
            if settings.within:  # of what is marked, this is kept or taken away
                return np.minimum(mask, 1 - found if remove else found)
            return combined(mask, found, remove=remove)

        self._whole(self.tr("Flood"), chosen, before=before, wand=(before, seed, remove))

    def _refine(self) -> None:
        """Flood again with the settings as they are when its turn comes."""
        if self._wand is None or self._refining:
            return
        self._refining = True

        def again() -> None:
            self._refining = False
            if self._wand is not None:
                self._flood(*self._wand)

        self._when_free(again)

    def _whole(
        self, label: str, change: Edit, *, before: F4 | None = None, wand: Any = None
    ) -> None:
        """Start a change of the mask, or of what it was `before` the last step, replacing that."""
        repeated = self._wand is not None and before is self._wand[0] and wand is not None
        base, now = self.mask if before is None else before, self.mask

        def job(progress: Progress, report: object) -> Callable[[], None]:
            after = change(base)
            step, moved = difference(label, base, after), difference("", now, after)

            def done() -> None:
                if repeated and self._stepped:
                    self.history.forget_last()
                self.mask, self._wand, self._stepped = after, wand, step is not None
                if step is not None:
                    self.history.add(step)
                self._told(moved.box if moved else None)

            return done

        self.work.start(label, job)
        self.state_changed.emit()

    _stepped = False  # the last flood left a step

    def _keep(self, label: str, before: F4) -> None:
        step = difference(label, before, self.mask)
        if step is not None:
            self.history.add(step)
        self._told(None)

    def _moved(self, found: tuple[F4, Box] | None) -> None:
        if found is not None:
            self._wand = None
            self.mask = found[0]
            self._told(found[1])

    def _told(self, box: Box | None) -> None:
        if box is not None:
            self.mask_changed.emit(box)
        self._stale = True
        self._quiet.start(REPORT_MS)
        self.state_changed.emit()

    def _when_free(self, call: Callable[[], None]) -> None:
        if self.busy or self.stroking:
            self._waiting.append(call)
        else:
            call()

    def _next(self) -> None:
        while self._waiting and not self.work.busy and (self._before is None or self._ahead):
            self._ahead = max(self._ahead - 1, 0)
            self._waiting.pop(0)()
        if self._before is not None and not self._drawn and not self.work.busy:
            self._before = self.mask  # drawn upon what the work left
            self._draw()
        self.state_changed.emit()

    def _read(self) -> None:
        if self._reading.busy or not self._stale:
            return
        self._stale = False
        mask, name = self.mask, self.name
        self._reading.start("report", lambda progress, _: report(mask, name=name))

    def _read_again(self) -> None:
        if self._stale and not self._quiet.isActive():
            self._quiet.start(REPORT_MS)

    def _reported(self, _: str, found: MaskReport) -> None:
        self.report = found
        self.state_changed.emit()

    def _lit(self, colour: F4) -> None:
        self.colour = colour
        self.picture_changed.emit()
