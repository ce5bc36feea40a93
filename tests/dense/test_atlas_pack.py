"""Laws of stencils and of their placement, against plain-numpy twins."""

import numpy as np
import pytest

from btfcore.dense.charts import Charts, signed_areas
from btfcore.dense.pack import pack
from btfcore.dense.placement import place
from btfcore.dense.stencil import cut_stencils, quarter_turn, stack
from btfcore.types import Mesh
from tests.dense.atlas_laws import areas, cover, least_gap


def rags(count, faces, seed=0, size=4.0):
    """Charts of overlapping random triangles: uv (F, 3, 2), order and bounds."""
    random = np.random.default_rng(seed)
    uv = random.normal(size=(count * faces, 3, 2)) * size
    chart = random.permutation(np.repeat(np.arange(count), faces))
    order = np.argsort(chart, kind="stable")
    return uv, order, np.searchsorted(chart[order], np.arange(count + 1))


def mask_of(stencils, item):
    mask = np.zeros((stencils.height[item], stencils.width[item]), bool)
    for j in range(len(mask)):
        at = stencils.start[item] + j
        for run in range(stencils.row[at], stencils.row[at + 1]):
            mask[j, stencils.first[run] : stencils.last[run] + 1] = True
    return mask


def touches(triangle, x, y):
    """Whether a triangle meets the unit cell about (x, y): no separating axis."""
    box = np.array([[x - 0.5, y - 0.5], [x + 0.5, y - 0.5], [x - 0.5, y + 0.5], [x + 0.5, y + 0.5]])
    edge = np.roll(triangle, -1, axis=0) - triangle
    for axis in [np.array([1.0, 0]), np.array([0, 1.0]), *np.stack([-edge[:, 1], edge[:, 0]], 1)]:
        one, two = triangle @ axis, box @ axis
        if one.max() < two.min() or two.max() < one.min():
            return False
    return True


def test_stencils_are_the_cells_that_faces_touch():
    uv, order, bounds = rags(5, 4)
    stencils = cut_stencils(uv, order, bounds)
    for c in range(5):
        mask = mask_of(stencils, c)
        left, low = stencils.corner[c]
        for j in range(-1, len(mask) + 1):
            for i in range(-1, mask.shape[1] + 1):
                inside = 0 <= j < len(mask) and 0 <= i < mask.shape[1] and mask[j, i]
                faces = order[bounds[c] : bounds[c + 1]]
                assert inside == any(touches(uv[f], left + i, low + j) for f in faces)
    assert stencils.cells().tolist() == [mask_of(stencils, c).sum() for c in range(5)]


def test_a_quarter_turn_is_that_of_the_chart():
    uv, order, bounds = rags(6, 3, seed=1)
    turned = quarter_turn(cut_stencils(uv, order, bounds))
    anew = cut_stencils(np.stack([uv[..., 1], -uv[..., 0]], axis=-1), order, bounds)
    assert np.array_equal(turned.corner, anew.corner)
    for c in range(6):
        assert np.array_equal(mask_of(turned, c), mask_of(anew, c))


def lay(stencils, order, size, margin):
    """Twin of `place`: try every rotation, row and column on a board of booleans."""
    count = len(order)
    busy, found, begin = np.zeros((size, size), bool), {}, {}
    for chart in order:
        best = None
        for rotation in range(len(stencils.height) // count):
            mask = mask_of(stencils, rotation * count + chart)
            tall, wide = mask.shape
            small = max(mask.shape) <= 12
            places = (
                (y, x)
                for y in range(begin.get(mask.shape, 0) if small else 0, size - tall + 1)
                for x in range(size - wide + 1)
                if not (busy[y : y + tall, x : x + wide] & mask).any()
            )
            y, x = next(places, (None, None))
            if y is not None and (best is None or y + tall < best[0]):
                best = y + tall, rotation, x, y
                if small:
                    begin[mask.shape] = y
        if best is None:
            return None
        found[chart] = best[1:]
        mask = mask_of(stencils, best[1] * count + chart)
        for dy in range(-margin, margin + 1):
            for dx in range(-margin, margin + 1):
                y, x = np.nonzero(mask)
                y, x = y + best[3] + dy, x + best[2] + dx
                fits = (y >= 0) & (y < size) & (x >= 0) & (x < size)
                busy[y[fits], x[fits]] = True
    return np.array([found[c] for c in range(count)])


@pytest.mark.parametrize("margin", [0, 2])
@pytest.mark.parametrize("size", [3.0, 7.0])
def test_placement_is_the_lowest_that_fits(margin, size):
    uv, order, bounds = rags(14, 2, seed=2, size=size)
    turned = [cut_stencils(uv, order, bounds)]
    for _ in range(3):
        turned.append(quarter_turn(turned[-1]))
    stencils = stack(turned)
    sequence = np.argsort(-turned[0].cells(), kind="stable")
    for board in (20, 60, 80):
        wanted = lay(stencils, sequence, board, margin)
        found = place(stencils, sequence, board, margin)
        assert (found is None) == (wanted is None)
        assert found is None or np.array_equal(found, wanted)


def squares(sides):
    """Charts of one square each, as a mesh of loose squares."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.concatenate([corner * side + [2.0 * k, 0, 0] for k, side in enumerate(sides)])
    face = np.array([[0, 1, 2], [0, 2, 3]])
    faces = np.concatenate([face + 4 * k for k in range(len(sides))]).astype(np.int32)
    flat = vertices[faces][..., :2] * [1, -1]
    return Charts(Mesh(vertices, faces), flat, np.repeat(np.arange(len(sides)), 2).astype(np.int32))


@pytest.mark.parametrize("rate", [32, 100, 512, 600, 1024, 1700])
def test_every_chart_has_a_texel_centre_in_the_middle_of_its_largest_face(rate):
    charts = squares([1.0, 0.5, 0.3, 1e-3, 1e-6])
    atlas = pack(charts, rate=rate)
    largest = np.arange(5) * 2
    middle = atlas.uv.mean(axis=1)
    near = np.abs(middle - np.rint(middle)).max(axis=1)
    assert (near.reshape(5, 2).min(axis=1) < 1e-6).all(), near[largest]
    assert atlas.uv.min() >= 0.5 - 1e-9 and atlas.uv.max() <= rate - 1.5 + 1e-9


def test_gaps_are_kept_while_cells_are_texels_and_when_they_are_not():
    for rate in (64, 530):
        atlas = pack(squares(np.linspace(0.2, 1, 12)), rate=rate)
        image, crowded = cover(atlas)
        assert crowded == 0 and least_gap(image) >= 3
        assert areas(atlas.uv).sum() > 0.5 * rate**2


def test_turned_charts_are_not_mirrored():
    charts = squares([1.0, 0.7, 0.4])
    assert (signed_areas(charts.uv) > 0).all()
    assert (signed_areas(pack(charts, rate=64).uv) > 0).all()


def test_a_square_fills_the_square():
    atlas = pack(squares([3.0]), rate=256)
    assert areas(atlas.uv).sum() > 0.95 * 256**2
