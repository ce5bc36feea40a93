"""Laws of the atlas as a whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.dense import atlas as module
from btfcore.dense.atlas import build_atlas, chart_mesh
from btfcore.dense.labels import connected
from btfcore.dense.pack import pack
from btfcore.errors import AtlasFailed, Cancelled, GuardedFailure
from btfcore.mesh.reader import read_mesh
from btfcore.mesh.topology import twins
from btfcore.types import Mesh
from tests.dense.atlas_laws import areas, check_atlas, covered_twice, surface
from tests.mesh.shapes import TETRAHEDRON, cube, grid, sphere, together, torus


def mesh_of(shape):
    vertices, faces = shape
    return Mesh(np.asarray(vertices, float), np.asarray(faces, np.int32))


SHAPES = {
    "tetrahedron": TETRAHEDRON,
    "cube": cube(),
    "plane": grid(9, 30),
    "torus": torus(),
    "sphere": sphere(),
    "two": together(torus(), sphere()),
}


@pytest.fixture
def no_helper(monkeypatch):
    """Let the helper process fail at once, as if xatlas had crashed."""

    def crash(*_, **__):
        raise GuardedFailure("the helper process was ended by SIGSEGV")

    monkeypatch.setattr(module, "run_guarded", crash)


@pytest.mark.parametrize("name", SHAPES)
def test_every_law_holds_on_simple_shapes(name):
    check_atlas(build_atlas(mesh_of(SHAPES[name]), rate=128), occupancy=0.2)


@pytest.mark.parametrize("name", SHAPES)
def test_every_law_holds_without_the_helper_process(name, no_helper):
    check_atlas(build_atlas(mesh_of(SHAPES[name]), rate=128), occupancy=0.2)


def test_charts_hang_together_and_are_few():
    mesh = mesh_of(torus(60, 40))
    atlas = build_atlas(mesh, rate=256)
    parts = connected(atlas.chart, twins(mesh.faces))
    assert parts.max() == atlas.chart.max() <= 30


def test_a_helper_process_out_of_time_is_replaced():
    mesh = mesh_of(sphere())
    late = build_atlas(mesh, rate=96, limit_s=0.001)
    check_atlas(late)


def test_nonsense_from_the_helper_process_is_replaced(monkeypatch):
    mesh = mesh_of(sphere())
    lost = {
        "uv": np.full((len(mesh.faces), 3, 2), np.nan),
        "chart": np.zeros(len(mesh.faces), np.int32),
    }
    monkeypatch.setattr(module, "run_guarded", lambda *_, **__: (lost, {}))
    check_atlas(build_atlas(mesh, rate=96))


def test_cancelling_is_no_failure_of_xatlas():
    def stop(fraction, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        build_atlas(mesh_of(sphere()), rate=96, progress=stop)


def test_progress_runs_from_0_to_1():
    seen = []
    build_atlas(mesh_of(sphere()), rate=96, progress=lambda fraction, label: seen.append(fraction))
    assert seen == sorted(seen) and seen[0] >= 0 and seen[-1] == 1


def test_the_same_mesh_gives_the_same_bits():
    mesh = mesh_of(together(torus(40, 30), sphere()))
    one, other = build_atlas(mesh, rate=200), build_atlas(mesh, rate=200)
    assert np.array_equal(one.uv, other.uv) and np.array_equal(one.chart, other.chart)


def test_another_rate_moves_charts_but_does_not_cut_them_anew():
    charts = chart_mesh(mesh_of(torus()))
    assert np.isclose(np.abs(areas(charts.uv)).sum(), surface(charts.mesh).sum())
    for rate in (32, 100, 513, 1500):
        atlas = pack(charts, rate=rate)
        assert np.array_equal(atlas.chart, charts.chart)
        edge = atlas.uv - np.roll(atlas.uv, 1, axis=1)
        before = charts.uv - np.roll(charts.uv, 1, axis=1)
        ratio = np.linalg.norm(edge, axis=2) / np.linalg.norm(before, axis=2)
        assert np.ptp(ratio) < 1e-6 * ratio.mean()


@pytest.mark.parametrize("exponent", [100, -100, -530, 500])
def test_the_unit_of_length_does_not_matter(exponent, no_helper):
    vertices, faces = torus()
    here = build_atlas(mesh_of((vertices, faces)), rate=96)
    there = build_atlas(mesh_of((vertices * 2.0**exponent, faces)), rate=96)
    assert np.array_equal(here.chart, there.chart)
    np.testing.assert_allclose(here.uv, there.uv, atol=1e-9)


@settings(max_examples=12)
@given(
    st.sampled_from([torus(18, 10), sphere(10, 14)]),
    st.lists(st.floats(-0.35, 0.35), min_size=9, max_size=9),
    st.floats(0.1, 10.0),
)
def test_laws_hold_for_deformed_shapes(shape, wave, flat):
    vertices, faces = shape
    matrix = np.array(wave).reshape(3, 3)
    moved = (vertices + np.sin(2 * vertices @ matrix.T)) * [1, 1, flat]
    check_atlas(build_atlas(mesh_of((moved, faces)), rate=96), stretch=1.1)


def scattered(count, seed=0):
    """Loose triangles of very different size."""
    random = np.random.default_rng(seed)
    size = np.exp(random.normal(size=(count, 1, 1))) * 0.01
    corners = random.random((count, 1, 3)) + random.normal(size=(count, 3, 3)) * size
    return mesh_of((corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)))


def test_thousands_of_components_each_get_a_texel():
    atlas = build_atlas(scattered(3000), rate=256)
    assert atlas.chart.max() == 2999
    check_atlas(atlas, gap=1)


def test_the_gap_shrinks_where_texels_are_few():
    check_atlas(build_atlas(scattered(200), rate=32), gap=1)


def test_as_many_charts_as_texels_fit():
    check_atlas(build_atlas(scattered(900), rate=32), gap=1)


def test_more_charts_than_texels_is_said_with_a_rate_that_does():
    with pytest.raises(AtlasFailed, match=r"901 charts .* 32 x 32.* at least 64") as caught:
        build_atlas(scattered(901), rate=32)
    rate = int(str(caught.value).split()[-1])
    check_atlas(build_atlas(scattered(901), rate=rate), gap=1)


SMALL = """3holes.off Duck.glb beetle.obj bunny.obj busted.STL cube_no_bottom.obj multibody.stl
nancolor.obj notenoughindices.obj soup.stl sphere.obj spot_low.obj spot_quads_uv.obj suzanne.obj
teapot.obj torus.obj""".split()


@pytest.mark.parametrize("name", SMALL)
def test_laws_hold_for_real_meshes(data, name):
    mesh, _ = read_mesh(data / "meshes" / name)
    atlas = build_atlas(mesh, rate=192)
    check_atlas(atlas, stretch=1.05)


@pytest.mark.parametrize("name", ["fertility.off", "camelhead.off"])
def test_laws_hold_where_charts_come_from_a_proxy(data, name):
    mesh, _ = read_mesh(data / "meshes" / name)
    atlas = build_atlas(mesh, rate=256)
    assert 6 <= atlas.chart.max() < 60
    check_atlas(atlas, stretch=1.05, occupancy=0.4)
    assert covered_twice(atlas).max() <= 4
