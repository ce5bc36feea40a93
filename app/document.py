"""What the window works on: a mesh, samples, knobs, a painting; it knows no widget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PyQt6.QtCore import QObject, pyqtSignal

from app.layer_views import LayerView, Mark, PaintState
from app.lighting import Lamp, Lighting
from app.tool_options import SHARE, TOOLS, ToolOptions
from app.values import RATES, U1, Canvas, Decoration, Knobs, Mode, Opened, SampleEntry
from btfcore.errors import InvalidParameter
from btfcore.files.surface import ExportSurface
from btfcore.guide import Guide
from btfcore.paint.stamp import Preview
from btfcore.painting import Painting
from btfcore.quilt.state import QuiltState
from btfcore.render.glsl.decorated import PackedSurface
from btfcore.render.relight import Relighter
from btfcore.types import F4

__all__ = [
    "RATES", "U1", "Canvas", "Decoration", "Document", "Knobs", "Lamp", "Lighting", "Mode",
    "Opened", "SampleEntry",
]  # fmt: skip


class Document(QObject):
    """The one truth that all widgets show; changed by `app.operations` only."""

    mesh_changed = pyqtSignal()
    samples_changed = pyqtSignal()
    sample_chosen = pyqtSignal()
    knobs_changed = pyqtSignal()
    result_changed = pyqtSignal()
    picture_changed = pyqtSignal()
    mode_changed = pyqtSignal()
    lighting_changed = pyqtSignal()
    painting_changed = pyqtSignal()
    layers_changed = pyqtSignal()
    history_changed = pyqtSignal()
    selection_changed = pyqtSignal()
    surface_edited = pyqtSignal(object)
    tool_changed = pyqtSignal()
    options_changed = pyqtSignal()
    stroke_changed = pyqtSignal()
    preview_changed = pyqtSignal()
    guide_changed = pyqtSignal()
    saved_changed = pyqtSignal()

    def __init__(self, parent: QObject | None = None) -> None:
        """Start empty."""
        super().__init__(parent)
        self.opened: Opened | None = None
        self.samples: tuple[SampleEntry, ...] = ()
        self.sample_path: Path | None = None
        self.knobs = Knobs()
        self.canvas: Canvas | None = None
        self.decoration: Decoration | None = None
        self.exported = True
        self.mode = Mode.COLOUR
        self.textures: dict[Mode, U1] = {}
        self.lighting = Lighting()
        self.relighter: Relighter | None = None
        self.shader_wanted = False  # the graphics card evaluates light
        # what it draws the present decoration from, or why it cannot; None: not prepared
        self.packed: PackedSurface | str | None = None
        self.growing = False  # a synthesis runs, and its partial pictures are shown
        self.state = PaintState()
        self.saved = Mark()  # what the project file holds
        self.project_path: Path | None = None
        self.selected: int | None = None
        self.tool = "view"
        self.options = ToolOptions()
        self.masks: Mapping[Path, F4] = {}
        self.protected: NDArray[np.bool_] | None = None
        self.pending: F4 | None = None  # m_0 of the stroke that is being drawn
        self.preview: tuple[Preview, ...] = ()
        self.guide: Guide | None = None  # which way the next synthesis runs, where drawn
        self.overlay: U1 | None = None  # colours with the preview on them

    # --- the painting, as it was when nothing changed it last

    @property
    def painting(self) -> Painting | None:
        """The painting; None before the first synthesis."""
        return self.state.painting

    @property
    def background(self) -> QuiltState | None:
        """The quilt below all edits."""
        return self.state.background

    @property
    def layers(self) -> tuple[LayerView, ...]:
        """The edits, bottom first."""
        return self.state.layers

    @property
    def history(self) -> tuple[str, ...]:
        """Labels of all steps, oldest first."""
        return self.state.history

    @property
    def history_at(self) -> int:
        """How many steps of the history are done."""
        return self.state.at

    @property
    def undo_label(self) -> str:
        """What undo would take back, "" where there is nothing."""
        return self.history[self.history_at - 1] if self.history_at else ""

    @property
    def redo_label(self) -> str:
        """What redo would do again, "" where there is nothing."""
        return self.history[self.history_at] if self.history_at < len(self.history) else ""

    @property
    def busy_edits(self) -> int:
        """How many edits are computed or waited for."""
        return sum(layer.busy for layer in self.layers)

    @property
    def sample_names(self) -> tuple[str, ...]:
        """Of the painting's samples, by their numbers."""
        return tuple(each.name for each in self.state.mark.materials)

    @property
    def radius(self) -> float:
        """Radius of the brush in world units, also where it was not set."""
        opened = self.opened
        own = self.options.radius
        return own if own > 0 or opened is None else SHARE * opened.mesh.diagonal

    # --- what is shown

    @property
    def surface(self) -> ExportSurface | None:
        """The surface to draw: with the atlas's coordinates as soon as there is an atlas."""
        if self.canvas is not None:
            return self.canvas.surface
        return self.opened.surface if self.opened is not None else None

    @property
    def texture(self) -> U1 | None:
        """The image to draw on it in the present mode; None: plain."""
        if self.overlay is not None and self.mode in (Mode.COLOUR, Mode.LIT):
            return self.overlay
        if self.mode is Mode.LIT:  # until there is light
            return self.textures.get(Mode.COLOUR)
        return self.textures.get(self.mode)

    @property
    def lit(self) -> Relighter | None:
        """What lights the surface that is shown, while it is to be shown under light."""
        done = self.decoration
        shown = self.mode is Mode.LIT and not self.growing and self.overlay is None
        ready = shown and done is not None
        return self.relighter if ready and done and done.canvas is self.canvas else None

    @property
    def unsaved(self) -> bool:
        """There is work that no project file has; without layers, an export has it too."""
        if self.painting is None or self.saved.same(self.state.mark):
            return False
        return bool(self.state.mark.layers) or not self.exported

    def offers(self, mode: Mode) -> bool:
        """Say whether there is something to see in `mode`."""
        if mode is Mode.COLOUR:
            return True
        if mode is Mode.SEAMS:
            return self.decoration is not None or Mode.COLOUR in self.textures
        if mode is Mode.LIT:
            return self.decoration is not None and bool(self.decoration.materials)
        return self.canvas is not None

    def set_mesh(self, opened: Opened) -> None:
        """Take another mesh; what was made of the old one is gone."""
        self.opened = opened
        self.canvas = self.decoration = self.relighter = self.packed = None
        self.growing = False
        self.exported = True
        self.textures = {}
        self.project_path, self.saved, self.protected = None, Mark(), None
        self.set_state(PaintState())
        self.show_stroke(None)
        self.show_preview((), None)
        self.set_guide(None)
        self.mode = Mode.COLOUR
        self.mesh_changed.emit()
        self.mode_changed.emit()
        self.result_changed.emit()

    def set_canvas(self, canvas: Canvas | None) -> None:
        """Draw on another atlas of the same mesh; pictures of the old one are dropped."""
        if canvas is self.canvas:
            return
        self.canvas = canvas
        self.textures = {}
        if not self.offers(self.mode):
            self.set_mode(Mode.COLOUR)
        self.picture_changed.emit()

    def set_decoration(self, decoration: Decoration) -> None:
        """Take a finished result and its own canvas."""
        self.decoration = decoration
        self.relighter = self.packed = None
        self.growing = False
        self.exported = False
        self.set_canvas(decoration.canvas)
        self.textures.pop(Mode.COLOUR, None)
        self.textures.pop(Mode.SEAMS, None)
        self.result_changed.emit()

    def set_bare(self) -> None:
        """Show the mesh without a decoration."""
        self.decoration = self.relighter = self.packed = None
        self.growing = False
        self.drop_textures()
        self.result_changed.emit()

    def follow_edits(self, decoration: Decoration) -> None:
        """Take the same decoration after edits; pictures and light are brought up to date apart."""
        self.decoration, self.exported = decoration, False
        self.result_changed.emit()

    def set_state(self, state: PaintState) -> None:
        """Take the painting as it is now."""
        old, self.state = self.state, state
        uids = {layer.uid for layer in state.layers}
        if self.selected is not None and self.selected not in uids:
            self.select(None)
        if state.painting is not old.painting:
            self.protected = None
            self.painting_changed.emit()
        self.layers_changed.emit()
        if (state.history, state.at) != (old.history, old.at):
            self.history_changed.emit()
        self.saved_changed.emit()

    def select(self, uid: int | None) -> None:
        """Select a layer, or none."""
        if uid != self.selected:
            self.selected = uid
            self.selection_changed.emit()

    def set_saved(self, mark: Mark, path: Path | None) -> None:
        """Remember what the project file `path` holds."""
        self.saved, self.project_path = mark, path
        self.saved_changed.emit()
        self.result_changed.emit()

    def show_stroke(self, wanted: F4 | None) -> None:
        """Take m_0 (N,) of the stroke that is being drawn; None: none is."""
        if wanted is not None or self.pending is not None:
            self.pending = wanted
            self.stroke_changed.emit()

    def show_preview(self, preview: tuple[Preview, ...], overlay: U1 | None) -> None:
        """Take where a stamp would lie and the picture of that."""
        if preview or self.preview:
            self.preview, self.overlay = preview, overlay
            self.preview_changed.emit()
            self.picture_changed.emit()

    def set_tool(self, tool: str) -> None:
        """Take another tool; raises `InvalidParameter` for one that there is not."""
        if tool not in TOOLS:
            raise InvalidParameter(f"there is no tool {tool!r}; there are {', '.join(TOOLS)}")
        if tool != self.tool:
            self.tool = tool
            self.tool_changed.emit()

    def set_options(self, **changes: object) -> None:
        """Set options of the tools; raises `InvalidParameter`, the options staying as they were."""
        options = replace(self.options, **changes)  # type: ignore[arg-type]
        if options != self.options:
            self.options = options
            self.options_changed.emit()

    def set_mask(self, path: Path, mask: F4 | None) -> None:
        """Take the mask (H, W) of a sample's feature; None: the one that it came with."""
        masks = {known: each for known, each in self.masks.items() if known != path}
        self.masks = masks if mask is None else masks | {path: mask}
        self.samples_changed.emit()

    def set_guide(self, guide: Guide | None) -> None:
        """Take the vectors that the next synthesis runs along; None: none are drawn."""
        if guide is not self.guide:
            self.guide = guide
            self.guide_changed.emit()

    def protect(self, mask: NDArray[np.bool_] | None) -> None:
        """Let edits leave the dense vertices of `mask` (N,) alone; None: none."""
        self.protected = mask if mask is not None and mask.any() else None
        self.stroke_changed.emit()

    def set_texture(self, mode: Mode, image: U1) -> None:
        """Take the picture of a mode for the present canvas."""
        self.textures[mode] = image
        shown = Mode.COLOUR if self.mode is Mode.LIT and self.lit is None else self.mode
        if mode is shown:
            self.picture_changed.emit()

    def set_growing(self, growing: bool) -> None:
        """Show the partial pictures of a synthesis, also where light was shown; or no longer."""
        if growing is not self.growing:
            self.growing = growing
            self.picture_changed.emit()

    def set_relighter(
        self, relighter: Relighter, packed: PackedSurface | str | None = None
    ) -> None:
        """Take what lights the present decoration, on the processor and on the graphics card."""
        self.relighter, self.packed = relighter, packed
        if self.mode is Mode.LIT:
            self.picture_changed.emit()

    def edited_light(self) -> None:
        """What lights the surface followed an edit; the graphics card's copy is out of date."""
        self.packed = None
        if self.mode is Mode.LIT:
            self.picture_changed.emit()

    def drop_light(self) -> None:
        """What lights the surface cannot follow an edit; colours are shown for now."""
        self.relighter = None
        self.edited_light()

    def set_lighting(self, **changes: object) -> None:
        """Light it otherwise, or show its radiance otherwise."""
        lighting = replace(self.lighting, **changes)  # type: ignore[arg-type]
        if lighting != self.lighting:
            self.lighting = lighting
            self.lighting_changed.emit()

    def move_light(self, direction: tuple[float, float, float]) -> None:
        """Let the main lamp shine from `direction`, a unit vector in scene coordinates."""
        lamps, main = list(self.lighting.lamps), self.lighting.main
        if lamps:
            lamps[main] = replace(lamps[main], direction=direction)
            self.set_lighting(lamps=tuple(lamps))

    def drop_textures(self) -> None:
        """Forget pictures of an unfinished result."""
        self.textures.pop(Mode.COLOUR, None)
        self.textures.pop(Mode.SEAMS, None)
        if not self.offers(self.mode):
            self.set_mode(Mode.COLOUR)
        self.picture_changed.emit()

    def set_mode(self, mode: Mode) -> None:
        """Show something else."""
        if mode is not self.mode:
            self.mode = mode
            self.mode_changed.emit()
            self.picture_changed.emit()

    def set_exported(self) -> None:
        """Remember that the result is safe in a file."""
        self.exported = True
        self.result_changed.emit()

    def set_knobs(self, **changes: object) -> None:
        """Turn some knobs."""
        knobs = replace(self.knobs, **changes)  # type: ignore[arg-type]
        if knobs != self.knobs:
            self.knobs = knobs
            self.knobs_changed.emit()

    def choose_sample(self, path: Path | None) -> None:
        """Decide what the next synthesis uses."""
        if path != self.sample_path:
            self.sample_path = path
            self.sample_chosen.emit()

    def offer_samples(self, entries: Sequence[SampleEntry]) -> None:
        """Add samples to those on offer, or replace those of the same path."""
        known = {entry.path: entry for entry in self.samples}
        known.update({entry.path: entry for entry in entries})
        self.samples = tuple(known.values())
        self.samples_changed.emit()
