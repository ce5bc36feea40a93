"""Distances to a mesh equal those to a dense sampling of it, at any scale and place."""

import numpy as np
import pytest

from btfcore.errors import InvalidMesh
from btfcore.mesh.distance import distance_to_mesh
from btfcore.types import Mesh
from tests.mesh import shapes


def test_distance_to_a_cube_is_known():
    mesh = Mesh(*shapes.cube())
    points = np.array([[0.5, 0.5, 3], [0.5, 0.5, 0.4], [2, 2, 1], [1, 1, 1]])
    assert distance_to_mesh(points, mesh) == pytest.approx([2, 0.4, np.sqrt(2), 0])


@pytest.mark.parametrize(("scale", "shift"), [(1e-9, 0), (1e9, 0), (1, 1e6)])
def test_scale_and_place_do_not_matter(scale, shift):
    vertices, faces = shapes.torus()
    points = np.random.default_rng(1).normal(size=(50, 3)) * 2
    near = distance_to_mesh(points, Mesh(vertices.copy(), faces))
    far = distance_to_mesh(points * scale + shift, Mesh(vertices * scale + shift, faces))
    assert far / scale == pytest.approx(near, abs=1e-8)


def test_brute_force_agrees():
    vertices, faces = shapes.sphere(8, 10)
    rng = np.random.default_rng(2)
    points = rng.normal(size=(20, 3))
    weights = rng.dirichlet([0.5, 0.5, 0.5], (len(faces), 3000))
    cloud = np.einsum("fsk,fki->fsi", weights, vertices[faces]).reshape(-1, 3)
    brute = [np.linalg.norm(cloud - point, axis=1).min() for point in points]
    assert distance_to_mesh(points, Mesh(vertices, faces)) == pytest.approx(brute, abs=1e-2)


def test_sampling_none_and_nonsense():
    mesh = Mesh(*shapes.cube())
    points = np.random.default_rng(0).random((100, 3))
    assert len(distance_to_mesh(points, mesh, sample=7)) == 7
    assert len(distance_to_mesh(np.empty((0, 3)), mesh)) == 0
    with pytest.raises(InvalidMesh, match="finite"):
        distance_to_mesh([[np.nan, 0, 0]], mesh)
    with pytest.raises(InvalidMesh, match="0 faces"):
        distance_to_mesh(points, Mesh(mesh.vertices, np.empty((0, 3), np.int32)))
