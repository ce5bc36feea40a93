"""Laws of every scheme on every set: partition of unity, exactness, continuity, horizon."""

import numpy as np
import pytest

from btfcore.btf.directions import from_angles, layout, rings
from btfcore.btf.interpolation.interpolator import prepare
from btfcore.errors import InvalidParameter
from tests.btf.interpolation.sets import CASES, CONTINUOUS, GRIDS, SETS, dense, paths, scattered

ENDING = [name for name in GRIDS if name not in ("pole", "horizon")]  # rings with a beyond
QUERIES = np.concatenate([scattered(3000, 11), from_angles(np.pi / 2 - 1e-9, np.arange(7.0))])


@pytest.mark.parametrize(("name", "method"), CASES)
def test_weights_part_unity(name, method):
    index, weight = prepare(SETS[name], method).weights(QUERIES)
    assert weight.min() >= 0
    np.testing.assert_allclose(weight.sum(axis=1), 1, atol=1e-14)
    assert index.min() >= 0 and index.max() < len(SETS[name])


@pytest.mark.parametrize(("name", "method"), CASES)
def test_directions_of_the_set_are_exact(name, method):
    found = prepare(SETS[name], method)
    np.testing.assert_array_equal(
        dense(found.weights(SETS[name]), len(SETS[name])).argmax(axis=1), np.arange(len(SETS[name]))
    )
    # rounded azimuths and collinear points are met to the rounding of the angles only
    tight = dense(found.weights(SETS[name]), len(SETS[name]))
    np.testing.assert_allclose(tight, np.eye(len(SETS[name])), atol=1e-11)
    assert not found.clamped(SETS[name]).any()


@pytest.mark.parametrize(("name", "method"), CONTINUOUS)
def test_values_have_no_jumps(name, method):
    """Where the steepest steps of a path are cut ever finer, what they rise by vanishes."""
    directions = SETS[name]
    found = prepare(directions, method)
    values = np.random.default_rng(7).uniform(-1, 1, (len(directions), 3))
    for label, path in paths(1001).items():
        assert zoomed(found, values, path) < 2e-3, label


def zoomed(found, values, path):
    """Largest rise of the values along the path's ten steepest steps, cut ever finer."""
    pieces = path[None]
    for _ in range(3):
        weight = dense(found.weights(pieces.reshape(-1, 3)), len(values))
        value = (weight @ values).reshape(*pieces.shape[:2], -1)
        rise = np.abs(np.diff(value, axis=1)).max(axis=2)
        piece, step = np.unravel_index(np.argsort(rise, axis=None)[-10:], rise.shape)
        line = np.linspace(0, 1, 1001)[:, None]
        pieces = pieces[piece, None, step] * (1 - line) + pieces[piece, None, step + 1] * line
    return rise.max()


@pytest.mark.parametrize(("name", "method"), CONTINUOUS)
def test_the_pole_has_one_value_from_all_sides(name, method):
    around = from_angles(1e-9, np.linspace(0, 7, 40))
    weight = dense(prepare(SETS[name], method).weights(around), len(SETS[name]))
    assert np.ptp(weight, axis=0).max() < 1e-4


@pytest.mark.parametrize("method", ["nearest4", "nearest"])
def test_nearest_directions_do_jump(method):
    directions = SETS["12x8"]
    path = paths(1001)["around at 50 degrees, over the wrap"]
    found = prepare(directions, method)
    assert zoomed(found, np.eye(len(directions)), path) > 0.05


@pytest.mark.parametrize(("name", "method"), CASES)
def test_below_the_horizon_all_is_black(name, method):
    found = prepare(SETS[name], method)
    dark = np.concatenate(
        [-scattered(50, 3, 1.5), np.zeros((1, 3)), [[np.nan, 0, 1], [0, 0, np.nan]]]
    )
    dark = np.concatenate([dark, from_angles(np.radians([90.1, 180]), [0, 0])])
    index, weight = found.weights(dark)
    assert (weight == 0).all() and not found.clamped(dark).any()
    assert index.min() >= 0 and index.max() < len(SETS[name])
    assert found.weights(from_angles(np.pi / 2, [0.0, 1.0]))[1].sum() == pytest.approx(2)


@pytest.mark.parametrize(("name", "method"), CASES)
def test_lengths_do_not_matter_and_single_precision_is_kept(name, method):
    found = prepare(SETS[name], method)
    count = len(SETS[name])
    usual = dense(found.weights(QUERIES), count)
    # a tie of two nearest ones may fall otherwise when a query is scaled by other than 2^k
    np.testing.assert_array_equal(dense(found.weights(4 * QUERIES), count), usual)
    index, weight = found.weights(QUERIES[:100].astype(np.float32))
    assert weight.dtype == np.float32 and index.dtype == np.int32
    if not method.startswith("nearest") and name != "cluster":  # a step of 1e-7 is 1e-3 there
        np.testing.assert_allclose(dense((index, weight), count), usual[:100], atol=1e-5)


@pytest.mark.parametrize(("name", "method"), [case for case in CASES if case[0] in ENDING])
def test_beyond_the_last_ring_the_last_ring_counts(name, method):
    directions = SETS[name]
    found = prepare(directions, method)
    last = float(np.degrees(np.arccos(directions[:, 2].min())))
    phi = np.linspace(0, 7, 50)
    low, high = (from_angles(np.radians(theta), phi) for theta in (last, 88))
    assert found.clamped(high).all()
    assert not found.clamped(from_angles(np.radians(last * 0.4), phi)).any()
    if method == "grid":
        assert not found.clamped(low).any()
        np.testing.assert_allclose(
            dense(found.weights(high), len(directions)),
            dense(found.weights(low), len(directions)),
            atol=1e-9,
        )
    elif method == "barycentric":  # on the border: no more than two directions of the last ring
        index, weight = found.weights(high)
        used = directions[index[weight > 1e-9]]
        np.testing.assert_allclose(used[:, 2], directions[:, 2].min(), atol=1e-9)


def test_nodes_and_their_mix_are_the_weights():
    for name, directions in GRIDS.items():
        found = prepare(directions, "grid")
        index, weight = found.node_weights(QUERIES)
        assert index.shape[1] == found.nodes == 4
        mixed = dense((index, weight), len(found.mix)) @ found.mix
        np.testing.assert_allclose(
            mixed, dense(found.weights(QUERIES), len(directions)), atol=1e-15, err_msg=name
        )
        np.testing.assert_allclose(found.mix.sum(axis=1), 1)


def test_auto_takes_the_grid_where_all_rings_have_the_same_azimuths():
    aligned = ("12x8", "12x5", "one ring", "pole and ring", "pole", "horizon")
    for name, directions in SETS.items():
        want = "grid" if name in aligned else "barycentric"
        assert prepare(directions).method == want, name


@pytest.mark.parametrize(("name", "method"), CONTINUOUS)
def test_fading_is_continuous_and_ends_in_black(name, method):
    found = prepare(SETS[name], method)
    for theta in (np.linspace(0, 1.57, 2001), np.linspace(1.5, np.pi / 2, 2001)):
        for phi in (0.0, 0.1, 2.0, 4.0):
            share = found.fade(from_angles(theta, phi))
            assert share.min() >= 0 and share.max() <= 1
            if name != "horizon":  # whose last ring is black itself
                assert np.abs(np.diff(share)).max() < 0.03
    inside = QUERIES[~found.clamped(QUERIES)]
    assert (found.fade(inside) == 1).all() and (found.fade(-scattered(50, 3, 1.5)) == 1).all()
    below = found.fade(from_angles([np.pi / 2], [1.0]))
    assert below[0] < 1e-9 or name == "horizon"


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_of_repeated_directions_the_first_counts(method):
    directions = layout("ubo81").views
    twice = np.vstack([directions, directions[:30]])
    want = dense(prepare(directions, method).weights(QUERIES), 81)
    got = dense(prepare(twice, method).weights(QUERIES), 111)
    np.testing.assert_array_equal(got[:, :81], want)
    assert (got[:, 81:] == 0).all()
    same = np.tile(from_angles(0.5, 1.0), (4, 1))
    lone = prepare(same, "nearest" if method == "grid" else method).weights(QUERIES)
    assert (dense(lone, 4)[:, 0] == 1).all()


def test_a_lone_direction_counts_for_all():
    for method in ("auto", "barycentric", "nearest4", "nearest"):
        found = prepare(from_angles([0.5], [1.0]), method)
        assert (dense(found.weights(QUERIES), 1) == 1).all()


@pytest.mark.parametrize(
    ("directions", "method", "says"),
    [
        (np.zeros((0, 3)), "auto", r"shape \(0, 3\)"),
        ([0.0, 0.0, 1.0], "auto", r"shape \(3,\)"),
        ([[0.0, 0.0, 2.0]], "auto", "direction 0, .* is no unit vector"),
        ([[0.0, 0.0, np.nan]], "auto", "is no unit vector"),
        ([[0.0, 0.0, 1.0], [0.8, 0.0, -0.6]], "auto", "direction 1 lies below the horizon"),
        ([[0.0, 0.0, 1.0]], "cubic", "there is no interpolation 'cubic'; there are auto, grid"),
        (SETS["few"], "grid", "form no grid: the ring at .* has 1 directions"),
        (SETS["half a ring"], "grid", "not evenly spaced"),
        (from_angles(np.linspace(0.5, 0.501, 90), np.arange(90)), "grid", "do not part into rings"),
    ],
)
def test_unfit_directions_are_refused(directions, method, says):
    with pytest.raises(InvalidParameter, match=says):
        prepare(directions, method)


def test_queries_of_another_shape_are_refused():
    with pytest.raises(InvalidParameter, match=r"shape \(3,\)"):
        prepare(rings([(45, 8, 0)])).weights([0.0, 0.0, 1.0])
    assert prepare(rings([(45, 8, 0)])).weights(np.zeros((0, 3)))[0].shape == (0, 8)
