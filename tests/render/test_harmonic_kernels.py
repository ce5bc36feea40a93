"""The basis in compiled code against `evaluate`, and the laws of turned environments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.harmonics.basis import evaluate, functions
from btfcore.render.evaluate import radiance
from btfcore.render.harmonic_kernels import NOWHERE, basis_into, environment, harmonic_tables
from btfcore.render.lights import NONE, Lights, directional
from btfcore.render.surfels import Surfels
from btfcore.types import F8
from tests.render.scenes import EYE, FAR, ball, harmonics


def sky(coefficients: F8) -> Lights:
    return Lights(np.zeros((0, 3)), np.zeros((0, 3)), 0, coefficients)


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
@pytest.mark.parametrize("order", range(7))
def test_the_basis_is_that_of_the_fit(kind: str, order: int) -> None:
    made = harmonic_tables(harmonics(order=order, kind=kind))
    directions = np.random.default_rng(order).normal(size=(50, 3))
    directions[0], directions[1] = (0, 0, 1), (1, 0, 0)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    wanted = evaluate(directions, order, kind)
    for direction, row in zip(directions, wanted, strict=True):
        found = np.full(made.terms, 9, np.float32)
        basis_into(direction[0], direction[1], direction[2], made, found)
        assert np.allclose(found[: functions(order)], row, atol=2e-6)
        assert (found[functions(order) :] == 9).all()


def test_turning_surface_and_environment_together_changes_nothing() -> None:
    one, order = harmonics(order=3), 3
    rng = np.random.default_rng(5)
    around = 0.2 * rng.normal(size=(functions(order), 3))
    around[0] += 4
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn = turn.astype(np.float64) * np.sign(np.linalg.det(turn))
    # coefficients of the turned environment, by least squares over many directions
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    values = evaluate(directions @ turn, order) @ around
    turned: F8 = np.linalg.lstsq(evaluate(directions, order), values, rcond=None)[0].astype(float)
    surfels = ball(60)
    frame = (surfels.frame.astype(np.float64) @ turn.T).astype(np.float32)
    moved = Surfels(surfels.position, frame, surfels.source, surfels.sample)
    eye = np.concatenate([turn @ FAR[:3], [0]])
    before = radiance([one], surfels, FAR, sky(around))
    after = radiance([one], moved, eye, sky(turned))
    assert before.mean() > 0.1
    assert np.allclose(before, after, atol=2e-5)


def test_degrees_beyond_the_material_do_not_matter_to_it() -> None:
    one = harmonics(order=2)
    around = np.random.default_rng(6).normal(size=(49, 3))
    around[0] += 9
    full = radiance([one], ball(40), EYE, sky(around))
    assert np.allclose(full, radiance([one], ball(40), EYE, sky(around[:9].copy())), atol=1e-6)


def test_sampled_lights_give_way_to_coefficients() -> None:
    one = harmonics(order=2)
    around = np.zeros((9, 3))
    around[0] = 2.0
    lamp = directional([0, 0.6, 0.8])
    both = Lights(
        np.concatenate([lamp.direction, lamp.direction]),
        np.concatenate([lamp.intensity, 5 * lamp.intensity]), 1, around,
    )  # fmt: skip
    alone = replace(
        both, direction=lamp.direction.copy(), intensity=lamp.intensity.copy(), sampled=0
    )
    surfels = ball(50)
    assert np.array_equal(radiance([one], surfels, EYE, both), radiance([one], surfels, EYE, alone))
    assert environment(NONE, harmonic_tables(one)) is NOWHERE
