"""Compiled evaluation against the reference, for every kind of material and of surfel."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from btfcore.btf.sample import Encoding
from btfcore.errors import InvalidParameter
from btfcore.render import reference
from btfcore.render.evaluate import Evaluator, radiance
from btfcore.render.lights import NONE, Lights, directional
from btfcore.render.material import Material
from btfcore.render.surfels import Surfels
from btfcore.types import F8
from tests.render.scenes import EYE, FAR, ball, factors, gap, harmonics, images

TWO = directional([[0.5, 0.5, 0.7], [0.1, -1.0, 0.3]], [[1.0, 0.9, 0.8], [0.3, 0.2, 0.5]])
CLOSE = 1e-4  # of sRGB, at worst


def agree(
    materials: Sequence[Material],
    surfels: Surfels,
    eye: F8 = EYE,
    lights: Lights = TWO,
    **details: Any,
) -> None:
    ours = radiance(materials, surfels, eye, lights, **details)
    truth = reference.radiance(materials, surfels, eye, lights, **details)
    assert np.isfinite(ours).all()
    assert (ours >= 0).all()
    assert truth.mean() > 0.01
    assert gap(ours, truth)[1] < CLOSE


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
@pytest.mark.parametrize("eye", [EYE, FAR], ids=["near", "far"])
def test_every_interpolation_agrees_with_the_reference(method: str, eye: F8) -> None:
    agree([factors(method=method)], ball(700), eye)


@pytest.mark.parametrize("directions", ["6x3x5x4", "12x8x12x8", "ubo81", "3x1x4x1"])
def test_rings_of_any_kind_agree(directions: str) -> None:
    agree([factors(directions=directions, method="grid")], ball(700))


@pytest.mark.parametrize("name", ["linear", "sqrt", "log", "logluma"])
@pytest.mark.parametrize("knee", [None, 0.4])
def test_every_encoding_agrees(name: str, knee: float | None) -> None:
    encoding = Encoding(name, 0.01, knee)
    agree([factors(encoding=encoding)], ball(500))


@pytest.mark.parametrize("tiles", [False, True])
@pytest.mark.parametrize("cosine", [False, True])
def test_borders_and_cosines_agree(tiles: bool, cosine: bool) -> None:
    agree([factors(tiles=tiles, cosine=cosine)], ball(500))
    agree([images(tiles=tiles, cosine=cosine)], ball(500))


@pytest.mark.parametrize("rank", [0, 1, 7, 8, 17, 40])
def test_any_number_of_factors_agrees(rank: int) -> None:
    agree([factors(rank=rank)], ball(300))


@pytest.mark.parametrize("method", ["grid", "barycentric", "nearest4", "nearest"])
def test_images_agree(method: str) -> None:
    agree([images(method=method)], ball(500))


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
@pytest.mark.parametrize("order", [0, 1, 4, 6])
def test_harmonics_agree(kind: str, order: int) -> None:
    agree([harmonics(kind=kind, order=order)], ball(400))


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_harmonics_under_an_environment_agree(kind: str) -> None:
    rng = np.random.default_rng(4)
    around = 0.3 * rng.normal(size=(25, 3))
    around[0] += 3.0
    lights = Lights(TWO.direction, TWO.intensity, 1, around)
    agree([harmonics(kind=kind)], ball(200), lights=lights)
    alone = Lights(np.zeros((0, 3)), np.zeros((0, 3)), 0, around)
    agree([harmonics(kind=kind)], ball(200), lights=alone)


def test_a_constant_environment_is_the_integral_of_the_material() -> None:
    flat = harmonics(order=2, rank=0)
    value = np.sqrt(4 * np.pi)  # coefficient of radiance 1 everywhere
    around = Lights(np.zeros((0, 3)), np.zeros((0, 3)), 0, np.full((1, 3), value))
    found = radiance([flat], ball(50), EYE, around)
    wanted = value * flat.components[-1, 0] / np.pi
    assert np.allclose(found, wanted, rtol=1e-5)


@pytest.mark.parametrize("count", [8, 9, 10, 40])
def test_many_lights_agree(count: int) -> None:
    rng = np.random.default_rng(count)
    lights = directional(rng.normal(size=(count, 3)), rng.random((count, 3)) * 4 / count)
    for one in (factors(directions="6x3x6x3"), factors(directions="6x3x6x3", method="barycentric")):
        agree([one], ball(300), lights=lights)


def test_several_samples_and_bare_surfels_agree() -> None:
    materials: list[Material] = [
        factors(seed=1),
        images(seed=2),
        harmonics(seed=3),
        factors(method="nearest4"),
    ]
    agree(materials, ball(1500, samples=4, bare=True))


def test_shadows_positions_and_choice_agree() -> None:
    surfels = ball(900, samples=2)
    rng = np.random.default_rng(3)
    chosen = rng.integers(0, 900, 400)
    agree(
        [factors(), images()],
        surfels,
        chosen=chosen,
        position=surfels.position[chosen] + rng.normal(size=(400, 3)) * 0.01,
        visible=rng.random((2, 400)).astype(np.float32),
    )


def test_bits_depend_on_neither_threads_nor_neighbours() -> None:
    surfels = ball(9000, samples=3, bare=True)
    asked = Evaluator([factors(), images(), harmonics(order=2)])
    alone = asked.radiance(surfels, EYE, TWO)
    for threads in (2, 5):
        with ThreadPoolExecutor(threads) as pool:
            assert np.array_equal(alone, asked.radiance(surfels, EYE, TWO, pool=pool))
    some = np.random.default_rng(1).permutation(9000)[:777]
    assert np.array_equal(asked.radiance(surfels, EYE, TWO, some), alone[some])


def test_results_go_where_they_are_wanted() -> None:
    surfels, out = ball(100), np.full((100, 3), np.nan, np.float32)
    assert radiance([factors()], surfels, EYE, TWO, out=out) is out
    assert np.isfinite(out).all()
    assert len(radiance([factors()], surfels, EYE, TWO, np.zeros(0, np.int64))) == 0
    assert not radiance([factors()], surfels, EYE, NONE).any()


def test_hostile_frames_and_values_give_no_nan() -> None:
    surfels = ball(64)
    frame, position = surfels.frame.copy(), surfels.position.copy()
    frame[0], frame[1], frame[2, 1] = np.nan, 0, np.inf
    position[3], position[4] = EYE[:3], np.nan
    bad = Surfels(position, frame, surfels.source, surfels.sample)
    strong = directional([0.2, 0.1, 1.0], 1e30)
    every: tuple[Material, ...] = (
        *(factors(), images(), harmonics(), factors(method="barycentric")),
    )
    for one in every:
        for lights in (TWO, strong):
            found = radiance([one], bad, EYE, lights)
            assert np.isfinite(found).all()
            assert (found >= 0).all()
    lost = factors()
    weights = lost.weights.copy()
    weights[2:4] = np.nan
    found = radiance([replace(lost, weights=weights)], ball(500), EYE, TWO)
    assert np.isfinite(found).all()


def test_what_is_not_there_is_said() -> None:
    surfels = ball(10, samples=3)
    with pytest.raises(InvalidParameter, match="sample 2, 1 are given"):
        radiance([factors()], surfels, EYE, TWO)
    with pytest.raises(InvalidParameter, match="there are 10"):
        radiance([factors()] * 3, surfels, EYE, TWO, np.array([3, 10]))
    with pytest.raises(InvalidParameter, match="positions"):
        radiance([factors()] * 3, surfels, EYE, TWO, position=np.zeros((3, 3)))
    with pytest.raises(InvalidParameter, match="visibility"):
        radiance([factors()] * 3, surfels, EYE, TWO, visible=np.ones((1, 10), np.float32))
    with pytest.raises(InvalidParameter, match="results"):
        radiance([factors()] * 3, surfels, EYE, TWO, out=np.zeros((9, 3), np.float32))
