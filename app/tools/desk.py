"""What tools that change the surface need besides the view, and when they cannot work."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PyQt6.QtCore import QCoreApplication

from app.document import Document
from app.picking import Hits
from app.tools.base import PointerEvent, Stage
from app.tools.marks import Label, Mark, Ring
from btfcore.types import F8, Mesh

if TYPE_CHECKING:
    from app.edits import Edits

UNABLE = (150, 150, 150)  # colour of the ring of a tool that cannot work
_translate = QCoreApplication.translate


@dataclass(eq=False)
class Desk:
    """Document and verbs; `tell` shows the user a sentence, `touched` hears of a place (3,)."""

    document: Document
    edits: Edits
    tell: Callable[[str], None]
    touched: Callable[[F8], None] = lambda place: None
    _images: dict[object, tuple[F8, ...]] = field(default_factory=dict)
    _middle: tuple[Mesh, F8] | None = None

    def lacking(self, *, feature: bool = False) -> str:
        """Why a tool cannot change the surface now, "" where it can.

        feature : it needs a sample with a mask.
        """
        document = self.document
        if document.opened is None and document.canvas is None:
            return _translate("Tools", "Open a mesh first.")
        if document.painting is None:
            return _translate("Tools", "Synthesise first: there is nothing to work on yet.")
        if feature and not self.has_feature():
            return _translate(
                "Tools", "This sample has no feature: mark one on it, or take another sample."
            )
        return ""

    def has_feature(self) -> bool:
        """Whether the sample to paint with has a mask, as far as that is known."""
        document, wanted = self.document, self.document.options.sample
        if isinstance(wanted, Path):
            if wanted in document.masks:
                return bool(document.masks[wanted].max() > 0)
            return any(each.feature for each in document.samples if each.path == wanted)
        materials = document.state.mark.materials
        if wanted is not None:
            materials = tuple(each for each in materials if each.name == wanted)
        mask = materials[0].sample.mask if materials else None
        return mask is not None and bool(mask.max() > 0)

    def images(self, point: F8, normal: F8) -> tuple[tuple[F8, F8], ...]:
        """Position (3,) and normal (3,) of a place, then of its images in the symmetry set."""
        document = self.document
        options = document.options
        if not options.mirror and options.radial == 1:
            return ((point, normal),)
        mesh = _mesh(document)
        if mesh is None:
            return ((point, normal),)
        if self._middle is None or self._middle[0] is not mesh:
            from btfcore.paint.symmetry import origin_of

            self._middle = (mesh, origin_of(options.symmetry(), mesh))
        key = (options.mirror, options.radial, options.axis)
        if key not in self._images:
            from btfcore.paint.symmetry import transforms

            self._images = {key: transforms(options.symmetry())}
        middle = self._middle[1]
        return tuple(
            (middle + np.einsum("ij,j->i", each, point - middle),
             np.einsum("ij,j->i", each, normal))
            for each in self._images[key]
        )  # fmt: skip


def hit(stage: Stage, event: PointerEvent) -> Hits | None:
    """What is seen under the pointer, one place; None beside the surface."""
    picker = stage.picker
    if picker is None:
        return None
    found = picker.pick(stage.view(), np.array([event.pixel], np.float64))
    return found if found.on[0] else None


def sentence(hits: Hits, radius: float, text: str) -> tuple[Mark, ...]:
    """Marks that say at a place why nothing will happen there."""
    ring = Ring(hits.position[0], hits.normal[0], radius, 1.0, UNABLE)
    return (ring, Label(hits.position[0], text))


def _mesh(document: Document) -> Mesh | None:
    if document.opened is not None:
        return document.opened.mesh
    return None if document.canvas is None else document.canvas.prepared.mesh
