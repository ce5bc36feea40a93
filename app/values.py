"""The frozen values that the window works on: mesh, knobs, atlas, result and samples."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from btfcore.files.surface import ExportSurface
from btfcore.guide import Guide
from btfcore.quilt.measure import SeamMeasures
from btfcore.quilt.parameters import QuiltParameters
from btfcore.render.material import Material
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
class Knobs:
    """What the user may set; `rate` is the side of the atlas, the rest is the quilting's."""

    rate: int = 512
    scale: float = 1.0
    seed: int = 0
    work_patch: int | None = None

    def quilting(self) -> QuiltParameters:
        """Return them as the quilting wants them; raises `InvalidParameter`."""
        return QuiltParameters(
            scale=self.scale, seed=self.seed, work_patch=self.work_patch, features=False
        )


@dataclass(frozen=True, eq=False)
class Opened:
    """A mesh as it was read: its file, its repaired self, what was found, and its shape."""

    path: Path
    mesh: Mesh
    imported: ImportReport
    surface: ExportSurface


@dataclass(frozen=True, eq=False)
class Canvas:
    """A mesh prepared at some rate, ready to be drawn: `gutter` is its `gutter_source`.

    guide : what its orientation field was made from, None: nothing that the user drew.
    """

    prepared: Prepared
    surface: ExportSurface
    gutter: I4
    guide: Guide | None = None


@dataclass(frozen=True, eq=False)
class Decoration:
    """A decorated surface; `materials` are what it is lit with, by sample number.

    patches, seams, seconds are those of the background's synthesis.
    """

    canvas: Canvas
    samples: tuple[Sample, ...]
    quilt: Quilt
    patches: int
    seams: SeamMeasures
    seconds: float
    materials: tuple[Material, ...] = ()

    @property
    def sample(self) -> Sample:
        """The background's first sample."""
        return self.samples[0]


@dataclass(frozen=True, eq=False)
class SampleEntry:
    """A sample on offer: its small picture, or why it cannot be read; neither while loading.

    feature : it comes with the mask of one.
    """

    path: Path
    thumbnail: U1 | None = None
    error: str = ""
    feature: bool = False
