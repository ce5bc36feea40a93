"""Laws of a finished quilt."""

import numpy as np
import pytest

from btfcore.errors import Cancelled, InvalidParameter
from btfcore.quilt.frontier import Frontier
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer, synthesize
from btfcore.types import Sample
from tests.surfaces import blobs, constant_field, dense_mesh, plane, random_field, sphere


def singular_values(dense, quilt):
    """Stretch of surface triangle → sample position inside patches, times the step."""
    face = dense.faces
    inside = (quilt.patch[face] == quilt.patch[face[:, :1]]).all(axis=1)
    face = face[inside]
    corner = dense.vertices[face]
    one, two = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.linalg.norm(one, axis=1)
    along = one / length[:, None]
    normal = np.cross(one, two)
    across = np.cross(normal / np.linalg.norm(normal, axis=1)[:, None], along)
    basis = np.zeros((len(face), 2, 2))
    basis[:, 0, 0] = length
    basis[:, 0, 1], basis[:, 1, 1] = (two * along).sum(axis=1), (two * across).sum(axis=1)
    at = quilt.source[face].astype(np.float64)
    jacobian = np.stack([at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]], axis=2) @ np.linalg.inv(basis)
    return np.linalg.svd(jacobian, compute_uv=False) * dense.step, np.linalg.det(jacobian)


@pytest.mark.parametrize("literal", [False, True])
def test_a_sphere_is_covered_isometrically_along_its_field(literal):
    dense = sphere(5)
    quilt, statistics = synthesize(
        dense, constant_field(dense, (0, 0, 1.0)), blobs(), QuiltParameters(literal=literal)
    )
    assert (quilt.patch >= 0).all() and statistics.covered == 1.0
    assert np.isfinite(quilt.source).all()
    assert (quilt.source >= 0).all() and (quilt.source <= 63).all()
    stretch, determinant = singular_values(dense, quilt)
    assert (determinant > 0).mean() < 1e-3  # sample rows go down
    if not literal:  # LSCM keeps angles, not lengths
        assert np.median(stretch) == pytest.approx(1, abs=0.03)
        assert ((stretch > 1 / 1.3) & (stretch < 1.3)).mean() > 0.95
        assert np.median(np.abs(np.degrees(quilt.angle))) < 8


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_scale_sets_the_pattern_size(scale):
    dense = plane(70, 70)
    quilt, _ = synthesize(dense, constant_field(dense), blobs(64, 64), QuiltParameters(scale=scale))
    stretch, _ = singular_values(dense, quilt)
    assert np.median(stretch) * scale == pytest.approx(1, abs=0.03)
    assert (quilt.patch >= 0).all()
    assert (quilt.source >= -1).all() and (quilt.source <= 64).all()


def test_same_seed_same_bits_other_seed_other_quilt():
    dense = plane(60, 60, one_chart=False)
    field = constant_field(dense)
    one, _ = synthesize(dense, field, blobs(), QuiltParameters(seed=3))
    two, _ = synthesize(dense, field, blobs(), QuiltParameters(seed=3))
    other, _ = synthesize(dense, field, blobs(), QuiltParameters(seed=4))
    for name in ("source", "angle", "sample", "patch"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert one.source.tobytes() != other.source.tobytes()


def test_a_plane_can_continue_its_sample():
    """From a sample as large as the plane the whole is one piece: no seam where none is due."""
    dense = plane(40, 40)
    engine = Synthesizer(dense, constant_field(dense), blobs(128, 128), QuiltParameters())
    engine.run()
    seams = measure_seams(engine.net, engine.state, engine.grid)
    assert seams.per_vertex < 0.01


@pytest.mark.parametrize(
    "sample",
    [
        Sample(
            "flat", np.full((32, 32, 3), 0.5, np.float32), np.full((32, 32, 3), 0.5, np.float32)
        ),
        blobs(8, 8),
        blobs(3, 40),
        blobs(2, 2),
        blobs(20, 200),
    ],
    ids=["constant", "8x8", "3x40", "2x2", "20x200"],
)
def test_awkward_samples_cover_all_the_same(sample):
    dense = sphere(4)
    quilt, statistics = synthesize(dense, constant_field(dense), sample)
    assert (quilt.patch >= 0).all() and np.isfinite(quilt.source).all()
    assert statistics.patches < len(quilt.patch)


def test_a_wild_field_is_covered_all_the_same():
    dense = sphere(4)
    quilt, _ = synthesize(dense, random_field(dense), blobs())
    assert (quilt.patch >= 0).all() and np.isfinite(quilt.angle).all()


def test_a_bound_on_the_seam_shrinks_patches_and_ends():
    dense = sphere(4)
    free, loose = synthesize(dense, constant_field(dense), blobs())
    bound, tight = synthesize(dense, constant_field(dense), blobs(), QuiltParameters(max_seam=0.2))
    assert (bound.patch >= 0).all()
    assert tight.shrinks > loose.shrinks and tight.patches > loose.patches


def test_angle_is_measured_from_the_field_to_the_column_axis():
    dense = plane(50, 50)
    field = constant_field(dense, (np.cos(0.4), np.sin(0.4), 0))
    quilt, _ = synthesize(dense, field, blobs(), QuiltParameters(swing=(8.0,)))
    inside = np.flatnonzero((quilt.patch[:-1] == quilt.patch[1:]) & (np.arange(2499) % 50 < 49))
    step = quilt.source[inside + 1] - quilt.source[inside]  # image of +x
    column_axis = -np.arctan2(-step[:, 1], step[:, 0])  # direction of +column in the plane
    expected = column_axis - 0.4
    error = np.angle(np.exp(1j * (quilt.angle[inside] - expected)))
    assert np.abs(error).max() < 1e-2


def test_cancelling_leaves_a_valid_partial_quilt():
    dense = sphere(5)
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())

    def stop(fraction, label):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        engine.run(progress=stop)
    partial = engine.state.quilt(engine.grid)
    share = (partial.patch >= 0).mean()
    assert 0.3 < share < 1
    whole = engine.run()  # and it can be continued
    assert (whole.patch >= 0).all()
    kept = partial.patch >= 0
    assert (whole.patch[kept] >= 0).all()


def test_updates_do_not_change_the_result():
    dense = sphere(4)
    seen = []
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())
    shown = engine.run(on_update=seen.append)
    plain, _ = synthesize(dense, constant_field(dense), blobs())
    assert shown.source.tobytes() == plain.source.tobytes()


def test_frontier_picks_the_most_constrained():
    dense = plane(20, 20)
    from btfcore.patch.connectivity import connect

    net = connect(dense, constant_field(dense))
    patch = np.full(400, -1, np.int32)
    patch[np.random.default_rng(0).random(400) < 0.3] = 0
    frontier = Frontier(net.indptr, net.indices, patch, 7)
    for _ in range(100):
        vertex = frontier.pick()
        filled = np.array(
            [
                (patch[net.indices[net.indptr[v] : net.indptr[v + 1]]] >= 0).sum()
                if patch[v] < 0
                else -1
                for v in range(400)
            ]
        )
        assert filled[vertex] == filled.max()
        patch[vertex] = 1
        frontier.add(np.array([vertex], np.int32))


def test_seam_measures_against_a_twin():
    dense = sphere(4)
    engine = Synthesizer(dense, constant_field(dense), blobs(), QuiltParameters())
    engine.run()
    net, state, grid = engine.net, engine.state, engine.grid
    total, edges = 0.0, 0
    tails = np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr))
    from tests.quilt.test_fitting import value

    for slot, (i, j) in enumerate(zip(tails, net.indices, strict=True)):
        if state.patch[i] != state.patch[j]:
            total += np.linalg.norm(
                value(grid.cut, state.ghost[slot]) - value(grid.cut, state.source[j])
            )
            edges += 1
    seams = measure_seams(net, state, grid)
    assert seams.seam_edges == edges // 2
    assert seams.per_edge == pytest.approx(total / edges / grid.texel_difference, rel=1e-4)


@pytest.mark.parametrize(
    "knobs", [{"scale": 0}, {"scale": float("nan")}, {"work_patch": 2}, {"max_distortion": 0.5}]
)
def test_knobs_out_of_range_are_named(knobs):
    with pytest.raises(InvalidParameter, match=next(iter(knobs))):
        QuiltParameters(**knobs)


@pytest.mark.parametrize("loose", [0, 5])
def test_tiny_meshes_and_loose_vertices_are_covered(loose):
    vertices = np.concatenate([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.full((loose, 3), 9.0)])
    dense = dense_mesh(vertices, [(0, 1, 2)])
    quilt, _ = synthesize(dense, constant_field(dense), blobs())
    assert (quilt.patch >= 0).all() and np.isfinite(quilt.source).all()
