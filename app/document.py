"""What the window works on: a mesh, samples, knobs and the result; it knows no widget."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PyQt6.QtCore import QObject, pyqtSignal

from btfcore.files.surface import ExportSurface
from btfcore.quilt.measure import SeamMeasures
from btfcore.quilt.parameters import QuiltParameters
from btfcore.render.importance import LightTree
from btfcore.render.material import Material
from btfcore.render.relight import Relighter
from btfcore.types import I4, ImportReport, Mesh, Prepared, Quilt, Sample

U1 = NDArray[np.uint8]
RATES = (256, 512, 1024, 2048)


class Mode(StrEnum):
    """What is drawn on the surface."""

    COLOUR = "colour"
    SEAMS = "seams"
    CHARTS = "charts"
    FIELD = "field"
    LIT = "lit"


@dataclass(frozen=True)
class Lamp:
    """A distant light: unit direction towards it in scene coordinates, linear colour, strength."""

    direction: tuple[float, float, float] = (0.45, 0.55, 0.705)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    strength: float = 1.0


@dataclass(frozen=True)
class Lighting:
    """What the surface is lit by and how its radiance is shown.

    lamps: `main` is the one that dragging moves. exposure in stops; curve: one of those of
    `btfcore.render.tonemap`. environment: light from all around, of the file `source`, turned
    by `turn` degrees. shadows: lamps cast shadows between parts of the mesh.
    """

    lamps: tuple[Lamp, ...] = (Lamp(),)
    main: int = 0
    exposure: float = 0.0
    curve: str = "clip"
    environment: LightTree | None = None
    source: str = ""
    turn: float = 0.0
    shadows: bool = False


@dataclass(frozen=True)
class Knobs:
    """What the user may set; `rate` is the side of the atlas, the rest is the quilting's."""

    rate: int = 512
    scale: float = 1.0
    seed: int = 0
    work_patch: int | None = None

    def quilting(self) -> QuiltParameters:
        """Return them as the quilting wants them; raises `InvalidParameter`."""
        return QuiltParameters(scale=self.scale, seed=self.seed, work_patch=self.work_patch)


@dataclass(frozen=True, eq=False)
class Opened:
    """A mesh as it was read: its file, its repaired self, what was found, and its shape."""

    path: Path
    mesh: Mesh
    imported: ImportReport
    surface: ExportSurface


@dataclass(frozen=True, eq=False)
class Canvas:
    """A mesh prepared at some rate, ready to be drawn: `gutter` is its `gutter_source`."""

    prepared: Prepared
    surface: ExportSurface
    gutter: I4


@dataclass(frozen=True, eq=False)
class Decoration:
    """A finished synthesis; `materials` are what it is lit with, by sample number."""

    canvas: Canvas
    sample: Sample
    quilt: Quilt
    patches: int
    seams: SeamMeasures
    seconds: float
    materials: tuple[Material, ...] = ()


@dataclass(frozen=True, eq=False)
class SampleEntry:
    """A sample on offer: its small picture, or why it cannot be read; neither while loading."""

    path: Path
    thumbnail: U1 | None = None
    error: str = ""


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
        self.growing = False  # a synthesis runs, and its partial pictures are shown

    @property
    def surface(self) -> ExportSurface | None:
        """The surface to draw: with the atlas's coordinates as soon as there is an atlas."""
        if self.canvas is not None:
            return self.canvas.surface
        return self.opened.surface if self.opened is not None else None

    @property
    def texture(self) -> U1 | None:
        """The image to draw on it in the present mode; None: plain."""
        if self.mode is Mode.LIT:  # until there is light
            return self.textures.get(Mode.COLOUR)
        return self.textures.get(self.mode)

    @property
    def lit(self) -> Relighter | None:
        """What lights the surface that is shown, while it is to be shown under light."""
        done = self.decoration
        ready = self.mode is Mode.LIT and not self.growing and done is not None
        return self.relighter if ready and done and done.canvas is self.canvas else None

    @property
    def unsaved(self) -> bool:
        """There is a result that was not exported."""
        return self.decoration is not None and not self.exported

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
        self.canvas = self.decoration = self.relighter = None
        self.growing = False
        self.exported = True
        self.textures = {}
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
        self.relighter = None
        self.growing = False
        self.exported = False
        self.set_canvas(decoration.canvas)
        self.textures.pop(Mode.COLOUR, None)
        self.textures.pop(Mode.SEAMS, None)
        self.result_changed.emit()

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

    def set_relighter(self, relighter: Relighter) -> None:
        """Take what lights the present decoration."""
        self.relighter = relighter
        if self.mode is Mode.LIT:
            self.picture_changed.emit()

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
