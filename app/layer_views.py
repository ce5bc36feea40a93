"""The layers of a painting as panels see them: frozen, and free of the engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, cast

from btfcore.files.project.value import Material
from btfcore.paint.document import Layer
from btfcore.paint.edits import AnyEdit, kind_of
from btfcore.painting import Painting, edit_figures
from btfcore.quilt.state import QuiltState
from btfcore.types import I4


@dataclass(frozen=True, eq=False)
class LayerView:
    """An edit as it is now.

    uid : below 0 while it is waited for; sample : name, "" where it has none; figures : see
    `btfcore.painting.edit_figures`; busy : it is being computed; edit : its knobs, None while it
    is waited for; vertices (n,) i4: that it wrote, None where it was not computed.
    """

    uid: int
    name: str
    kind: str
    visible: bool = True
    sample: str = ""
    notes: tuple[str, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    busy: bool = False
    edit: AnyEdit | None = None
    vertices: I4 | None = None


def view_of(layer: Layer, names: Sequence[str], *, busy: bool = False) -> LayerView:
    """What panels see of `layer`; names: of the painting's samples."""
    figures = edit_figures(layer, names)
    result = layer.result
    return LayerView(
        layer.edit.uid, layer.edit.name, kind_of(layer.edit), layer.edit.visible,
        figures["sample"] or "", tuple(figures.get("notes", ())), MappingProxyType(figures), busy,
        cast(AnyEdit, layer.edit), None if result is None else result.delta.vertices,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Mark:
    """Which painting there is and what of it a project file would hold; later changes leave it."""

    painting: Painting | None = None
    layers: tuple[Layer, ...] = ()
    materials: tuple[Material, ...] = ()

    def same(self, other: Mark) -> bool:
        """Whether nothing differs; what was changed and undone does not count."""
        return (
            self.painting is other.painting
            and len(self.layers) == len(other.layers)
            and all(one is two for one, two in zip(self.layers, other.layers, strict=True))
            and self.materials is other.materials
        )


@dataclass(frozen=True, eq=False)
class PaintState:
    """The painting at one moment at which nothing changes it.

    background : the quilt below all edits. history : labels of all steps, `at` of which are done.
    """

    painting: Painting | None = None
    background: QuiltState | None = None
    layers: tuple[LayerView, ...] = ()
    history: tuple[str, ...] = ()
    at: int = 0
    mark: Mark = field(default_factory=Mark)
