"""Laws of colour look-up and of the atlas texture."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, map_coordinates

from btfcore.errors import InvalidParameter
from btfcore.render.gutter import (
    RINGS,
    gutter_source,
    nearest_owner,
    texel_frames,
    texel_owner,
)
from btfcore.render.texture import BARE, atlas_texture, quantise, vertex_colours
from btfcore.types import Quilt, Sample
from tests.boxes import bilinear, box, quilt_on, scatter


def sample_of(height, width, tiles=False, seed=0):
    colour = np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)
    return Sample("noise", colour, colour.copy(), tiles)


def quilt_of(source, sample=0, patch=0):
    count = len(source)
    return Quilt(
        np.asarray(source, np.float32),
        np.zeros(count, np.float32),
        np.broadcast_to(np.asarray(sample, np.uint16), (count,)).copy(),
        np.broadcast_to(np.asarray(patch, np.int32), (count,)).copy(),
    )


@pytest.mark.parametrize(("height", "width"), [(12, 17), (1, 1), (1, 9), (5, 1)])
@pytest.mark.parametrize("tiles", [False, True])
def test_look_up_is_bilinear_with_the_right_border(height, width, tiles):
    sample = sample_of(height, width, tiles)
    source = np.random.default_rng(1).uniform(-3, 25, (500, 2)).astype(np.float32)
    expected = [
        map_coordinates(
            sample.colour[..., band].astype(float),
            [source[:, 1], source[:, 0]],
            order=1,
            mode="grid-wrap" if tiles else "nearest",
        )
        for band in range(3)
    ]
    found = vertex_colours(quilt_of(source), [sample])
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, np.stack(expected, axis=1), atol=2e-6)


def test_integer_positions_return_the_texel_itself():
    sample = sample_of(6, 7)
    row, column = np.mgrid[:6, :7]
    found = vertex_colours(quilt_of(np.stack([column, row], -1).reshape(-1, 2)), [sample])
    assert np.array_equal(found, sample.colour.reshape(-1, 3))


def test_a_tiling_sample_repeats_even_just_below_zero():
    sample = sample_of(6, 7, tiles=True)
    found = vertex_colours(quilt_of([[-1e-9, -1e-9], [7, 6], [0, 0], [-7, 12]]), [sample])
    np.testing.assert_allclose(found, np.repeat(sample.colour[:1, 0], 4, axis=0), atol=1e-6)


def test_every_vertex_looks_into_its_own_sample_and_bare_ones_are_grey():
    samples = [sample_of(4, 4, seed=1), sample_of(8, 3, seed=2)]
    quilt = quilt_of([[1, 1], [1, 1], [np.nan, 0]], sample=[0, 1, 9], patch=[0, 3, -1])
    found = vertex_colours(quilt, samples)
    assert np.array_equal(found[0], samples[0].colour[1, 1])
    assert np.array_equal(found[1], samples[1].colour[1, 1])
    assert (found[2] == BARE).all()
    assert (vertex_colours(quilt_of([[0, 0]], patch=-1), []) == BARE).all()


def test_a_missing_sample_or_position_is_refused():
    with pytest.raises(InvalidParameter, match="sample 2"):
        vertex_colours(quilt_of([[0, 0]], sample=2), [sample_of(4, 4)])
    with pytest.raises(InvalidParameter, match="finite"):
        vertex_colours(quilt_of([[np.inf, 0]]), [sample_of(4, 4)])


@pytest.mark.parametrize("share", [0.5, 0.02, 0.0005])
def test_nearest_owner_agrees_with_scipy(share):
    covered = np.random.default_rng(3).random((70, 90)) < share
    covered[41, 7] = True
    owner = np.where(covered, np.arange(70 * 90).reshape(70, 90), -1).astype(np.int32)
    row, column = np.divmod(nearest_owner(owner), 90)
    r, c = np.mgrid[:70, :90]
    found = (row - r) ** 2 + (column - c) ** 2
    assert np.array_equal(found, np.rint(distance_transform_edt(~covered) ** 2))


def test_frames_are_the_parameterisation_even_on_single_lines_of_texels():
    _, dense = box(8)
    frames = texel_frames(dense, np.arange(len(dense.vertices)))
    step = 1 / 8
    np.testing.assert_allclose(np.linalg.norm(frames, axis=1), step, atol=1e-12)
    turned = np.cross(frames[..., 0], -frames[..., 1]) / step**2  # s × t = n, t = -row
    np.testing.assert_allclose(turned, dense.normals, atol=1e-12)
    for line in (1, 8, 7, 9):  # a row, a column and both diagonals
        vertices = np.array([27, 27 + line, 27 - line])
        lone = type(dense)(
            dense.vertices[vertices],
            dense.normals[vertices],
            np.zeros((0, 3), np.int32),
            dense.texel[vertices],
            dense.chart[vertices],
            dense.face[vertices],
            dense.bary[vertices],
            dense.size,
            0,
        )
        np.testing.assert_allclose(texel_frames(lone, np.arange(3)), frames[vertices], atol=1e-12)


def walk_in_python(dense, owner):
    """Twin of the gutter's walk: plain loops over a dictionary of neighbours."""
    near = {}
    for a, b, c in dense.faces.tolist():
        for one, two in ((a, b), (b, c), (c, a)):
            near.setdefault(one, set()).add(two)
            near.setdefault(two, set()).add(one)
    frames = texel_frames(dense, np.arange(len(dense.vertices)))
    found = {}
    for row, column in np.argwhere(owner < 0):
        away = ((dense.texel - [row, column]) ** 2).sum(axis=1)
        if away.min() > RINGS**2:
            continue
        close = np.flatnonzero(away == away.min())
        vertex = close[np.lexsort(dense.texel[close].T[::-1])[0]]
        move = np.array([column, row]) - dense.texel[vertex, ::-1]
        target = dense.vertices[vertex] + frames[vertex] @ move
        while True:
            ring = sorted(near[vertex])
            distance = ((dense.vertices[ring] - target) ** 2).sum(axis=1)
            if distance.min() >= ((dense.vertices[vertex] - target) ** 2).sum():
                break
            vertex = ring[int(distance.argmin())]
        found[int(row), int(column)] = vertex
    return found


def test_the_gutter_agrees_with_its_python_twin():
    atlas, dense = box(6, gap=5)
    moved = dense.vertices + np.random.default_rng(5).normal(0, 0.01, dense.vertices.shape)
    dense = type(dense)(**{**vars(dense), "vertices": moved})
    source = gutter_source(dense)
    expected = walk_in_python(dense, texel_owner(dense))
    assert expected
    assert {place: source[place] for place in expected} == expected


def test_covered_texels_map_to_themselves_and_the_whole_image_is_filled():
    _, dense = box(10)
    source = gutter_source(dense)
    assert source.shape == (dense.size, dense.size)
    assert source.dtype == np.int32
    assert np.array_equal(source[tuple(dense.texel.T)], np.arange(len(dense.vertices)))
    assert source.min() >= 0
    colours = np.random.default_rng(0).random((len(dense.vertices), 3)).astype(np.float32)
    image = atlas_texture(dense, colours)
    assert np.array_equal(image, quantise(colours)[source])
    assert np.array_equal(image, atlas_texture(dense, colours, source=source))


def test_the_first_gutter_ring_lies_across_the_seam():
    _, dense = box(10)
    source = gutter_source(dense)
    owner = texel_owner(dense)
    for row, column in dense.texel[dense.chart == 0]:
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            if owner[row + dr, column + dc] < 0:
                across = source[row + dr, column + dc]
                assert dense.chart[across] != 0
                here = dense.vertices[owner[row, column]]
                assert np.linalg.norm(dense.vertices[across] - here) < 1.5 / 10


def test_the_textured_input_mesh_shows_the_dense_mesh_up_to_its_seams():
    atlas, dense = box(32)
    colours = dense.vertices.astype(np.float32) * 0.9 + 0.5
    image = atlas_texture(dense, colours)
    points, uv = scatter(atlas.mesh.vertices[atlas.mesh.faces], None, atlas.uv, 50000)
    error = np.abs(bilinear(image, uv[:, 0], uv[:, 1]) - 255 * (points * 0.9 + 0.5)).max(axis=1)
    assert error.mean() < 2
    assert (error > 20).mean() < 1e-3


def test_quantising_clips_rounds_and_survives_nan():
    values = np.float32([[-1, 0, 0.5], [1, 2, np.nan], [1 / 255, 254.4 / 255, 254.6 / 255]])
    assert quantise(values).tolist() == [[0, 0, 128], [255, 255, 0], [1, 254, 255]]


def test_colours_of_another_mesh_are_refused():
    _, dense = box(6)
    with pytest.raises(InvalidParameter, match="216"):
        atlas_texture(dense, np.zeros((7, 3), np.float32))


def test_a_random_quilt_gives_the_texture_its_samples_colours():
    _, dense = box(6)
    quilt, _ = quilt_on(dense)
    colours = vertex_colours(quilt, [sample_of(12, 16)])
    assert np.array_equal(atlas_texture(dense, colours)[tuple(dense.texel.T)], quantise(colours))
