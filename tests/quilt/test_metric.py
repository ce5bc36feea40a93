"""The distance that seams are measured in, against its twin, on sheets of several samples."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from btfcore.quilt.metric import distance
from btfcore.quilt.sheet import Sheet, single, stacked


def value(part, at):
    """Bilinear value (K,) of (h, w, K) at (column, row), clamped at the border."""
    column, row = np.asarray(at, np.float64)
    return np.array(
        [
            map_coordinates(layer, [[row], [column]], order=1, mode="nearest")[0]
            for layer in np.moveaxis(part, 2, 0).astype(np.float64)
        ]
    )


def parts(*shapes, seed=0):
    random = np.random.default_rng(seed)
    return [random.random(shape).astype(np.float32) for shape in shapes]


def sheet(own, colours):
    """Samples of channels (h, w, K) that are compared with each other by colours (h, w, C)."""
    most = max(part.shape[2] for part in own)
    wide = [np.pad(part, ((0, 0), (0, 0), (0, most - part.shape[2]))) for part in own]
    first = np.cumsum([0] + [len(part) for part in own])[:-1]
    frames = [(top, *part.shape) for top, part in zip(first, own, strict=True)]
    return Sheet(stacked(wide), stacked(colours), np.array(frames, np.int32))


def measured(on, a, at, b, other):
    return distance(on.cut, on.colour, on.frames, a, *at, b, *other)


def places(count, reach=(16, 13), seed=1):
    """Places (count, 2, 2) f4, some of them beyond every border."""
    random = np.random.default_rng(seed)
    return (random.random((count, 2, 2)) * reach - 2).astype(np.float32)


SHAPES = ((7, 9, 4), (11, 6, 2), (5, 12, 3))


@pytest.mark.parametrize("mine", range(3))
def test_within_a_sample_its_own_channels_count(mine):
    own, colours = parts(*SHAPES), parts(*((h, w, 3) for h, w, _ in SHAPES), seed=5)
    on = sheet(own, colours)
    for at, other in places(40):
        expected = np.linalg.norm(value(own[mine], at) - value(own[mine], other))
        assert measured(on, mine, at, mine, other) == pytest.approx(expected, abs=1e-6)


def test_between_samples_colours_count():
    own, colours = parts(*SHAPES), parts(*((h, w, 3) for h, w, _ in SHAPES), seed=5)
    on = sheet(own, colours)
    for number, (at, other) in enumerate(places(60)):
        a, b = number % 3, (number + 1 + number % 2) % 3
        expected = np.linalg.norm(value(colours[a], at) - value(colours[b], other))
        assert measured(on, a, at, b, other) == pytest.approx(expected, abs=1e-6)


def test_in_one_space_all_samples_compare_by_all_channels():
    own = parts((7, 9, 5), (11, 6, 5))
    on = sheet(own, own)
    joint = Sheet(on.cut, on.cut, on.frames)
    for number, (at, other) in enumerate(places(40)):
        a, b = number % 2, (number // 2) % 2
        expected = np.linalg.norm(value(own[a], at) - value(own[b], other))
        assert measured(joint, a, at, b, other) == pytest.approx(expected, abs=1e-6)


def test_neighbours_on_the_sheet_never_show():
    """Beyond a border lies the border's own value, not the next sample's."""
    own = parts((7, 9, 3), (11, 6, 3))
    changed = [own[0], np.full_like(own[1], 50.0)]
    one, other = sheet(own, own), sheet(changed, changed)
    for at, there in places(40, reach=(14, 16)):
        assert measured(one, 0, at, 0, there) == measured(other, 0, at, 0, there)


def test_one_sample_is_measured_as_any_other():
    own = parts((7, 9, 3), (11, 6, 3))
    alone, joint = single(own[0]), sheet(own, own)
    for at, there in places(20):
        assert measured(alone, 0, at, 0, there) == measured(joint, 0, at, 0, there)
        assert measured(alone, 3, at, 8, there) == measured(alone, 0, at, 0, there)


def test_it_is_a_metric():
    """The seam nodes of a cut need the triangle inequality, also between samples."""
    own = parts((7, 9, 4), (11, 6, 4))
    on = sheet(own, own)
    random = np.random.default_rng(3)
    for _ in range(100):
        at = (random.random((3, 2)) * [12, 14] - 1).astype(np.float32)
        a, b, c = random.integers(0, 2, 3).tolist()
        one = measured(on, a, at[0], b, at[1])
        assert measured(on, a, at[0], a, at[0]) == 0
        assert one == measured(on, b, at[1], a, at[0]) > 0
        around = measured(on, a, at[0], c, at[2]) + measured(on, c, at[2], b, at[1])
        assert one <= around + 1e-9
