"""Frames a second of the fragment shader under a moving light, on whatever draws here.

Run on a machine with a graphics card, no display is needed: python -m tests.bench.shader
It names the renderer; on a driver that draws on the processor the figure says nothing of a card.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from btfcore.types import Quilt


@dataclass(frozen=True)
class Speed:
    """A figure and what it was measured on; covered: share of the picture's pixels."""

    renderer: str
    version: str
    software: bool
    frames: int
    seconds: float
    frames_a_second: float
    size: tuple[int, int]
    rate: int
    rank: int
    layout: str
    lights: int
    surface: str
    covered: float
    first_frame_s: float


def measure_shader(
    size: tuple[int, int] = (1920, 1080),
    rate: int = 1024,
    seconds: float = 5.0,
    *,
    rank: int = 40,
    layout: str = "12x8x12x8",
    lights: int = 1,
    mesh: str | Path | None = None,
) -> Speed:
    """Draw a surface with an atlas of `rate` x `rate` texels for about so many seconds.

    The light turns with every frame, whose end is waited for. mesh : a file, which is prepared
    and laid out with one copy of the sample beside the other; None: a torus. The sample has
    256 x 256 texels and `rank` factors by chance: the work of a shader does not depend on them.
    """
    from app.backend import is_software
    from app.shader import machine_of
    from btfcore.files.surface import export_input
    from btfcore.pipeline import load_mesh, prepare
    from btfcore.render.gutter import gutter_source
    from btfcore.render.lights import directional
    from btfcore.render.surfels import placement, surfels
    from tests.app.fakes import torus
    from tests.app.fragments import Stage
    from tests.render.chance import factor_sample

    if mesh is None:
        shape, atlas, dense, field = torus(size=rate, coarse=96)
    else:
        prepared = prepare(load_mesh(mesh)[0], rate=rate)
        shape, atlas, dense, field = prepared.mesh, prepared.atlas, prepared.dense, prepared.field
    count = len(dense.vertices)
    quilt = Quilt(
        dense.texel[:, ::-1].astype(np.float32),
        np.zeros(count, np.float32),
        np.zeros(count, np.uint16),
        np.zeros(count, np.int32),
    )
    made = surfels(dense, field, quilt, placement(shape.vertices))
    stage = Stage(export_input(shape, atlas), made, gutter_source(dense), size=size)
    window = stage.plotter.ren_win
    sample = factor_sample(rank=rank, shape=(256, 256), layout=layout, tiles=True)

    def moved(turn: float) -> None:
        around = turn + 2 * np.pi * np.arange(lights) / lights
        where = np.stack([np.cos(around), np.full(lights, 0.6), np.sin(around)], axis=1)
        stage.shader.set_lights(directional(where))
        window.Render()
        window.WaitForCompletion()

    try:
        white = stage.draw()
        covered = float((white.min(axis=2) < 255).mean())
        begin = time.perf_counter()
        stage.show([sample], directional([0.0, 0.0, 1.0]))
        moved(0.0)
        first = time.perf_counter() - begin
        moved(0.01)
        frames, begin = 0, time.perf_counter()
        while frames < 2 or time.perf_counter() - begin < seconds:
            frames += 1
            moved(0.02 * frames)
        taken = time.perf_counter() - begin
        machine = machine_of(window)
    finally:
        stage.close()
    return Speed(
        machine.renderer, machine.version, is_software(machine.renderer), frames, taken,
        frames / taken, size, rate, rank, layout, lights,
        "torus" if mesh is None else Path(mesh).name, covered, first,
    )  # fmt: skip


def main() -> None:
    """Measure, and print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--rate", type=int, default=1024)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rank", type=int, default=40)
    parser.add_argument("--layout", default="12x8x12x8")
    parser.add_argument("--lights", type=int, default=1)
    parser.add_argument("--mesh")
    given = parser.parse_args()
    width, height = (int(each) for each in given.size.split("x"))
    found = measure_shader(
        (width, height), given.rate, given.seconds, rank=given.rank, layout=given.layout,
        lights=given.lights, mesh=given.mesh,
    )  # fmt: skip
    print(json.dumps(asdict(found), indent=2))


if __name__ == "__main__":
    main()
