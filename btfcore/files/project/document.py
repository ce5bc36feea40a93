"""Between a document at work and what a project file holds of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from btfcore.errors import InvalidEdit
from btfcore.files.project.value import Material, Project, StoredEdit
from btfcore.paint.delta import put
from btfcore.paint.document import Document, Layer
from btfcore.paint.edits import AnyEdit
from btfcore.paint.engine import Engine, Report, Result, copied
from btfcore.quilt.state import QuiltState
from btfcore.regions import Plan


def project_of(
    document: Document, materials: Sequence[Material], plan: Plan | None = None, token: str = ""
) -> Project:
    """Return what a project file holds of a document and the materials behind its samples.

    Arrays are shared where edits do not change them. Raises `InvalidEdit` while a stroke is
    being painted.
    """
    engine = document.engine
    edits = tuple(
        StoredEdit(cast(AnyEdit, layer.edit))
        if layer.result is None
        else StoredEdit(
            cast(AnyEdit, layer.edit), layer.result.delta, dict(vars(layer.result.report))
        )
        for layer in document.layers
    )
    return Project(
        engine.prepared, engine.parameters, tuple(materials), background_of(document), edits,
        document.next_uid, engine.tokens, engine.state.patches, plan, token, engine.net,
    )  # fmt: skip


def background_of(document: Document) -> QuiltState:
    """Copy of the quilt without any edit; raises `InvalidEdit` while a stroke is painted."""
    engine = document.engine
    if engine.busy:
        raise InvalidEdit("an edit is being painted; finish or cancel it before saving")
    state = copied(engine.state)
    for layer in reversed(document.layers):
        if layer.edit.visible and layer.result is not None:
            delta = layer.result.delta
            put(engine.net, state, delta.vertices, delta.before)
    state.patches = int(state.patch.max(initial=-1)) + 1
    return state


def document_of(project: Project) -> Document:
    """Put a document together again; every bit of its quilt and deltas is what was saved."""
    assert project.net is not None
    engine = Engine(
        project.prepared, [each.sample for each in project.materials], project.net,
        copied(project.background), project.parameters, layout=project.background.layout,
        scales=[each.scale for each in project.materials],
    )  # fmt: skip
    layers = []
    for stored in project.edits:
        result = None
        if stored.delta is not None:
            result = Result(stored.delta, Report(**(stored.figures or {})))  # type: ignore[arg-type]
            if stored.edit.visible:
                engine.put_on(result)
        layers.append(Layer(stored.edit, result))
    engine.tokens, engine.state.patches = project.tokens, project.patches
    document = Document(engine)
    document.restore(layers, project.next_uid)
    return document
