"""Topology kernels against plain Python twins, and counts of surfaces that are known."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from btfcore.mesh import topology
from tests.mesh import shapes


@st.composite
def soups(draw):
    """Triangles with distinct corners on few vertices: every topology there is."""
    count = draw(st.integers(3, 9))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    rows = draw(st.integers(1, 25))
    return np.array([rng.choice(count, 3, replace=False) for _ in range(rows)])


def by_edge(faces):
    """Half-edges on every undirected edge, in a dictionary."""
    table = defaultdict(list)
    for face, corners in enumerate(faces.tolist()):
        for k in range(3):
            table[tuple(sorted((corners[k], corners[(k + 1) % 3])))].append(3 * face + k)
    return table


def plain_twins(faces):
    """Twin of `topology.twins`."""
    origin = faces.reshape(-1)
    twin = np.full(len(origin), -1)
    for half_edges in by_edge(faces).values():
        if len(half_edges) == 2 and origin[half_edges[0]] != origin[half_edges[1]]:
            twin[half_edges[0]], twin[half_edges[1]] = half_edges[1], half_edges[0]
    return twin


def plain_groups(count, links):
    """Connected groups of 0 … count-1, numbered by first appearance, by relabelling."""
    label = list(range(count))
    for a, b in links:
        old, new = max(label[a], label[b]), min(label[a], label[b])
        label = [new if value == old else value for value in label]
    names = {value: number for number, value in enumerate(dict.fromkeys(label))}
    return np.array([names[value] for value in label])


@settings(deadline=None, max_examples=60)
@given(soups())
def test_kernels_equal_their_plain_twins(faces):
    table = by_edge(faces)
    pairs, counts = topology.edges(faces)
    assert pairs.tolist() == [list(key) for key in sorted(table)]
    assert counts.tolist() == [len(table[key]) for key in sorted(table)]

    twin = topology.twins(faces)
    assert np.array_equal(twin, plain_twins(faces))

    def after(h):
        return h - 2 if h % 3 == 2 else h + 1

    links = [(h, after(int(t))) for h, t in enumerate(twin) if t >= 0]
    fan, count = topology.fans(twin)
    assert np.array_equal(fan, plain_groups(3 * len(faces), links))
    assert count == fan.max() + 1

    shared = [(h[0] // 3, other // 3) for h in table.values() for other in h[1:]]
    assert np.array_equal(topology.components(faces), plain_groups(len(faces), shared))


@pytest.mark.parametrize(
    ("shape", "euler", "loops", "border", "parts"),
    [
        (shapes.TETRAHEDRON, 2, 0, 0, 1),
        (shapes.torus(), 0, 0, 0, 1),
        (shapes.sphere(), 2, 0, 0, 1),
        (shapes.grid(4, 5), 1, 1, 14, 1),
        (shapes.moebius(), 0, 1, 40, 1),
        (shapes.together(shapes.cube(), shapes.cube((3, 0, 0))), 4, 0, 0, 2),
    ],
)
def test_statistics_of_known_surfaces(shape, euler, loops, border, parts):
    found = topology.statistics(*shape)
    assert (found.euler, found.boundary_loops, found.boundary_edges) == (euler, loops, border)
    assert (found.components, found.nonmanifold_edges) == (parts, 0)


def test_a_hole_is_a_loop_more_and_an_euler_number_less():
    vertices, faces = shapes.grid(6, 6)
    centre = np.linalg.norm(vertices[faces].mean(axis=1) - [2.5, 2.5, 0], axis=1) < 0.6
    found = topology.statistics(vertices, faces[~centre])
    assert (found.boundary_loops, found.euler) == (2, 0)


@pytest.mark.parametrize(
    "faces",
    [
        [[0, 1, 2], [0, 3, 4]],  # bow-tie
        [[0, 1, 2], [1, 0, 3], [0, 1, 4]],  # edge of three faces
        [[0, 1, 2], [0, 1, 3]],  # neighbours that disagree
        shapes.moebius()[1],
    ],
)
def test_what_is_not_manifold(faces):
    assert not topology.is_manifold(faces)


def test_what_is_manifold():
    for _, faces in (shapes.TETRAHEDRON, shapes.torus(), shapes.grid(3, 3), shapes.cube()):
        assert topology.is_manifold(faces)
    assert topology.is_manifold(np.empty((0, 3), int))


def test_a_hub_of_all_faces_takes_linear_time():
    rim = np.arange(1, 200_001)
    faces = np.stack([np.zeros_like(rim), rim, np.roll(rim, -1)], axis=1)
    assert topology.is_manifold(faces)
    assert topology.statistics(np.zeros((200_001, 3)), faces).euler == 1


def test_normals_of_a_sphere_point_outward_whatever_its_scale_and_place():
    vertices, faces = shapes.sphere(40, 60)
    expected = topology.vertex_normals(vertices, faces)
    assert (expected * vertices).sum(axis=1).min() > 0.999
    for scale, shift in ((1e-9, 0.0), (1e9, 0.0), (1.0, 1e4)):
        normals = topology.vertex_normals(vertices * scale + shift, faces)
        assert np.abs(normals - expected).max() < 1e-9


def test_normals_equal_the_plain_twin_and_are_always_unit():
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(30, 3))
    faces = np.array([rng.choice(29, 3, replace=False) for _ in range(60)])  # 29 stays bare
    faces[0] = [4, 4, 5]
    plain = np.zeros_like(vertices)
    for face in faces:
        a, b, c = vertices[face]
        normal = np.cross(b - a, c - a)
        if np.linalg.norm(normal) == 0:
            continue
        for k in range(3):
            here, ahead, behind = vertices[np.roll(face, -k)]
            one, two = ahead - here, behind - here
            cosine = one @ two / np.linalg.norm(one) / np.linalg.norm(two)
            plain[face[k]] += normal / np.linalg.norm(normal) * np.arccos(np.clip(cosine, -1, 1))
    normals = topology.vertex_normals(vertices, faces)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    length = np.linalg.norm(plain, axis=1)
    assert np.allclose(normals[length > 0], (plain[length > 0].T / length[length > 0]).T)
    assert normals[29].tolist() == [0, 0, 1]
