"""Pictures of seams, charts and field, by what they must mean."""

import numpy as np
import pytest

from btfcore.patch.connectivity import adjacency
from btfcore.render import modes
from btfcore.types import Quilt
from tests.surfaces import constant_field, plane, sphere


def halves(dense, bare=0):
    """A quilt of two patches, left and right of the middle; the first `bare` rows are bare."""
    row, column = dense.texel.T
    patch = (column > column.max() // 2).astype(np.int32)
    patch[row < bare] = -1
    count = len(patch)
    zeros = np.zeros(count, np.float32)
    return Quilt(np.zeros((count, 2), np.float32), zeros, np.zeros(count, np.uint16), patch)


@pytest.mark.parametrize("width", [1, 2])
def test_seams_are_drawn_where_patches_meet_and_nowhere_else(width):
    dense = plane(12, 20)
    colours = np.full((len(dense.vertices), 3), 0.25, np.float32)
    out = modes.seam_colours(dense, halves(dense, bare=3), colours, width=width)
    row, column = dense.texel.T
    middle = column.max() // 2
    sure = (row > 3 + width) & (column > middle - width) & (column <= middle + width)
    assert (out[sure] == modes.SEAM).all()
    far = (row < 3 - width) | (np.abs(column - middle - 0.5) > 2 * width)
    assert np.array_equal(out[far], colours[far])
    assert colours.max() == 0.25  # what came in is left alone


def test_neighbouring_charts_differ():
    dense = sphere(2)  # every vertex a chart of its own
    colours = modes.chart_colours(dense)
    edges = dense.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    apart = np.abs(colours[edges[:, 0]] - colours[edges[:, 1]]).sum(axis=1)
    assert np.median(apart) > 0.1
    assert colours.min() >= 0 and colours.max() <= 1


def test_streaks_run_along_the_field():
    dense = plane(40, 60)
    colours = modes.field_colours(dense, constant_field(dense, (1.0, 0.0, 0.0)))
    value = colours.sum(axis=1).reshape(40, 60)
    along, across = np.abs(np.diff(value, axis=1)).mean(), np.abs(np.diff(value, axis=0)).mean()
    assert across > 3 * along
    assert colours.min() >= 0 and colours.max() <= 1


def test_streaks_are_the_same_every_time_and_seeded():
    dense = sphere(3)
    field = constant_field(dense)
    one, two, other = (modes.field_colours(dense, field, seed=seed) for seed in (0, 0, 1))
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_streaks_match_a_plain_python_twin():
    dense = sphere(2)
    field = constant_field(dense)
    indptr, indices = adjacency(np.ascontiguousarray(dense.faces), len(dense.vertices))
    noise = np.random.default_rng(3).standard_normal(len(dense.vertices))
    arguments = (
        dense.vertices, dense.normals, field.tangents, indptr, indices, noise, dense.step, 5, 0.25,
    )  # fmt: skip
    out, twin = np.empty(len(noise)), np.empty(len(noise))
    modes._streaks(*arguments, out)
    plain_streaks(*arguments, twin)
    assert np.allclose(out, twin, atol=1e-9)


def plain_streaks(points, normals, tangents, indptr, indices, noise, step, reach, tail, out):
    for start in range(len(points)):
        total, weights = noise[start], 1.0
        for sense in (1.0, -1.0):
            here, point = start, points[start].copy()
            for k in range(1, reach + 1):
                point += sense * step * tangents[here]
                for _ in range(2):
                    ring = np.append(here, indices[indptr[here] : indptr[here + 1]])
                    here = ring[np.argmin(((points[ring] - point) ** 2).sum(axis=1))]
                point -= ((point - points[here]) @ normals[here]) * normals[here]
                weight = (1.0 if sense > 0 else tail) * (1 - k / (reach + 1.0))
                total += weight * noise[here]
                weights += weight
        out[start] = total / weights
