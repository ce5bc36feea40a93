"""Closed stays closed, holes stay holes, one vertex per texel: over shapes, rates, atlases."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.dense.build import build_dense_mesh
from btfcore.dense.diagnostics import dense_diagnostics
from btfcore.errors import Cancelled, InvalidParameter
from btfcore.mesh.distance import distance_to_mesh
from btfcore.types import Atlas
from tests.dense import shapes
from tests.dense.laws import assert_lawful, assert_samples, topology

SHAPES = {
    "sphere": shapes.icosphere,
    "torus": shapes.torus,
    "cube": shapes.cube,
    "open cylinder": shapes.cylinder,
    "closed cylinder": lambda: shapes.cylinder(closed=True),
    "genus 2": shapes.genus_two,
    "plane with holes": shapes.plane_with_holes,
    "triangle": shapes.triangle,
    "tetrahedron": shapes.tetrahedron,
    "two components": lambda: shapes.joined(shapes.torus(), shapes.cube()),
    "big and small": lambda: shapes.joined(shapes.icosphere(), shapes.tetrahedron(0.05)),
}
ODD_ATLASES = {
    "chart zipped to itself": shapes.unrolled_cylinder,
    "cone with a closed slit": shapes.slit_cone,
    "cone with an open slit": lambda rate: shapes.slit_cone(rate, gap=1.5),
    "cone with a slit below a texel": lambda rate: shapes.slit_cone(rate, gap=0.02),
    "one chart with holes": lambda rate: shapes.one_view(shapes.plane_with_holes(), rate),
    "two disks without a node": shapes.two_disks,
    "foldovers": lambda rate: shapes.folded(shapes.box_atlas(shapes.icosphere(), rate), share=0.03),
}


@pytest.mark.parametrize("rate", [32, 64, 100, 256])
@pytest.mark.parametrize("name", SHAPES)
def test_topology_is_kept_at_every_rate(name, rate):
    shape = SHAPES[name]()
    assert_lawful(build_dense_mesh(shapes.box_atlas(shape, rate)), shape)


@pytest.mark.parametrize("rate", [32, 64, 150])
@pytest.mark.parametrize("name", ODD_ATLASES)
def test_odd_charts_are_zipped_too(name, rate):
    atlas = ODD_ATLASES[name](rate)
    assert_lawful(build_dense_mesh(atlas), atlas.mesh)


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_close_to_the_surface_at_512(name):
    shape = shapes.icosphere(4) if name == "sphere" else shapes.torus(96, 48)
    dense = build_dense_mesh(shapes.box_atlas(shape, 512))
    assert_lawful(dense, shape)
    far = distance_to_mesh(dense.vertices[dense.faces].mean(1), shape) / shape.diagonal
    assert far.mean() <= 5e-5
    assert far.max() <= 4e-3


def test_lawful_at_1024():
    shape = shapes.deformed(shapes.torus(60, 30), seed=3, bumps=0.1)
    dense = build_dense_mesh(shapes.box_atlas(shape, 1024))
    found = dense_diagnostics(dense, shape)
    assert found.statistics.euler == 0 and found.statistics.boundary_edges == 0
    assert (found.bad_vertices, found.unused, found.absent, found.altered) == (0, 0, 0, 0)
    assert_samples(dense, shape)


@settings(max_examples=30)
@given(
    st.sampled_from(["sphere", "torus", "cube", "open cylinder", "genus 2", "plane with holes"]),
    st.sampled_from([32, 48, 96]),
    st.integers(0, 10_000),
    st.floats(0, 0.25),
    st.tuples(*[st.floats(0.15, 1)] * 3),
    st.floats(-6, 6),
)
def test_deformed_shapes(name, rate, seed, bumps, scale, twist):
    shape = shapes.deformed(SHAPES[name](), seed, bumps, scale, twist)
    assert_lawful(build_dense_mesh(shapes.box_atlas(shape, rate)), shape)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.floats(0.005, 0.1), st.sampled_from([40, 90]))
def test_foldovers(seed, share, rate):
    atlas = shapes.folded(shapes.box_atlas(shapes.torus(), rate), seed, share)
    assert_lawful(build_dense_mesh(atlas), atlas.mesh)


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.integers(1, 60), st.sampled_from([100, 128]))
def test_shattered_charts(seed, cuts, rate):
    """Random charts down to single faces, many below a texel."""
    shape = shapes.icosphere(2)
    label = np.random.default_rng(seed).integers(0, 1 + cuts, len(shape.faces))
    atlas = shapes.box_atlas(shape, 512)
    chart = shapes.connected(shape.faces, 1000 * label + atlas.chart)
    atlas = shapes.packed(shape, atlas.uv, chart, rate)
    assert_lawful(build_dense_mesh(atlas), shape)


def test_same_bytes_twice():
    atlas = shapes.box_atlas(shapes.deformed(shapes.genus_two(), 5, 0.2), 90)
    one, other = build_dense_mesh(atlas), build_dense_mesh(atlas)
    for name in ("vertices", "normals", "faces", "texel", "chart", "face", "bary"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


def test_vertices_do_not_depend_on_where_the_mesh_lies():
    shape = shapes.torus()
    atlas = shapes.box_atlas(shape, 64)
    moved = shapes.mesh(shape.vertices * 4 + [64, -32, 128], shape.faces)
    one = build_dense_mesh(atlas)
    other = build_dense_mesh(Atlas(moved, atlas.uv, atlas.chart, atlas.size))
    assert np.array_equal(one.texel, other.texel)
    assert np.allclose(one.vertices * 4 + [64, -32, 128], other.vertices)


def test_winding_is_the_inputs():
    shape = shapes.icosphere()
    dense = build_dense_mesh(shapes.box_atlas(shape, 100))
    corner = dense.vertices[dense.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    outward = (normal * corner.mean(1)).sum(1)
    assert (outward > 0).mean() > 0.999
    assert outward.min() > -0.05 * outward.max()
    assert ((dense.normals * dense.vertices).sum(1) > 0.9).all()


def test_too_low_a_rate_is_told():
    parts = shapes.joined(*[shapes.torus(6, 5)] * 45)  # a torus needs 7 vertices
    chart = np.arange(len(parts.faces), dtype=np.int32) // 60
    crowded = Atlas(parts, np.zeros((len(parts.faces), 3, 2)), chart, 16)
    dense = build_dense_mesh(crowded)
    assert_samples(dense, parts)
    assert topology(dense.faces)[1]
    found = dense_diagnostics(dense, parts)
    assert found.absent + found.altered > 0 and found.notes


def test_nothing_fits():
    shape = shapes.tetrahedron()
    atlas = Atlas(shape, np.zeros((4, 3, 2)), np.zeros(4, np.int32), 1)
    with pytest.raises(InvalidParameter, match="1 x 1"):
        build_dense_mesh(atlas)
    atlas = Atlas(shapes.triangle(), np.zeros((1, 3, 2)), np.zeros(1, np.int32), 1)
    with pytest.raises(InvalidParameter, match="no triangle"):
        build_dense_mesh(atlas)


def test_progress_rises_and_cancels():
    atlas = shapes.box_atlas(shapes.torus(), 48)
    seen = []
    build_dense_mesh(atlas, progress=lambda fraction, label: seen.append(fraction))
    assert seen == sorted(seen) and seen[-1] == 1.0

    def stop(fraction, label):
        if fraction > 0.3:
            raise Cancelled

    with pytest.raises(Cancelled):
        build_dense_mesh(atlas, progress=stop)
