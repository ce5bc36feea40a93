"""Baking: time of layouts and knobs, exact tracing against fixed steps, agreement with Mitsuba."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields

import numpy as np
from numba import njit

from btfcore.btf.bake.build import baked
from btfcore.btf.bake.horizon import horizons
from btfcore.btf.bake.maps import resized
from btfcore.btf.bake.relief import Relief, relief
from btfcore.btf.bake.trace import surface, trace
from btfcore.btf.directions import from_angles, layout
from btfcore.btf.materialize import blocks
from btfcore.btf.pbr import PbrSet
from btfcore.btf.readers.pbr_files import read_pbr
from btfcore.progress import silent
from tests.bench.inputs import FOLDERS
from tests.bench.table import machine, markdown, publish
from tests.btf.bake import reference
from tests.btf.bake.fields import bumps, colourful

SET = "pbr_Bricks102"
NOTE_TIME = """Every image is made once and dropped. *CPU s* on one thread, *wall s* on all cores.
*ns*: CPU nanoseconds a texel of an image. *parallax*, *shadows*: share of texels whose radiance
changes by more than a hundredth when that is left out."""
NOTE_STEPS = """Lines of sight and shadow rays of all texels by ring, against steps of 1/64 texel in
double precision. *wrong*: share of texels seen more than 0.1 texel off (of shadows: that differ).
*exact* walks from cell to cell and solves a quadratic in each; *step* is a march with fixed steps
and 8 bisections, or, for shadows, with as many comparisons."""
NOTE_MITSUBA = """Mitsuba 3, `scalar_rgb`, on the same heights as a mesh of 2 *fine*² triangles a
texel; views at 5, 45 and 75, lights at 20, 50 and twice 75 degrees. *distance*: mean, in texels,
between seen points; *shadows*: share of texels that agree, worst and mean over the pairs; *mean
radiance*: ratio that is furthest from 1; *bounce*, *all light*: the same of bounced light and of
the sum, two views and lights."""


@dataclass(frozen=True)
class Time:
    """One layout with one set of knobs."""

    layout: str
    size: int
    images: int
    knobs: str
    CPU_s: float
    wall_s: float
    ns: float


@dataclass(frozen=True)
class Steps:
    """One way of tracing at one polar angle."""

    what: str
    theta: int
    way: str
    ns: float
    wrong: float


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to few directions and no real set."""
    pbr, name = _set(32 if quick else 128)
    warm = from_angles(np.radians([10.0, 60.0]), np.radians([20.0, 200.0]))
    for bounce in (False, True):
        baked(pbr, warm, warm, bounce=bounce).stack.read(np.arange(4))
    parts = [f"## Baking\n\n{machine()} The set is {name}."]
    parts += [_table(Time, times(pbr, quick=quick)), NOTE_TIME, shares(pbr)]
    parts += [_table(Steps, steps(relief(pbr), quick=quick)), NOTE_STEPS]
    parts += [mitsuba(quick=quick)]
    publish("bake", "\n\n".join(parts), write=write)


def times(pbr: PbrSet, *, quick: bool) -> list[Time]:
    """Bake whole layouts."""
    cases: list[tuple[str, int, dict[str, bool]]] = [
        ("12x8x12x8", 128, {}),
        ("12x8x12x8", 128, {"shadows": False}),
        ("12x8x12x8", 128, {"parallax": False}),
        ("12x8x12x8", 128, {"bounce": True}),
        ("12x5x12x5", 128, {}),
        ("ubo81", 64, {}),
        ("ubo151", 64, {}),
    ]
    if quick:
        cases = [("4x2x4x2", 32, {}), ("4x2x4x2", 32, {"bounce": True})]
    rows = []
    for name, size, knobs in cases:
        views, lights = layout(name).views, layout(name).lights
        small = resized(pbr, size)
        spent = []
        for threads in (1, None):
            stack = baked(small, views, lights, threads=threads, **knobs).stack
            cpu, wall = time.process_time(), time.perf_counter()
            for numbers in blocks(stack):
                stack.read(numbers)
            spent.append((time.process_time() - cpu, time.perf_counter() - wall))
        text = ", ".join(f"{key} {'on' if value else 'off'}" for key, value in knobs.items())
        count = int(np.prod(stack.shape))
        rows.append(
            Time(
                layout=name,
                size=size,
                images=stack.shape[0],
                knobs=text or "as they are",
                CPU_s=spent[0][0],
                wall_s=spent[1][1],
                ns=spent[0][0] / count * 1e9,
            )
        )
    return rows


def shares(pbr: PbrSet) -> str:
    """Tell how much of a sample parallax and shadows change."""
    directions = layout("4x3x4x3")
    full = baked(pbr, directions.views, directions.lights).stack.read(np.arange(144))
    found = []
    for knob in ("parallax", "shadows"):
        without = baked(pbr, directions.views, directions.lights, **{knob: False})
        other = without.stack.read(np.arange(144))
        found.append(f"{knob} {(np.abs(full - other) > 0.01).mean():.0%}")
    return "Texels that change when something is left out: " + ", ".join(found) + "."


def steps(made: Relief, *, quick: bool) -> list[Steps]:
    """Compare tracing cell by cell with fixed steps."""
    rows = []
    for theta in (45,) if quick else (30, 60, 75, 85):
        view = from_angles(np.radians(theta), np.radians(33.0))
        truth_x, truth_y = reference.marched(made, view, 1 / 64)
        count = len(truth_x)
        run = reference.run_of(view)
        size = made.height.shape
        x, y = np.empty(count), np.empty(count)
        ways: list[tuple[str, Callable[[], None]]] = [
            (
                "exact",
                lambda run=run, x=x, y=y: trace(
                    made.height, made.ceiling, 0, made.shape[1], run, made.level, x, y
                ),
            )
        ]
        for step in (2.0, 1.0, 0.5, 0.25):
            ways.append(
                (
                    f"step {step:g}",
                    lambda step=step, run=run, x=x, y=y: _march(
                        made.height, made.shape[1], run, made.level, step, x, y
                    ),
                )
            )
        for name, way in ways:
            ns = _clocked(way, count)
            off_x = (x - truth_x + size[1] / 2) % size[1] - size[1] / 2
            off_y = (y - truth_y + size[0] / 2) % size[0] - size[0] / 2
            rows.append(
                Steps("sight", theta, name, ns, float((np.hypot(off_x, off_y) > 0.1).mean()))
            )
        rows += _shadow_steps(made, theta)
    return rows


def _shadow_steps(made: Relief, theta: int) -> list[Steps]:
    light = from_angles(np.radians(theta), np.radians(200.0))
    row, column = np.divmod(np.arange(made.shape[0] * made.shape[1]), made.shape[1])
    x, y = column + 0.3, row + 0.4
    flat = np.hypot(light[0], light[1])
    tangent = max(light[2], 0.05) / flat
    along = light[:2] * [1, -1] / flat
    truth = reference.horizon(made, x, y, light, 1 / 64) >= tangent
    out = np.empty((1, len(x)), np.float32)
    reach = np.array([[tangent * (1 - 1e-6), tangent]])

    def exact() -> None:
        horizons(made.height, made.ceiling, made.level[1], x, y, along[None], reach, out)

    rows = [Steps("shadow", theta, "exact", _clocked(exact, len(x)), 0.0)]
    rows[0] = Steps(
        "shadow", theta, "exact", rows[0].ns, float(((out[0] >= tangent) != truth).mean())
    )
    hidden = np.empty(len(x), np.bool_)
    for step in (2.0, 1.0, 0.5, 0.25):

        def marched(step: float = step) -> None:
            _hide(made.height, made.level[1], x, y, along, tangent, step, hidden)

        ns = _clocked(marched, len(x))
        rows.append(Steps("shadow", theta, f"step {step:g}", ns, float((hidden != truth).mean())))
    return rows


def mitsuba(*, quick: bool) -> str:
    """Agreement with Mitsuba, or that it is not there."""
    if importlib.util.find_spec("mitsuba") is None:
        return "Mitsuba is not installed; `pip install patina-btf[reference]` brings it."
    from tests.btf.bake.agreement import agreement, bounce_agreement
    from tests.btf.bake.fields import blocks as walls

    reliefs = {
        "bumps": (bumps(), 6.0),
        "fine": (bumps(width=2.0, seed=3), 4.0),
        "walls": (walls(), 3.0),
    }
    columns = (
        "relief",
        "fine",
        "distance",
        "worst shadows",
        "shadows",
        "mean radiance",
        "bounce",
        "all light",
    )
    rows = []
    for name, (height, depth) in reliefs.items():
        light = bounce_agreement(height, depth, albedo=0.8, samples=4 if quick else 64)
        bounced, both = (_furthest([pair[k] for pair in light]) for k in (0, 1))
        for fine in (2,) if quick else (1, 2, 4):
            found = agreement(height, depth, fine=fine)
            shadows = [each.shadows for each in found]
            rows.append(
                (
                    name,
                    fine,
                    float(np.mean([each.distance for each in found])),
                    f"{min(shadows):.4f}",
                    f"{np.mean(shadows):.4f}",
                    f"{_furthest([each.mean for each in found]):.4f}",
                    f"{bounced:.3f}",
                    f"{both:.3f}",
                )
            )
    return markdown(columns, rows) + "\n\n" + NOTE_MITSUBA


def _furthest(ratios: list[float]) -> float:
    return max(ratios, key=lambda ratio: abs(ratio - 1))


def _set(size: int) -> tuple[PbrSet, str]:
    for folder in FOLDERS:
        for path in sorted(folder.rglob(SET)):
            if size > 32:
                return resized(read_pbr(path, size=512, progress=silent), size), f"{SET} at {size}²"
    return colourful(size, size), f"one made by formula, {size}²"


def _table(kind: type, rows: list) -> str:
    columns = [field.name.replace("_", " ") for field in fields(kind)]
    return markdown(columns, [astuple(row) for row in rows])


def _clocked(work: Callable[[], None], count: int) -> float:
    """CPU nanoseconds of `work` a texel, the best of three after a warm run."""
    work()
    spent = []
    for _ in range(3):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return min(spent) / count * 1e9


@njit(cache=True, nogil=True, error_model="numpy")
def _march(height, width, run, level, step, x, y):
    plane, top, bottom = level
    long = np.sqrt(run[0] ** 2 + run[1] ** 2)
    drop = min(step / max(long, 1e-9), max(top - bottom, 1e-9))
    rows, columns = height.shape
    for k in range(len(x)):
        column, row = k % width, k // width
        high = low = top
        while low > bottom:
            high, low = low, max(low - drop, bottom)
            a, b = (
                (column + run[0] * (low - plane)) % columns,
                (row + run[1] * (low - plane)) % rows,
            )
            if low <= surface(height, a, b):
                break
        for _ in range(8):
            middle = (high + low) / 2
            a, b = (
                (column + run[0] * (middle - plane)) % columns,
                (row + run[1] * (middle - plane)) % rows,
            )
            if middle <= surface(height, a, b):
                low = middle
            else:
                high = middle
        x[k], y[k] = column + run[0] * (high - plane), row + run[1] * (high - plane)


@njit(cache=True, nogil=True, error_model="numpy")
def _hide(height, top, x, y, along, tangent, step, hidden):
    rows, columns = height.shape
    for k in range(len(x)):
        z = surface(height, x[k] % columns, y[k] % rows)
        s = step
        hidden[k] = False
        while z + tangent * s < top:
            there = surface(height, (x[k] + along[0] * s) % columns, (y[k] + along[1] * s) % rows)
            if there >= z + tangent * s:
                hidden[k] = True
                break
            s += step
