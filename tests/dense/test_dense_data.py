"""The dense mesh of real meshes, through the project's own reader and atlas."""

import pytest

from btfcore.dense.atlas import chart_mesh
from btfcore.dense.build import build_dense_mesh
from btfcore.dense.diagnostics import dense_diagnostics
from btfcore.dense.pack import pack
from btfcore.mesh.distance import distance_to_mesh
from btfcore.mesh.reader import read_mesh
from tests.dense.laws import assert_lawful, assert_samples, topology

SMOOTH = {"bunny.obj", "spot_low.obj", "torus.obj", "fertility.off"}
OTHERS = {"teapot.obj", "cube_no_bottom.obj", "suzanne.obj", "soup.stl", "beetle.obj", "busted.STL"}


@pytest.mark.parametrize("name", sorted(SMOOTH | OTHERS))
def test_real_meshes_keep_their_topology(data, name):
    mesh, _ = read_mesh(data / "meshes" / name)
    charts = chart_mesh(mesh)
    for rate in (64, 100, 256):
        assert_lawful(build_dense_mesh(pack(charts, rate=rate)), mesh)
    if name in SMOOTH:
        dense = build_dense_mesh(pack(charts, rate=512))
        far = distance_to_mesh(dense.vertices[dense.faces].mean(1), mesh) / mesh.diagonal
        assert far.mean() <= 5e-5
        assert far.max() <= 4e-3


def test_many_holes_at_a_low_rate_are_kept_or_told(data):
    mesh, _ = read_mesh(data / "meshes" / "plane_holes.obj")
    charts = chart_mesh(mesh)
    assert_lawful(build_dense_mesh(pack(charts, rate=64)), mesh)
    dense = build_dense_mesh(pack(charts, rate=32))
    assert_samples(dense, mesh)
    parts, manifold = topology(dense.faces)
    assert manifold
    found = dense_diagnostics(dense, mesh)
    assert parts[0][2] == 27 or found.notes
