"""The picture of painted meshes in the gallery: before and after, side by side.

``python -m tests.bench.painted_picture`` writes docs/gallery/painted.jpg from what ships.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from app.scene import BOTTOM, TOP, U1, render
from btfcore.btf.appearance import quilting_sample
from btfcore.files.samples import open_sample
from btfcore.files.surface import export_input
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Stroke
from btfcore.paint.engine import Engine
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.parameters import QuiltParameters
from btfcore.render.camera import Turntable
from btfcore.render.texture import atlas_texture, vertex_colours
from btfcore.types import F8, Prepared
from tests.bench.figure10 import save
from tests.bench.inputs import found
from tests.bench.table import ROOT

PICTURE = ROOT / "docs" / "gallery" / "painted.jpg"
RATE = 768
PANEL = (420, 420)
GAP = 6
SWATCH = 96  # side of the sample in the corner
LARGEST = 380_000  # bytes of the JPEG


@dataclass(frozen=True)
class Line:
    """A stroke as it is drawn on the picture: points in -1 … 1 of its half width, y up.

    radius : of the brush over the feature's own half-width.
    """

    points: tuple[tuple[float, float], ...]
    radius: float = 1.1


@dataclass(frozen=True)
class Piece:
    """One mesh with its sample and what is painted on it."""

    mesh: str
    sample: str
    view: Turntable
    lines: tuple[Line, ...]
    scale: float = 1.0


PIECES = (
    Piece(
        "vase.obj", "cracked-brick.btfz", Turntable(20.0, 8.0),
        (Line(((-0.28, 0.2), (-0.05, 0.02), (0.02, -0.25), (0.25, -0.5)), 1.2),),
    ),
    Piece(
        "cat.obj", "mossy-stone.btfz", Turntable(25.0, 12.0),
        (
            Line(((0.0, -0.4), (0.2, -0.34), (0.42, -0.12)), 0.8),
            Line(((0.4, 0.85), (0.5, 0.6)), 0.5),
        ),
    ),
    Piece(
        "spot.obj", "rusty-paint.btfz", Turntable(-60.0, 14.0),
        (Line(((-0.3, 0.05), (0.05, 0.1), (0.3, 0.0)), 0.9), Line(((0.45, -0.35),), 0.7)),
    ),
    Piece(
        "knot.obj", "stained-linen.btfz", Turntable(15.0, 20.0),
        (Line(((0.28, 0.15), (0.3, -0.3)), 0.7), Line(((-0.62, 0.5), (-0.45, 0.6)), 0.7)),
    ),
)  # fmt: skip


def on_surface(prepared: Prepared, view: Turntable, line: Line) -> tuple[F8, F8]:
    """Nearest visible surface points (n, 3) of a line in the picture, and the normals there."""
    dense = prepared.dense
    right, up, back = view.axes()
    place = dense.vertices - (dense.vertices.min(axis=0) + dense.vertices.max(axis=0)) / 2
    across, high, depth = (np.einsum("ij,j->i", place, axis) for axis in (right, up, back))
    half = max(float(np.abs(across).max()), float(np.abs(high).max()))
    facing = np.einsum("ij,j->i", dense.normals.astype(np.float64), back) > 0.2
    corners = np.array(line.points)
    stops = np.linspace(0, len(corners) - 1, 12 * len(corners)) if len(corners) > 1 else [0.0]
    drawn = np.stack([np.interp(stops, range(len(corners)), each) for each in corners.T], axis=1)
    met = []
    for x, y in (drawn * half).tolist():
        near = np.hypot(across - x, high - y)
        hit = facing & (near < max(2 * dense.step, float(near[facing].min()) * 1.01))
        met.append(int(np.where(hit, depth, -np.inf).argmax()))
    return dense.vertices[met].copy(), dense.normals[met].astype(np.float64)


def panels(piece: Piece, *, rate: int = RATE) -> tuple[U1, U1, str]:
    """Pictures (H, W, 3) u8 before and after, and a line of figures."""
    sample = quilting_sample(open_sample(found(piece.sample)))
    prepared = prepare(load_mesh(found(piece.mesh))[0], rate=rate)
    made = synthesizer(prepared, sample, QuiltParameters(features=False, scale=piece.scale))
    made.run()
    document = Document(Engine.over(prepared, (sample,), made))
    engine = document.engine
    half = engine.palette.half_width(0) * engine.palette.grids[0].unit * engine.step
    surface = export_input(prepared.mesh, prepared.atlas)
    swatch = Image.fromarray((np.clip(sample.colour, 0, 1) * 255 + 0.5).astype(np.uint8))
    swatch = swatch.resize((SWATCH, SWATCH), Image.Resampling.LANCZOS)

    def shot() -> U1:
        colours = vertex_colours(document.quilt(), document.samples)
        texture = atlas_texture(prepared.dense, colours)
        drawn = render(surface, texture, [piece.view], size=PANEL)[0]
        ramp = np.linspace(np.array(TOP), np.array(BOTTOM), PANEL[1])[:, None] * 255
        whole = ramp * (1 - drawn[..., 3:] / 255.0) + drawn[..., :3]
        return np.clip(whole + 0.5, 0, 255).astype(np.uint8)

    before = shot()
    before[-SWATCH - 10 : -8, 8 : SWATCH + 10] = 255
    before[-SWATCH - 9 : -9, 9 : SWATCH + 9] = np.asarray(swatch)
    told = []
    for line in piece.lines:
        points, normals = on_surface(prepared, piece.view, line)
        stroke = Stroke(points, line.radius * half, normals=normals)
        document.add(PaintEdit(area=Area((stroke,)), sample=0))
        result = document.layers[-1].result
        assert result is not None
        report = result.report
        told.append(f"{report.reached / report.area:.0%} of {report.area}")
    return before, shot(), f"{piece.mesh} {piece.sample}: reached {', '.join(told)}"


def main(arguments: Sequence[str]) -> None:
    """Write the picture, to PICTURE or the path given."""
    width, height = PANEL
    page = Image.new(
        "RGB", (len(PIECES) * width + (len(PIECES) - 1) * GAP, 2 * height + GAP), "white"
    )
    for number, piece in enumerate(PIECES):
        before, after, told = panels(piece)
        print(told)
        page.paste(Image.fromarray(before), (number * (width + GAP), 0))
        page.paste(Image.fromarray(after), (number * (width + GAP), height + GAP))
    save(page, Path(arguments[0]) if arguments else PICTURE, LARGEST)


if __name__ == "__main__":
    main(sys.argv[1:])
