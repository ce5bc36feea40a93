"""The picture that `--preview` saves."""

from __future__ import annotations

from pathlib import Path

from btfcore.pipeline import Decorated


def preview_decorated(path: Path, done: Decorated) -> None:
    """Render the decorated input mesh off-screen, the samples beside it, into a PNG at `path`."""
    from app.scene import render_preview
    from btfcore.files.surface import export_input
    from btfcore.render.texture import atlas_texture, vertex_colours

    prepared, samples = done.prepared, done.samples or (done.sample,)
    texture = atlas_texture(prepared.dense, vertex_colours(done.quilt, samples))
    surface = export_input(prepared.mesh, prepared.atlas)
    render_preview(path, surface, texture, sample=samples)
