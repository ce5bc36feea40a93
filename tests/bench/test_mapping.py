"""The baseline of Zhou's figure 2 maps every triangle and cuts optimally; seams are measured."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.quilt.grid import sample_grid
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.types import Mesh, Sample
from tests.bench.mapping import (
    METHODS,
    Case,
    Result,
    case_of,
    dense_seams,
    figures,
    run,
    triangle_seams,
)
from tests.bench.pattern import PatternMapper, jumps
from tests.surfaces import blobs, constant_field, plane, sphere


def mapper_of(dense, *, texel=1.0, sample=None, seed=0):
    mesh = Mesh(dense.vertices, dense.faces)
    grid = sample_grid(blobs() if sample is None else sample)
    tangents = constant_field(dense).tangents.astype(np.float64)
    return PatternMapper(mesh, tangents, grid, QuiltParameters(seed=seed), texel)


@pytest.fixture(scope="module")
def ball():
    """A sphere of 1,280 triangles with edges of some 9 texels, mapped."""
    mapper = mapper_of(sphere(3, radius=60.0))
    return mapper, mapper.run()


def test_every_triangle_is_mapped_into_the_sample(ball):
    mapper, mapping = ball
    assert (mapping.patch >= 0).all() and len(np.unique(mapping.patch)) > 5
    height, width = mapper.grid.cut.shape[:2]
    assert (mapping.source >= 0).all()
    assert (mapping.source <= [width - 1, height - 1]).all()


def test_pieces_are_whole_and_keep_their_size(ball):
    mapper, mapping = ball
    half = np.flatnonzero(
        mapping.patch[mapper.twin // 3] == mapping.patch[np.arange(len(mapper.twin)) // 3]
    )
    ours = mapper._ends(mapping.source, half)
    theirs = mapper._ends(mapping.source, mapper.twin[half])[:, ::-1]
    assert np.abs(ours - theirs).max() < 1e-3
    one, two = (mapping.source[:, k] - mapping.source[:, 0] for k in (1, 2))
    area = -(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2  # rows go down
    assert (area > 0).mean() > 0.99
    assert area.sum() == pytest.approx(mapper.area.sum(), rel=0.02)


def test_the_same_seed_gives_the_same_bits(ball):
    _, mapping = ball
    again = mapper_of(sphere(3, radius=60.0)).run()
    other = mapper_of(sphere(3, radius=60.0), seed=1).run()
    assert np.array_equal(mapping.source, again.source)
    assert not np.array_equal(mapping.source, other.source)


def test_triangles_larger_than_the_sample_are_mapped_all_the_same():
    mapper = mapper_of(sphere(0, radius=500.0))
    mapping = mapper.run()
    assert (mapping.patch >= 0).all() and np.isfinite(mapping.source).all()


def energy(mapper, source, patch):
    """∫ ‖A − B‖ over all edges between different pieces that are not bare."""
    half = np.flatnonzero((mapper.twin >= 0) & (np.arange(len(mapper.twin)) < mapper.twin))
    one, two = half // 3, mapper.twin[half] // 3
    half = half[(patch[one] != patch[two]) & (patch[one] >= 0) & (patch[two] >= 0)]
    ours = mapper._ends(source, half)
    theirs = mapper._ends(source, mapper.twin[half])[:, ::-1]
    return jumps(mapper.grid, ours, theirs, mapper.length[half]).sum()


@pytest.mark.parametrize("seed", range(6))
def test_the_cut_is_the_cheapest_of_all(seed):
    dense = plane(5, 5)
    mapper = mapper_of(dense, texel=0.25)  # edges of four texels
    rng = np.random.default_rng(seed)
    points = dense.vertices[:, :2][dense.faces] * [4, -4]
    for piece, faces in enumerate(np.array_split(np.arange(len(dense.faces)), 3)):
        mapper.source[faces] = points[faces] + rng.uniform(5, 40, 2)
        mapper.patch[faces] = piece
    bare = rng.choice(len(dense.faces), 4, replace=False)
    mapper.patch[bare] = -1
    faces = np.unique(np.r_[bare, rng.choice(len(dense.faces), 9, replace=False)])
    place = (points[faces] + rng.uniform(5, 40, 2)).astype(np.float32)
    fresh, flow = mapper._cut(faces, place)
    assert fresh[np.isin(faces, bare)].all()
    old = np.flatnonzero(~np.isin(faces, bare))
    costs = {}
    for choice in product((False, True), repeat=len(old)):
        taken = np.isin(faces, bare)
        taken[old] = choice
        source, patch = mapper.source.copy(), mapper.patch.copy()
        source[faces[taken]], patch[faces[taken]] = place[taken], 99
        costs[choice] = energy(mapper, source, patch)
    ours = costs[tuple(fresh[old].tolist())]
    assert ours == pytest.approx(min(costs.values()), rel=1e-6)
    # the flow leaves out only the edges that no choice changes
    kept = energy(mapper, mapper.source, mapper.patch)
    assert flow <= ours + 1e-6 and ours - flow <= kept + 1e-6


def ramp(slope=0.01):
    """A sample whose only channel grows by `slope` a column."""
    channel = np.tile(np.arange(80, dtype=np.float32) * slope, (80, 1))[..., None]
    return Sample("ramp", np.repeat(channel, 3, axis=2), channel)


def test_seams_of_a_known_step_are_measured_alike_by_both():
    dense = plane(21, 31)
    right = dense.vertices[:, 0] > 12.5
    shift = np.where(right, 7.0, 0.0)  # columns, a step of .07
    place = dense.vertices[:, :2] * [1, -1] + [20, 20]
    # on the dense mesh the seam runs half-way between columns 12 and 13
    net = connect(dense, constant_field(dense))
    grid = sample_grid(ramp())
    state = QuiltState.bare(net)
    state.patch[:] = right
    state.source[:] = place + np.stack([shift, 0 * shift], axis=1)
    owner = np.repeat(np.arange(len(right)), np.diff(net.indptr))
    state.ghost[:] = place[net.indices] + np.stack([shift[owner], 0 * shift[owner]], axis=1)
    length, cost = dense_seams(dense, net, state, grid)
    texel = 1 / dense.step  # a border's vertices own less than a square
    assert length == pytest.approx(20 * texel, rel=1e-6)
    assert cost == pytest.approx(length * 0.07, rel=1e-4)
    # on triangles it runs along column 13
    mapper = mapper_of(dense, sample=ramp())
    mapper.patch[:] = dense.vertices[dense.faces].mean(axis=1)[:, 0] > 13
    moved = np.stack([7.0 * mapper.patch, 0.0 * mapper.patch], axis=1)
    mapper.source[:] = place[dense.faces] + moved[:, None]
    from tests.bench.pattern import Mapping

    length, cost = triangle_seams(mapper, Mapping(mapper.source, mapper.patch))
    assert length == pytest.approx(20, rel=1e-6)
    assert cost == pytest.approx(20 * 0.07, rel=1e-4)


def test_steps_along_an_edge_are_integrated():
    grid = sample_grid(ramp())
    one = np.array([[[10, 10], [30, 10]], [[10, 10], [30, 10]]], np.float32)
    two = np.array([[[10, 30], [30, 30]], [[10, 10], [50, 10]]], np.float32)
    found = jumps(grid, one, two, np.array([20.0, 20.0]))
    assert found == pytest.approx([0.0, 20 * 0.01 * 10], abs=1e-4)


def test_a_further_method_is_compared_like_the_two():
    seen = []

    def textless(case: Case) -> Result:
        seen.append(case.parameters.seed)
        quilt = METHODS["quilting"](case).quilt
        return Result(quilt, 0, 0.0, float("nan"), float("nan"))

    rows = run((("sphere.obj", "brick_red.png", 64),), {**METHODS, "third": textless}, (0, 1))
    assert [row.method for row in rows] == ["pattern mapping", "quilting", "third"]
    assert seen == [0, 1]
    assert all(row.cost > 0 and row.step > 0 and row.length > 0 for row in rows[:2])
    assert np.isnan(rows[2].cost)


def test_results_are_drawn_on_the_dense_mesh():
    case = case_of("sphere.obj", "brick_red.png", 64)
    result = METHODS["pattern mapping"](case)
    assert len(result.quilt.patch) == len(case.prepared.dense.vertices)
    assert (result.quilt.patch >= 0).all()
    length, step, cost, angle = figures(case, result)
    assert 0 < angle < 20
    texels = cost * case.grid.random_difference / (length / 1000) / case.grid.texel_difference
    assert texels == pytest.approx(step)
    # inside a piece neighbours on the surface are neighbours in the sample
    dense, quilt = case.prepared.dense, result.quilt
    ends = dense.faces[:, :2]
    same = quilt.patch[ends[:, 0]] == quilt.patch[ends[:, 1]]
    apart = np.linalg.norm(quilt.source[ends[:, 0]] - quilt.source[ends[:, 1]], axis=1)[same]
    assert np.median(apart) == pytest.approx(1, abs=0.2)


def test_angles_are_those_of_the_quilting():
    dense = plane(9, 9)
    mapper = mapper_of(dense)
    turn = np.radians(25)
    place = dense.vertices[:, :2] @ [[np.cos(turn), -np.sin(turn)], [-np.sin(turn), -np.cos(turn)]]
    source = (place + 30)[dense.faces]  # there the field points up by 25 degrees
    image = source[..., 0] - 1j * source[..., 1]
    field = mapper.field_in(
        np.arange(len(source)), image[:, 1] - image[:, 0], image[:, 2] - image[:, 0]
    )
    assert np.allclose(np.degrees(np.angle(field)), 25)
