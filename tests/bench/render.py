"""Rendering: time against error, by mode, rank, backend, representation and interpolation."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from btfcore.btf.appearance import quilting_sample
from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.harmonics.fit import fit_harmonics
from btfcore.errors import InvalidParameter
from btfcore.pipeline import load_mesh, prepare, synthesizer
from btfcore.quilt.parameters import QuiltParameters
from btfcore.render import reference
from btfcore.render.camera import Turntable
from btfcore.render.evaluate import Evaluator
from btfcore.render.lights import Lights, directional
from btfcore.render.material import (
    FactorMaterial,
    Material,
    factor_material,
    harmonic_material,
    raw_material,
    truncated,
)
from btfcore.render.pool import shared_pool, threads
from btfcore.render.relight import MODES, Relighter
from btfcore.types import F4, F8, Prepared, Quilt
from tests.bench import truth
from tests.bench.inputs import found, present
from tests.bench.table import machine, markdown, publish
from tests.bench.woven import woven_btf

RATES = (512, 1024)
RANKS = (24, 16, 8)
FRAMES = 8
NOTE = """The bunny quilted with the woven sample, seen as in the window; the light moves from frame
to frame, and all texels that can be seen are lit. *ms*: CPU milliseconds a frame; *wall*: the same
on as many threads as named (depends on what else runs); *ns*: CPU time a texel; *of full*: CPU time
over that of all factors on one thread; *RMSE*: of sRGB against all factors at every texel. *image*:
coding and filling the gutter are counted too. The reference is plain numpy, timed on some texels;
its error is that of the compiled backend against it."""
NOTE_WAYS = """One picture of a ball (one surfel a pixel, between texels too) under four lights,
compiled, one thread. *ns*: CPU nanoseconds a surfel and light; errors against the traced
relief. *MB*: tables and maps."""


def covered(rate: int) -> tuple[Prepared, Quilt, FactorMaterial]:
    """The bunny quilted with the woven sample."""
    names, _ = present(["bunny.obj"])
    btf = woven_btf()
    prepared = prepare(load_mesh(found(names[0]))[0], rate=rate)
    quilt = synthesizer(prepared, quilting_sample(btf), QuiltParameters()).run()
    return prepared, quilt, factor_material(btf)


def moving(count: int) -> list[Lights]:
    """One directional light, a little further in every frame."""
    turn = np.radians(25 + 3.0 * np.arange(count))
    return [directional([np.sin(t), 0.5, np.cos(t)]) for t in turn]


def eye_of(prepared: Prepared, place: Callable[[F8], F8]) -> F8:
    """Homogeneous scene coordinates of the default camera, framing the mesh in 800 x 600."""
    camera = Turntable().framing(prepared.mesh.vertices, aspect=800 / 600)
    return np.append(place(camera.position), 1.0)


def clocked(work: Callable[[Lights], object], lights: list[Lights]) -> tuple[float, float]:
    """CPU and wall milliseconds a frame, warm; the middle one of the frames."""
    work(lights[0])
    taken = []
    for one in lights:
        wall, cpu = time.perf_counter(), time.process_time()
        work(one)
        taken.append((time.process_time() - cpu, time.perf_counter() - wall))
    cpu, wall = np.median(np.array(taken), axis=0) * 1e3
    return float(cpu), float(wall)


def off(one: F4, two: F4) -> float:
    """RMSE of sRGB colours."""
    wrong = linear_to_srgb(one).astype(np.float64) - linear_to_srgb(two)
    return float(np.sqrt((wrong**2).mean()))


def speeds(rate: int, frames: int) -> list[tuple]:
    """Time and error of every mode, rank and backend on one atlas."""
    prepared, quilt, material = covered(rate)
    materials = [material]
    lights = moving(frames)
    alone = ThreadPoolExecutor(1)
    relighter = Relighter(prepared, quilt, materials, pool=alone)
    eye = eye_of(prepared, relighter.place.to_scene)
    relighter.look(eye)
    seen, surfels = relighter.visible, relighter.surfels
    full = Evaluator(materials)
    wanted = full.radiance(surfels, eye, lights[-1], seen)

    def row(backend: str, mode: str, work: Callable[[Lights], object], error: float) -> list[Any]:
        cpu, wall = clocked(work, lights)
        return [rate, backend, mode, len(seen), cpu, wall, cpu * 1e6 / len(seen), error]

    some = seen[:: max(1, len(seen) // 4000)]
    spent = time.process_time()
    plain = reference.radiance(materials, surfels, eye, lights[-1], chosen=some)
    spent = (time.process_time() - spent) * 1e3 * len(seen) / len(some)
    gone = off(full.radiance(surfels, eye, lights[-1], some), plain)
    rows: list[list[Any]] = [
        [rate, "reference", "full", len(seen), spent, spent, spent * 1e6 / len(seen), gone]
    ]
    for count, pool in ((1, None), (threads(), shared_pool())):
        if count == 1 and pool is not None:
            continue
        work = lambda light, pool=pool: full.radiance(surfels, eye, light, seen, pool=pool)  # noqa: E731
        rows.append(row(f"compiled, {count}", "full", work, 0.0))
    for rank in RANKS:
        few = Evaluator([truncated(material, rank)])
        error = off(few.radiance(surfels, eye, lights[-1], seen), wanted)
        work = lambda light, few=few: few.radiance(surfels, eye, light, seen)  # noqa: E731
        rows.append(row("compiled, 1", f"{rank} factors", work, error))
    for mode in MODES:
        if mode not in relighter.modes:
            continue

        def drawn(light: Lights, mode: str = mode) -> None:
            relighter.light(light)
            relighter.draw(mode=mode)

        made = row("compiled, 1", f"{mode}, image", drawn, 0.0)
        made[-1] = relighter.quality().error
        rows.append(made)
    base = next(one[4] for one in rows if one[1] == "compiled, 1" and one[2] == "full")
    return [(*one[:-1], one[4] / base, one[-1]) for one in rows]


def ways(size: int, directions: str, rank: int, pixels: int) -> list[tuple]:
    """Time and error against the truth of representations and interpolations."""
    subject = truth.cobbled(size, directions, rank=rank)
    sample = subject.sample
    shots = truth.sphere_shots(subject, pixels, whole=False)
    wanted = [shot.truth for shot in shots]
    made: list[tuple[str, str, Material]] = []
    for scheme in truth.SCHEMES:
        try:
            full = factor_material(sample, method=scheme)
        except InvalidParameter:  # no grid
            continue
        made.append((f"{rank} factors", scheme, full))
        made.append(("images", scheme, raw_material(sample, method=scheme)))
    best = factor_material(sample)
    for few in (rank * 3 // 5, rank * 2 // 5, rank // 5):
        made.append((f"{few} factors", best.views.method, truncated(best, few)))
    for order in (2, 4):
        try:
            fitted = fit_harmonics(sample, order=order, errors=False)
        except InvalidParameter:  # too few lights to tell its functions apart
            continue
        shaped = harmonic_material(fitted, sample)
        made.append((f"harmonics of order {order}", shaped.views.method, shaped))
    rows = []
    for name, scheme, material in made:
        scene = shots[0].scene
        evaluator = Evaluator([material])
        lights = [directional(shot.light) for shot in shots]

        def work(light: Lights, evaluator: Evaluator = evaluator) -> F4:
            return evaluator.radiance(scene.surfels, scene.eye, light)  # noqa: B023

        cpu, _ = clocked(work, lights * 2)
        missed = truth.miss([work(light) for light in lights], wanted, shots)
        size_mb = sum(
            value.nbytes for value in vars(material).values() if isinstance(value, np.ndarray)
        )
        rows.append(
            (name, scheme, cpu * 1e6 / len(scene.surfels), size_mb / 1e6, missed.L2, missed.RMSE,
             missed.SSIM)
        )  # fmt: skip
    return rows


def shader() -> str:
    """Frames a second of the shader on whatever draws here, or why there is none."""
    try:
        from tests.bench.shader import measure_shader

        one = measure_shader((800, 600), 512, 4.0, mesh=found(present(["bunny.obj"])[0][0]))
    except Exception as error:  # no OpenGL at all: drivers raise what they like
        return f"The shader was not measured: {type(error).__name__}: {error}"
    return (
        f"Shader, 800 x 600, atlas 512², {one.rank} factors, one light: {one.frames_a_second:.3g}"
        f" frames a second on {one.renderer} ({one.version}); {one.covered:.0%} of the picture"
        " covered."
    )


def window() -> str:
    """Frames in the real window, from a process of its own, or why there are none."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "Frames in the window were not measured: there is no display."
    if importlib.util.find_spec("tests.bench.window_frames") is None:
        return "Frames in the window were not measured: tests/bench/window_frames.py is not here."
    done = subprocess.run(
        [sys.executable, "-m", "tests.bench.window_frames"], capture_output=True, text=True,
        check=False, timeout=1200,
    )  # fmt: skip
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"Frames in the window were not measured: exit {done.returncode}, {last}"
    return "Frames in the real window, real mouse events:\n\n```\n" + done.stdout.rstrip() + "\n```"


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` takes one small atlas, few directions and no window."""
    columns = ["atlas", "backend", "mode", "texels", "ms", "wall", "ns", "of full", "RMSE"]
    rows = []
    for rate in (128,) if quick else RATES:
        rows += speeds(rate, 3 if quick else FRAMES)
    parts = ["## Rendering", machine(), markdown(columns, rows), NOTE]
    few = ways(16, "6x3x6x3", 20, 64) if quick else ways(32, "12x8x12x8", 40, 300)
    columns = ["what", "interpolation", "ns", "MB", "L2", "RMSE", "SSIM"]
    parts += [markdown(columns, few), NOTE_WAYS]
    if not quick:
        parts += [shader(), window()]
    parts.append(truth.tables(quick=quick))
    publish("render", "\n\n".join(parts), write=write)
