"""The picture of Zhou's figure 10: one feature, one area, and four ways to ask for it.

``python -m tests.bench.figure10`` writes docs/gallery/figure10.jpg; every figure in it is
computed from the quilts that it shows. ``--seeds 3`` prints their means over as many backgrounds
instead.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.scene import BOTTOM, TOP, U1, Scene, off_screen_plotter
from btfcore.files.surface import export_input
from btfcore.paint.constrained import energy, seam_count, unit_of
from btfcore.paint.document import Document
from btfcore.paint.edits import Area, PaintEdit, Stroke
from btfcore.paint.engine import Engine
from btfcore.paint.region import constrain
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.recut import vertex_costs
from btfcore.render.camera import Turntable
from btfcore.render.texture import atlas_texture, vertex_colours
from btfcore.types import F4, F8, I4, Sample
from resources.recipes.brick import wall
from resources.recipes.canvas import Canvas
from tests.bench.inputs import found
from tests.bench.table import ROOT

PICTURE = ROOT / "docs" / "gallery" / "figure10.jpg"
MESH, RATE, SCALE = "vase.obj", 512, 0.62
SIDE, FINE = 256, 2  # texels of the sample, drawing samples for each
PAINT = np.array([0.03, 0.2, 0.5])  # linear colour of the painted bricks
BAND = 12.0  # steps to both sides of the area's edge that count as near the border
PANEL, SMALL, STRIP, GAP = (440, 470), 200, 74, 8
SMOOTHING = 2
LARGEST = 240_000  # bytes of the JPEG
INK, PAPER = (40, 40, 44), (246, 246, 244)


@dataclass(frozen=True)
class Way:
    """One way to ask for a feature: width of the zone in steps and λ."""

    name: str
    weight: float
    zone: float


WAYS = (
    Way("abrupt, weight 0.5", 0.5, 0.0),
    Way("abrupt, weight 4", 4.0, 0.0),
    Way("abrupt, small weight 0.05", 0.05, 0.0),
    Way("transition zone, weight 0.5", 0.5, 32.0),
)


@dataclass(frozen=True)
class Figures:
    """Energies of one result over the whole surface, and what was there before.

    E = λD + V, D = Σ |m_σ − m_0| for the m_0 that was asked for, V = Σ V_pq / u. near: V of
    the vertices within the band about the edge of F; per_edge: mean of ½ V_pq over the seam
    edges there, in mean texel differences of the sample; reached: share of F that is feature;
    beyond: feature outside F over the size of F.
    """

    E: float
    D: float
    V: float
    V_before: float
    near: float
    near_before: float
    per_edge: float
    reached: float
    beyond: float


def painted_bricks() -> Sample:
    """A brick wall of which some bricks are painted; the mask has these and half their joints."""
    canvas = Canvas(SIDE, seed=4, fine=FINE)
    drawn = wall(canvas)
    row, column = canvas.grid()
    away = np.hypot(row - 0.5 * SIDE, 0.8 * (column - 0.5 * SIDE))
    blob = away < 0.3 * SIDE
    count = int(drawn.brick.max()) + 1
    whole = np.bincount(drawn.brick.ravel(), minlength=count)
    inside = np.bincount(drawn.brick.ravel(), blob.ravel(), minlength=count)
    chosen = inside > 0.5 * np.maximum(whole, 1)
    mask = chosen[drawn.brick].astype(np.float64)
    clay = np.clip((drawn.face + 0.5) / 1.5, 0, 1) * mask
    grey = drawn.albedo.mean(axis=2, keepdims=True)
    paint = PAINT * (0.55 + 3.0 * grey)
    albedo = drawn.albedo + clay[..., None] * (paint - drawn.albedo)
    down, right = canvas.slopes(drawn.height)
    light = np.clip((1 - 0.5 * right - 0.7 * down) / np.sqrt(1 + right**2 + down**2), 0.15, 1.6)
    linear = canvas.coarse(albedo * light[..., None])
    colour = (np.clip(linear, 0, 1) ** (1 / 2.2)).astype(np.float32)
    return Sample(
        "painted bricks", colour, colour.copy(), mask=canvas.coarse(mask).astype(np.float32)
    )


class Trial:
    """A surface covered with the sample's background, to be painted in several ways."""

    def __init__(self, sample: Sample, *, rate: int = RATE, seed: int = 0) -> None:
        """Cover the mesh."""
        self.prepared = prepare(load_mesh(found(MESH))[0], rate=rate)
        knobs = QuiltParameters(features=False, seed=seed, scale=SCALE * rate / RATE)
        made = synthesizer(self.prepared, sample, knobs)
        made.run()
        self.document = Document(Engine.over(self.prepared, (sample,), made))
        self.stroke = self._stroke()

    def _stroke(self) -> Stroke:
        """A short thick stroke on the side that is seen."""
        dense = self.prepared.dense
        low, high = dense.vertices.min(axis=0), dense.vertices.max(axis=0)
        size = high - low
        right, _, back = SIDE_VIEW.axes()
        points = []
        for across, up in ((-0.06, 0.38), (0.1, 0.47)):
            facing = dense.normals.astype(np.float64) @ back > 0.5
            place = dense.vertices - (low + high) / 2
            off = (place @ right - across * size[1]) ** 2 + (
                dense.vertices[:, 1] - low[1] - up * size[1]
            ) ** 2
            points.append(int(np.where(facing, off, np.inf).argmin()))
        ends = dense.vertices[points]
        line = ends[0] + np.linspace(0, 1, 24)[:, None] * (ends[1] - ends[0])
        normals = np.repeat(back[None], len(line), axis=0)
        return Stroke(line, 0.14 * float(size[1]), normals=normals)

    def target(self, zone: float) -> F8:
        """m_0 (N,) f8 for a zone of `zone` steps."""
        engine = self.document.engine
        constraint = constrain(
            Area((self.stroke,)), self.prepared.mesh, engine.net, engine.locator,
            width=zone * engine.step,
        )  # fmt: skip
        return constraint.spread(len(engine.state.patch)).astype(np.float64)

    def border(self) -> I4:
        """Vertices within the band about the edge of F."""
        soft = self.target(2 * BAND)
        return np.flatnonzero((soft > 0) & (soft < 1)).astype(np.int32)

    def run(self, way: Way) -> tuple[F4, Figures]:
        """Paint; vertex colours (N, 3) f4 and the figures. The surface is as before then."""
        document, engine = self.document, self.document.engine
        near = self.border()
        every = np.arange(len(engine.state.patch), dtype=np.int32)
        whole, before = self._costs(every), self._costs(near)
        document.add(
            PaintEdit(
                area=Area((self.stroke,)), sample=0, weight=way.weight, orientation="field",
                transition=way.zone * engine.step,
            )
        )  # fmt: skip
        result = document.layers[-1].result
        assert result is not None
        inside = self.target(0.0) >= 0.5
        left = energy(engine.net, engine.state, engine.palette, 0, self.target(way.zone))
        shown = engine.palette.feature_at(engine.state.sample, engine.state.source) > 0.5
        cost = self._costs(near)
        edges = max(seam_count(engine.net, engine.state.patch, near), 1)
        unit = unit_of(engine.palette, 0)
        texel = engine.palette.grids[0].texel_difference
        figures = Figures(
            E=left.total(way.weight), D=left.constraint, V=left.smooth, V_before=whole,
            near=cost, near_before=before, per_edge=cost * unit / edges / texel,
            reached=float(shown[inside].mean()),
            beyond=float((shown & ~inside).sum() / inside.sum()),
        )  # fmt: skip
        colours = vertex_colours(document.quilt(), document.samples)
        document.undo()
        return colours, figures

    def _costs(self, vertices: I4) -> float:
        engine, state = self.document.engine, self.document.engine.state
        cost = vertex_costs(
            engine.net.indptr, engine.net.indices, vertices, state.patch, state.source,
            state.ghost, engine.palette.sheet, state.sample,
        )  # fmt: skip
        return float(cost.sum()) / unit_of(engine.palette, 0)


SIDE_VIEW = Turntable(20.0, 6.0)


def draw(trial: Trial, pictures: Sequence[F4]) -> list[U1]:
    """Draw vertex colours (N, 3) on the surface, close: (H, W, 3) u8 each."""
    surface = export_input(trial.prepared.mesh, trial.prepared.atlas)
    width, height = PANEL
    plotter = off_screen_plotter((width * SMOOTHING, height * SMOOTHING))
    try:
        scene = Scene(plotter)
        plotter.set_background(BOTTOM, top=TOP)
        scene.show(surface)
        scene.camera = SIDE_VIEW
        scene.frame(aspect=width / height)
        scene.camera = scene.camera.panned(0.0, 0.07).zoomed(1.75)
        out = []
        for colours in pictures:
            scene.set_texture(atlas_texture(trial.prepared.dense, colours))
            scene.place_camera()
            plotter.render()
            drawn = np.asarray(plotter.screenshot(return_img=True))[..., :3]
            out.append(np.asarray(Image.fromarray(drawn).resize(PANEL, Image.Resampling.BOX)))
        return out
    finally:
        plotter.close()


def grey(values: F8) -> F4:
    """Colours (N, 3) of m_0."""
    return np.repeat((0.12 + 0.8 * values)[:, None], 3, axis=1).astype(np.float32)


def compose(
    sample: Sample, given: Sequence[tuple[str, U1]], results: Sequence[tuple[str, U1, str]]
) -> Image.Image:
    """Lay the page out: what is given above, what came of it with its figures below."""
    assert sample.mask is not None
    width, height = PANEL
    wide = len(results) * width + (len(results) + 1) * GAP
    upper = height * 2 // 3
    page = Image.new("RGB", (wide, upper + height + STRIP + 26 + 4 * GAP + 26), PAPER)
    pen = ImageDraw.Draw(page)
    large, small = ImageFont.load_default(size=19), ImageFont.load_default(size=16)
    mask = np.repeat(sample.mask[..., None], 3, axis=2)
    tiles = [("sample", sample.colour), ("its feature, m_S", mask)]
    shown = [(name, (np.clip(each, 0, 1) * 255 + 0.5).astype(np.uint8)) for name, each in tiles]
    cells = [*shown, *given]
    for number, (name, picture) in enumerate(cells):
        left = GAP + number * (width + GAP)
        drawn = Image.fromarray(picture)
        side = min(upper / drawn.height, width / drawn.width)
        drawn = drawn.resize(
            (round(drawn.width * side), round(drawn.height * side)), Image.Resampling.LANCZOS
        )
        page.paste(drawn, (left + (width - drawn.width) // 2, GAP + 26))
        pen.text((left + (width - drawn.width) // 2, GAP), name, fill=INK, font=large)
    top = upper + 26 + 2 * GAP
    for number, (name, picture, said) in enumerate(results):
        left = GAP + number * (width + GAP)
        pen.text((left, top), name, fill=INK, font=large)
        page.paste(Image.fromarray(picture), (left, top + 26))
        pen.multiline_text((left, top + 26 + height + GAP), said, fill=INK, font=small, spacing=5)
    return page


def save(page: Image.Image, path: Path, largest: int) -> Path:
    """Write a JPEG of at most `largest` bytes, if that can be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    for quality in range(90, 30, -4):
        page.save(path, "JPEG", quality=quality, optimize=True, progressive=True)
        if path.stat().st_size <= largest:
            break
    return path


def said(figures: Figures) -> str:
    """Three lines below a picture."""
    return (
        f"E {figures.E:.0f}    D {figures.D:.0f}    "
        f"V {figures.V:.0f} (before {figures.V_before:.0f})\n"
        f"near the edge V {figures.near:.0f} (before {figures.near_before:.0f}),"
        f" {figures.per_edge:.2f} an edge\n"
        f"{figures.reached:.0%} of the area reached, {figures.beyond:.0%} of it beyond"
    )


def picture(path: Path) -> None:
    """Write the picture."""
    sample = painted_bricks()
    trial = Trial(sample)
    made = [(way, *trial.run(way)) for way in WAYS]
    zone = max(way.zone for way in WAYS)
    shots = draw(
        trial,
        [grey(trial.target(0.0)), grey(trial.target(zone)), *(colours for _, colours, _ in made)],
    )
    given = [("m_0, abrupt", shots[0]), ("m_0 with a transition zone", shots[1])]
    results = [
        (way.name, shot, said(figures))
        for (way, _, figures), shot in zip(made, shots[2:], strict=True)
    ]
    save(compose(sample, given, results), path, LARGEST)


def means(seeds: int) -> str:
    """Table of the figures, means over backgrounds of several seeds."""
    sample = painted_bricks()
    rows: list[list[Figures]] = [[] for _ in WAYS]
    for seed in range(seeds):
        trial = Trial(sample, seed=seed)
        for row, way in zip(rows, WAYS, strict=True):
            row.append(trial.run(way)[1])
    names = [item.name for item in fields(Figures)]
    lines = ["| way | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for way, row in zip(WAYS, rows, strict=True):
        found = np.array([astuple(each) for each in row]).mean(axis=0)
        lines.append(f"| {way.name} | " + " | ".join(f"{value:.3g}" for value in found) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str]) -> None:
    """Write the picture, to PICTURE or the path given, or print the means over seeds."""
    if arguments[:1] == ["--seeds"]:
        print(means(int(arguments[1])))
    else:
        picture(Path(arguments[0]) if arguments else PICTURE)


if __name__ == "__main__":
    main(sys.argv[1:])
