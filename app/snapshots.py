"""A painting at one moment, taken without stopping what changes it.

Layers and materials are replaced as a whole and never changed, and no edit touches the
background; so with a copy of that, a project can be written while the next edit is computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from btfcore.files.project.value import Material, Project, StoredEdit
from btfcore.paint.delta import put
from btfcore.paint.document import Layer
from btfcore.paint.edits import AnyEdit
from btfcore.paint.engine import copied
from btfcore.painting import Painting
from btfcore.quilt.sheet import Sheet
from btfcore.quilt.state import QuiltState
from btfcore.render.thumbnail import thumbnail


@dataclass(frozen=True, eq=False)
class Mark:
    """A painting as it is at one moment; later changes leave it as it is."""

    painting: Painting | None = None
    layers: tuple[Layer, ...] = ()
    materials: tuple[Material, ...] = ()
    touched: int = 0

    def same(self, other: Mark) -> bool:
        """Whether nothing differs; what was changed and undone does not count."""
        return (
            self.painting is other.painting
            and len(self.layers) == len(other.layers)
            and all(one is two for one, two in zip(self.layers, other.layers, strict=True))
            and self.materials is other.materials
            and self.touched == other.touched
        )

    @classmethod
    def of(cls, painting: Painting, touched: int = 0) -> Mark:
        """The painting as it is now; cheap, and right in whatever thread it is being changed."""
        layers = painting.document.layers  # first: their samples are among the materials
        return cls(painting, layers, painting.materials, touched)


def project_at(mark: Mark, background: QuiltState) -> Project:
    """What a project file holds of a painting at the moment of `mark`.

    background : its quilt without any edit, of which nobody else changes anything.
    """
    assert mark.painting is not None
    document, engine = mark.painting.document, mark.painting.document.engine
    edits = tuple(
        StoredEdit(cast(AnyEdit, layer.edit))
        if layer.result is None
        else StoredEdit(
            cast(AnyEdit, layer.edit), layer.result.delta, dict(vars(layer.result.report))
        )
        for layer in mark.layers
    )
    following = max((each.edit.uid + 1 for each in edits), default=0)
    return Project(
        engine.prepared, engine.parameters, mark.materials, background, edits,
        max(document.next_uid, following), engine.tokens, engine.state.patches,
        mark.painting.plan, "", engine.net,
    )  # fmt: skip


def picture_at(project: Project, mark: Mark, grids: Sheet, *, side: int) -> NDArray[np.uint8]:
    """Small picture (side, side, 3) u8 of a project made at `mark`; grids : of its samples."""
    assert project.net is not None
    state = copied(project.background)
    for layer in mark.layers:
        if layer.edit.visible and layer.result is not None:
            put(project.net, state, layer.result.delta.vertices, layer.result.delta.after)
    samples = [each.sample for each in project.materials]
    return thumbnail(project.prepared.dense, state.quilt(grids), samples, side=side)
