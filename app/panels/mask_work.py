"""What the mask editor is set to, and its work in the background."""

from __future__ import annotations

import atexit
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from PyQt6.QtCore import QObject, QTimer, pyqtSignal

from app.tasks import Tasks
from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.mask_select import cielab, flood
from btfcore.btf.mask_tools import brush, lasso
from btfcore.btf.sample import NORMAL, BtfSample
from btfcore.progress import Progress
from btfcore.types import F4, F8

LARGEST_RADIUS = 256.0  # texels, of the editor's brush
MID_GREY, MOST_GAIN = 0.18, 8.0
KnownLab = tuple[F4, float, float, F4]  # of which colours, smoothed and evened how, the result


class MaskTool(Enum):
    """What a press of the left button does."""

    BRUSH, LASSO, FLOOD = range(3)


@dataclass(frozen=True)
class MaskSettings:
    """Settings of the tools; lengths in texels, tolerances in ΔE*ab.

    remove: tools take away; within: a flood keeps only what is already marked; likeness: the
    tolerance of "similar everywhere".
    """

    tool: MaskTool = MaskTool.BRUSH
    remove: bool = False
    radius: float = 8.0
    hardness: float = 0.8
    pressure: bool = True
    tolerance: float = 10.0
    contiguous: bool = True
    smoothing: float = 1.0
    evening: float = 0.0
    within: bool = False
    likeness: float = 3.0


class Lamp(QObject):
    """Shows a BTF from above under one light after the other; only the latest wish counts.

    lit(colours): (H, W, 3) f4, sRGB-coded.
    """

    lit = pyqtSignal(object)
    failed = pyqtSignal(str)

    def __init__(self, btf: BtfSample, parent: QObject | None = None) -> None:
        """Wait for the first light."""
        super().__init__(parent)
        self._btf = btf
        self._wanted: F8 | None = None
        self._shown: F8 | None = None
        self._tasks = Tasks(self)
        self._tasks.finished.connect(lambda _, colour: self.lit.emit(colour))
        self._tasks.failed.connect(lambda _, text: self.failed.emit(text))
        self._tasks.idle.connect(self._next)

    @property
    def busy(self) -> bool:
        """A picture is being made."""
        return self._tasks.busy

    def move(self, direction: F8) -> None:
        """Ask for the sample under a light (3,)."""
        self._wanted = direction
        self._next()

    def close(self) -> None:
        """Make no more pictures."""
        let_go(self._tasks)

    def _next(self) -> None:
        btf, light = self._btf, self._wanted
        if light is None or light is self._shown or self._tasks.busy:
            return
        self._shown = light

        def job(progress: Progress, report: object) -> F4:
            from btfcore.btf.interpolation.radiance import picture

            return linear_to_srgb(brightened(picture(btf, NORMAL[0], light)))

        self._tasks.start("light", job)


def brightened(linear: F4) -> F4:
    """Radiance (H, W, 3), up to 8 times as bright where its mean is darker than mid-grey.

    Under a low light, where scratches show best, little would be seen otherwise.
    """
    mean = float(linear.mean(dtype=np.float64))
    return linear * np.float32(min(max(MID_GREY / max(mean, 1e-12), 1.0), MOST_GAIN))


def lab_of(colour: F4, settings: MaskSettings, tiles: bool, known: KnownLab | None) -> KnownLab:
    """Colours in CIELAB as the settings ask, from what is `known` where it is the same."""
    smoothing, evening = settings.smoothing, settings.evening
    if known is not None and known[0] is colour and known[1:3] == (smoothing, evening):
        return known
    lab = cielab(colour, smoothing=smoothing, evening=evening, tiles=tiles)
    return colour, smoothing, evening, lab


def warm() -> Callable[[], None]:
    """Compile the kernels, so that the first stroke need not wait for it."""
    mask, lab = np.zeros((4, 4), np.float32), np.zeros((4, 4, 3), np.float32)
    lasso(brush(mask, [[1.0, 1.0]], radius=1), [[0, 0], [2, 0], [2, 2]])
    flood(lab, (0, 0))
    return lambda: None


_LEAVING: set[Tasks] = set()  # executors whose last job has not noticed yet


@atexit.register
def _see_off() -> None:
    """No worker may outlive what it reports to."""
    for tasks in _LEAVING:
        tasks.wait()


def let_go(tasks: Tasks) -> None:
    """Cancel and keep alive until the worker thread is through; the window does not wait."""
    tasks.blockSignals(True)
    tasks.cancel()
    if tasks.wait(0):
        return
    tasks.setParent(None)
    _LEAVING.add(tasks)

    def look() -> None:
        if tasks.wait(0):
            _LEAVING.discard(tasks)
        else:
            QTimer.singleShot(100, look)

    look()
