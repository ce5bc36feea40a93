"""Nodes and shares of many surfels against the interpolators and the reference's rules."""

from __future__ import annotations

import numpy as np
import pytest

from btfcore.btf.directions import layout
from btfcore.btf.interpolation.interpolator import DirectionInterpolator, prepare
from btfcore.render.lookup import light_nodes, view_nodes
from btfcore.render.lookup_tables import lookup
from btfcore.render.reference import local_lights, local_views
from btfcore.render.surfels import Surfels
from btfcore.types import F4, F8
from tests.render.scenes import EYE, FAR, ball

LIGHT = np.array([0.48, -0.6, 0.64])
CASES = [
    *[("12x8x12x8", method) for method in ("grid", "barycentric", "nearest")],
    *[("ubo81", method) for method in ("grid", "barycentric", "nearest4")],
    *[("3x1x4x1", method) for method in ("grid", "barycentric", "nearest4")],
]


def spread(directions: DirectionInterpolator, node: object, share: object) -> F8:
    """Shares of all nodes (n, D)."""
    found = np.zeros((len(np.asarray(node)), len(directions.mix)))
    np.add.at(found, (np.arange(len(found))[:, None], np.asarray(node)), np.asarray(share))
    return found


@pytest.mark.parametrize(("name", "method"), CASES)
@pytest.mark.parametrize("eye", [EYE, FAR], ids=["near", "far"])
def test_views_have_the_nodes_of_the_interpolator(name: str, method: str, eye: F8) -> None:
    surfels, chosen = ball(600), np.arange(600)[::-1]
    directions = prepare(layout(name).views, method)
    found = spread(directions, *view_nodes(lookup(directions), surfels, chosen, eye))
    local = local_views(surfels, chosen, eye)
    wanted = spread(directions, *directions.node_weights(local))
    off = np.abs(found - wanted).max(axis=1)
    if method.startswith("nearest"):  # they jump where the set changes
        assert (off > 1e-4).mean() < 0.005
    else:
        assert off.max() < 1e-4


@pytest.mark.parametrize(("name", "method"), CASES)
@pytest.mark.parametrize("cosine", [False, True])
def test_lights_have_them_and_fade(name: str, method: str, cosine: bool) -> None:
    surfels, chosen = ball(600), np.arange(600)
    directions = prepare(layout(name).lights, method)
    node, share, gain = light_nodes(lookup(directions), surfels, chosen, LIGHT, cosine=cosine)
    local = local_lights(surfels, chosen, LIGHT)
    above = local[:, 2] > 1e-5
    wanted = spread(directions, *directions.node_weights(local))
    off = np.abs(spread(directions, node, share) - wanted)[above].max(axis=1)
    assert (off > 1e-4).mean() < (0.005 if method.startswith("nearest") else 1e-9)
    full = np.where(local[:, 2] > 0, directions.fade(local) if cosine else local[:, 2], 0)
    assert np.abs(gain - full).max() < 1e-5
    assert (gain[local[:, 2] <= 0] == 0).all()


def test_directions_of_the_sample_are_nodes_of_their_own() -> None:
    for name in ("12x8x12x8", "ubo81"):
        wanted = layout(name).lights
        directions = prepare(wanted, "grid")
        for number, light in enumerate(wanted):
            node, share, _ = light_nodes(
                lookup(directions), _flat(1), np.zeros(1, np.int64), light, cosine=True
            )
            assert spread(directions, node, share)[0, number] > 1 - 2e-6


def test_the_azimuth_wraps_without_a_seam() -> None:
    directions = prepare(layout("12x8x12x8").views, "grid")
    table = lookup(directions)
    before = after = np.zeros(0)
    for turn in (-1e-4, 1e-4):
        eye = np.array([np.cos(turn), np.sin(turn), 1.0, 0.0])
        found = spread(directions, *view_nodes(table, _flat(1), np.zeros(1, np.int64), eye))[0]
        before, after = after, found
    assert np.abs(before - after).max() < 1e-3


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4"])
def test_poles_horizons_and_broken_frames_have_sound_shares(method: str) -> None:
    directions = prepare(layout("12x8x12x8").views, method)
    table, surfels = lookup(directions), _flat(6)
    frame = surfels.frame.copy()
    frame[1], frame[2], frame[3, 0] = np.nan, 0.0, np.inf
    broken = Surfels(surfels.position, frame, surfels.source, surfels.sample)
    eyes: list[list[float]] = [
        [0, 0, 1, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 1e-9, -1, 0],
    ]  # fmt: skip
    for eye in eyes:
        node, share = view_nodes(table, broken, np.arange(6), np.array(eye, float))
        assert ((node >= 0) & (node < len(directions.mix))).all()
        assert (share >= 0).all()
        assert np.abs(share.sum(axis=1) - 1).max() < 1e-5
    behind = view_nodes(table, surfels, np.arange(1), np.array([0, 0, -1.0, 0]))
    along = directions.node_weights(np.array([[1.0, 0, 0]]))
    assert np.allclose(spread(directions, *behind), spread(directions, *along), atol=1e-5)


def _flat(count: int) -> Surfels:
    frame: F4 = np.tile(np.eye(3, dtype=np.float32), (count, 1, 1))
    zero = np.zeros((count, 3), np.float32)
    return Surfels(zero, frame, zero[:, :2].copy(), np.zeros(count, np.uint16))
