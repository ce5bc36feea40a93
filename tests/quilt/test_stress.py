"""Numbers at their ends: ties, perfect matches, slivers, tiny and huge samples, f4 against f8."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from btfcore.quilt.fitting import fit
from btfcore.quilt.grid import sample_grid
from btfcore.quilt.matching import Matcher
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.metric import distance
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.sheet import single
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import DenseMesh, Sample
from tests.surfaces import (
    blobs,
    constant_field,
    dense_mesh,
    grid_faces,
    plane,
    random_field,
    sphere,
)

ROOT = Path(__file__).resolve().parents[2]


def sample_of(channels, name="made"):
    channels = np.ascontiguousarray(channels, np.float32)
    colour = channels[..., :3] if channels.shape[2] >= 3 else np.repeat(channels[..., :1], 3, 2)
    return Sample(name, np.clip(colour, 0, 1), channels)


def constant(height=48, width=48, channels=3, value=0.25):
    return sample_of(np.full((height, width, channels), value))


def periodic(period=16, height=96, width=96):
    """Smooth and the same again every `period` texels, both ways."""
    row, column = np.meshgrid(*(2 * np.pi * np.arange(n) / period for n in (height, width)),
                              indexing="ij")  # fmt: skip
    waves = [np.sin(row), np.cos(column), np.sin(row + column), np.cos(2 * row - column)]
    return sample_of(np.stack(waves, axis=-1) * 0.2 + 0.5)


def covered(engine):
    """Run, and check what holds of every quilt; returns it."""
    quilt = engine.run()
    state, grid = engine.state, engine.grid
    assert (quilt.patch >= 0).all() and engine.statistics.covered == 1.0
    for values in (quilt.source, quilt.angle, state.ghost, state.source):
        assert np.isfinite(values).all()
    height, width = grid.cut.shape[:2]
    assert (state.source >= -1e-3).all()
    assert (state.source <= np.array([width - 1, height - 1]) + 1e-3).all()
    seams = measure_seams(engine.net, state, grid)
    assert np.isfinite([seams.per_edge, seams.per_vertex]).all()
    assert all(np.isfinite(entry.seam) and entry.seam >= 0 for entry in engine.ledger.values())
    # a seam may take a patch away again, but what patches gained adds up to the whole
    assert sum(entry.gained for entry in engine.ledger.values()) == len(quilt.patch)
    return quilt


def engine_on(dense, sample, field=None, **knobs):
    field = constant_field(dense) if field is None else field
    return Synthesizer(dense, field, sample, QuiltParameters(**knobs))


# --- matching


def test_a_perfect_match_is_found_where_it_is_and_costs_nothing():
    """The sums of the transforms cancel to about ±1e-6 of their size: never below 0."""
    grid = sample_grid(blobs(80, 70, seed=3))
    half = 12
    for row, column in ((30, 40), (45, 25), (40, 35)):
        window = grid.match[row - half : row + half + 1, column - half : column + half + 1]
        image = np.ascontiguousarray(np.moveaxis(window, -1, 0))
        mask = np.ones(image.shape[1:], np.float32)
        costs, count = Matcher(grid).costs(image, mask)
        assert (costs >= 0).all() and np.isfinite(costs).all()
        (best, *_) = Matcher(grid).match(image, mask, most=1, overlap=0.8, margin=4)
        assert (round(best.row), round(best.column)) == (row, column)
        power = (image.astype(np.float64) ** 2).sum() / count.max()
        assert 0 <= best.cost < 1e-4 * power


def test_all_ties_are_broken_the_same_way_and_end():
    grid = sample_grid(constant())
    image = np.zeros((grid.match.shape[2], 17, 17), np.float32)
    found = [
        Matcher(grid).match(image, np.ones((17, 17), np.float32), most=4, overlap=0.8, margin=8)
        for _ in range(2)
    ]
    assert found[0] == found[1] and len(found[0]) >= 1
    assert all(placement.cost == 0 for placement in found[0])


def test_matching_in_f4_agrees_with_sums_in_f8():
    grid = sample_grid(blobs(40, 50, seed=5))
    random = np.random.default_rng(0)
    image = random.standard_normal((grid.match.shape[2], 21, 21)).astype(np.float32) * 0.1
    mask = (random.random((21, 21)) < 0.6).astype(np.float32)
    costs, count = Matcher(grid).costs(image, mask)
    match, half = grid.match.astype(np.float64), 10
    for row, column in random.integers(0, [40, 50], (40, 2)):
        total = seen = 0.0
        for dy in range(-half, half + 1):
            for dx in range(-half, half + 1):
                r, c = row + dy, column + dx
                if mask[dy + half, dx + half] and 0 <= r < 40 and 0 <= c < 50:
                    gap = match[r, c] - image[:, dy + half, dx + half].astype(np.float64)
                    total += gap @ gap
                    seen += 1
        assert count[row, column] == pytest.approx(seen, abs=1e-6)
        if seen >= 20:
            assert costs[row, column] == pytest.approx(total / seen, rel=1e-4, abs=1e-7)


# --- cutting


def apart(grid, ax, ay, bx, by):
    """Distance of two positions in the channels of one sample."""
    one = single(grid)
    return distance(one.cut, one.colour, one.frames, 0, ax, ay, 0, bx, by)


def test_distances_in_f4_agree_with_f8():
    random = np.random.default_rng(1)
    for scale in (1e-3, 1.0, 1e3):
        grid = (random.standard_normal((30, 20, 40)) * scale).astype(np.float32)
        wide = grid.astype(np.float64)
        for ax, ay, bx, by in random.random((200, 4)) * 19:
            assert apart(grid, ax, ay, bx, by) == pytest.approx(
                apart(wide, ax, ay, bx, by), rel=1e-5
            )


def cut_of(engine, kind):
    """Flow of one cut on a half-covered quilt with the grid's channels in f4 or f8."""
    flattener, state, net = engine._flattener, engine.state, engine.net
    seed = int(np.flatnonzero(state.patch < 0)[0])
    patch = flattener.flatten(seed, 16)
    middle = (np.array(engine.grid.cut.shape[1::-1]) - 1) / 2
    place = (middle + patch.plane * [1, -1] / engine.grid.unit).astype(np.float32)
    cut = fit(
        net.indptr, net.indices, patch.order, patch.inner, flattener.local, place, state.patch,
        state.source, state.ghost, np.ascontiguousarray(engine.grid.cut, kind), 20,
    )  # fmt: skip
    flattener.release(patch)
    return cut


def test_a_cut_in_f4_costs_what_it_costs_in_f8():
    engine = engine_on(plane(60, 60, one_chart=False), blobs(64, 64))
    for _ in range(3):
        engine._patch_at(engine._frontier.pick())
    assert 0 < (engine.state.patch < 0).mean() < 1
    single, double = cut_of(engine, np.float32), cut_of(engine, np.float64)
    assert single.gained == double.gained > 0
    assert single.flow == pytest.approx(double.flow, rel=1e-5) and double.flow > 0


def test_seam_measures_in_f4_agree_with_f8():
    engine = engine_on(sphere(5), blobs(64, 64))
    engine.run()
    seams = measure_seams(engine.net, engine.state, engine.grid)
    net, state = engine.net, engine.state
    wide = engine.grid.cut.astype(np.float64)
    tail = np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr))
    costs = []
    for slot in np.flatnonzero(state.patch[tail] != state.patch[net.indices]):
        (ax, ay), (bx, by) = state.ghost[slot], state.source[net.indices[slot]]
        costs.append(apart(wide, float(ax), float(ay), float(bx), float(by)))
    mean = np.mean(costs) / engine.grid.texel_difference
    assert seams.per_edge == pytest.approx(mean, rel=1e-5)


# --- whole quilts


def test_a_constant_sample_has_seams_that_cost_nothing():
    engine = engine_on(sphere(5), constant())
    covered(engine)
    seams = measure_seams(engine.net, engine.state, engine.grid)
    assert seams.per_edge == seams.per_vertex == 0.0 and seams.seam_edges > 0


def test_a_periodic_sample_continues_without_a_seam():
    """On a plane the overlap can match exactly: what the seams cost is what rounding leaves."""
    engine = engine_on(plane(110, 110), periodic(), work_patch=24)
    covered(engine)
    seams = measure_seams(engine.net, engine.state, engine.grid)
    assert engine.statistics.patches > 5
    assert seams.per_vertex < 0.004  # of the difference of random texels


@pytest.mark.parametrize(
    "sample",
    [
        blobs(40, 200), blobs(200, 40), blobs(8, 8), blobs(4, 6), blobs(24, 24), constant(8, 64),
        periodic(8, 20, 60), constant(channels=1), sample_of(blobs(48, 48).channels * 1e4),
        sample_of(blobs(48, 48).channels * 1e-4),
    ],
    ids=[
        "40x200", "200x40", "8x8", "4x6", "smaller than the patch", "constant", "periodic",
        "one channel", "bright", "dark",
    ],
)  # fmt: skip
@pytest.mark.parametrize("work_patch", [None, 32])
def test_samples_of_any_size_and_range_cover(sample, work_patch):
    covered(engine_on(sphere(4), sample, work_patch=work_patch))


@pytest.mark.parametrize("scale", [0.1, 0.25, 1.0, 3.7, 10.0])
def test_any_scale_covers(scale):
    dense = plane(70, 70, one_chart=False)
    engine = engine_on(dense, blobs(64, 64), scale=scale)
    quilt = covered(engine)
    inside = np.flatnonzero((quilt.patch[:-1] == quilt.patch[1:]) & (np.arange(4899) % 70 < 69))
    length = np.linalg.norm(quilt.source[inside + 1] - quilt.source[inside], axis=1)
    assert np.median(length) * scale * dense.step == pytest.approx(1, abs=0.03)


def test_a_large_sample_covers():
    """Of 1024 x 1024 texels: matched on block means, refined at full size."""
    engine = engine_on(plane(150, 150, one_chart=False), blobs(1024, 1024), work_patch=32)
    assert engine._finder._matcher.factor > 1
    covered(engine)
    assert measure_seams(engine.net, engine.state, engine.grid).per_vertex < 0.05


def slivers(rows=50, columns=60):
    """A plane whose rows lie by turns 1 and 0.001 apart."""
    dense = plane(rows, columns, one_chart=False)
    vertices = dense.vertices.copy()
    height = np.cumsum(np.where(np.arange(rows) % 2 == 0, 1.0, 0.001))
    vertices[:, 1] = -np.repeat(height, columns)
    return dense_mesh(vertices, dense.faces)


def doubled(rows=40, columns=40):
    """A plane in which every third row lies exactly on the one before: edges of length 0."""
    row = np.arange(rows) - (np.arange(rows) + 1) // 3
    column, up = np.meshgrid(np.arange(columns), -row)
    vertices = np.stack([column, up, 0 * up], axis=-1).reshape(-1, 3)
    flat = dense_mesh(vertices, grid_faces(rows, columns))
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(vertices), 1))
    return DenseMesh(
        flat.vertices, normals, flat.faces, flat.texel, flat.chart, flat.face, flat.bary,
        flat.size, flat.grid_faces,
    )  # fmt: skip


def crumpled():
    """Random heights as large as the edges are long: almost every patch is torn or stretched."""
    dense = plane(40, 40, one_chart=False)
    vertices = dense.vertices.copy()
    vertices[:, 2] = np.random.default_rng(2).normal(0, 1.0, len(vertices))
    return dense_mesh(vertices, dense.faces)


def collapsed():
    """A mesh all of whose vertices lie in one point."""
    dense = plane(6, 6, one_chart=False)
    return dense_mesh(np.zeros_like(dense.vertices), dense.faces)


def needle():
    """A fan of 600 triangles around one vertex."""
    angle = 2 * np.pi * np.arange(600) / 600
    rim = 30 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    ring = np.arange(600)
    faces = np.stack([np.zeros(600, int), 1 + ring, 1 + (ring + 1) % 600], axis=1)
    return dense_mesh(np.concatenate([[(0, 0, 5)], rim]), faces)


def crumbs(count=300):
    """Tetrahedra, single triangles and single vertices, none touching another."""
    corner = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], np.float64)
    solid = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    vertices, faces = [], []
    for number in range(count):
        vertices.append(corner + 3.0 * number)
        faces.append((solid if number % 3 else solid[:1]) + 4 * number)
    return dense_mesh(np.concatenate(vertices), np.concatenate(faces))


@pytest.mark.parametrize(
    "make", [slivers, doubled, crumpled, collapsed, needle, crumbs],
    ids=lambda make: make.__name__,
)  # fmt: skip
@pytest.mark.parametrize("knobs", [{}, {"max_seam": 0.2}, {"literal": True}], ids=str)
def test_surfaces_that_no_patch_likes_are_covered(make, knobs):
    if knobs.get("literal") and make in (crumbs, crumpled):
        knobs = knobs | {"work_patch": 6}  # LSCM at every size takes its time
    dense = make()
    covered(engine_on(dense, blobs(48, 48), **knobs))


def test_a_wild_field_on_a_crumpled_surface_is_covered():
    dense = crumpled()
    covered(engine_on(dense, blobs(48, 48), random_field(dense)))


CHILD = """
import hashlib
from tests.quilt.test_stress import crumpled, engine_on, periodic, sphere
from tests.surfaces import blobs
digest = hashlib.sha256()
for dense, sample in ((sphere(5), blobs(96, 96)), (crumpled(), periodic())):
    quilt = engine_on(dense, sample, swing=(-5.0, 0.0, 5.0)).run()
    for name in ("source", "angle", "sample", "patch"):
        digest.update(getattr(quilt, name).tobytes())
print(digest.hexdigest())
"""


def test_any_number_of_threads_gives_the_same_bits():
    seen = set()
    for threads in ("1", "2"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        done = subprocess.run(
            [sys.executable, "-c", CHILD], cwd=ROOT, capture_output=True, text=True, timeout=240,
            env={**os.environ, **dict.fromkeys(names, threads)},
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        seen.add(done.stdout)
    assert len(seen) == 1 and len(seen.pop().strip()) == hashlib.sha256().digest_size * 2
