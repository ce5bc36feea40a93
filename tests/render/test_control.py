"""Contraction at control points: exact where view and light are constant, near elsewhere."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.control import ControlEvaluator, ControlPoints, control_points
from btfcore.render.evaluate import Evaluator
from btfcore.render.lights import NONE, directional
from btfcore.render.material import Material
from btfcore.render.surfels import BARE, Surfels
from btfcore.types import F8
from tests.render.decorated import Scene, scene
from tests.render.scenes import factors, gap, harmonics, images

EYE = np.array([0.3, 0.4, 2.5, 1.0])
TWO = directional([[0.5, 0.5, 0.7], [-0.6, 0.2, 0.3]], [[1.0, 0.9, 0.8], [0.3, 0.2, 0.5]])


def made(here: Scene, midpoints: bool = False) -> ControlPoints:
    return control_points(
        here.prepared.mesh, here.prepared.dense, here.quilt, here.surfels, here.place,
        midpoints=midpoints,
    )  # fmt: skip


@pytest.mark.parametrize("midpoints", [False, True])
def test_shares_bring_the_points_back_to_the_surfels(midpoints: bool) -> None:
    here = scene()
    control = made(here, midpoints)
    assert (control.share >= 0).all()
    assert np.allclose(control.share.sum(axis=1), 1, atol=1e-6)
    place: F8 = np.einsum("nk,nkc->nc", control.share, control.surfels.position[control.corner])
    assert np.abs(place - here.surfels.position).max() < 1e-5
    frame = control.surfels.frame.astype(np.float64)
    assert np.allclose(np.einsum("nij,nkj->nik", frame, frame), np.eye(3), atol=1e-5)


def test_midpoints_are_nearer_to_the_truth_than_vertices() -> None:
    here = scene()
    smooth = factors(directions="12x8x12x8")
    # values that change with the direction as a lobe does, not from node to node
    views, lights = smooth.views.directions, smooth.lights.directions
    lobe = 1 + views @ lights.T
    table = np.zeros_like(smooth.table)
    table[: len(views), : len(lights)] = 0.2 * lobe[:, :, None, None]
    table[len(views) :] = table[: len(views)].mean(axis=0)
    table[:, len(lights) :] = table[:, : len(lights)].mean(axis=1, keepdims=True)
    full = Evaluator([replace(smooth, table=table)])
    truth = full.radiance(here.surfels, EYE, TWO)
    errors = [
        gap(ControlEvaluator(full, made(here, fine)).radiance(here.surfels, EYE, TWO), truth)[0]
        for fine in (False, True)
    ]
    assert errors[0] < 0.02
    assert errors[1] < 0.6 * errors[0]


def test_it_is_exact_where_every_surfel_is_a_control_point() -> None:
    here, count = scene(), 500
    own = here.surfels
    some = Surfels(
        own.position[:count].copy(), own.frame[:count].copy(), own.source[:count].copy(),
        own.sample[:count].copy(),
    )  # fmt: skip
    corner = np.repeat(np.arange(count, dtype=np.int32)[:, None], 3, axis=1)
    share = np.tile(np.array([0.5, 0.25, 0.25], np.float32), (count, 1))
    full = Evaluator([factors(rank=17)])
    exact = full.radiance(some, EYE, TWO)
    near = ControlEvaluator(full, ControlPoints(some, corner, share)).radiance(some, EYE, TWO)
    assert exact.max() > 0.1
    assert gap(near, exact)[1] < 1e-4


def test_other_materials_and_bare_surfels_are_evaluated_in_full() -> None:
    here = scene()
    sample = (here.quilt.patch % 3).astype(np.uint16)
    sample[::7] = BARE
    mixed = replace(here.surfels, sample=sample)
    materials: list[Material] = [images(), harmonics(order=2), factors()]
    full = Evaluator(materials)
    near = ControlEvaluator(full, made(replace(here, surfels=mixed)))
    chosen = np.arange(0, len(mixed), 3)
    exact = full.radiance(mixed, EYE, TWO, chosen)
    found = near.radiance(mixed, EYE, TWO, chosen)
    same = sample[chosen] != 2
    assert np.array_equal(found[same], exact[same])
    assert not np.array_equal(found[~same], exact[~same])


def test_shadows_lie_where_they_lie_in_full() -> None:
    here = scene()
    full = Evaluator([factors()])
    near = ControlEvaluator(full, made(here))
    one = directional([0.5, 0.5, 0.7])
    exact, found = (each.radiance(here.surfels, EYE, one) for each in (full, near))
    dark = here.surfels.frame[:, 2] @ one.direction[0] <= 0
    assert dark.any()
    assert not found[dark].any()
    assert not exact[dark].any()
    shade = np.zeros((1, len(here.surfels)), np.float32)
    assert not near.radiance(here.surfels, EYE, one, visible=shade).any()
    assert not near.radiance(here.surfels, EYE, NONE).any()


def test_bits_do_not_depend_on_threads() -> None:
    here = scene()
    near = ControlEvaluator(Evaluator([factors()]), made(here, True))
    alone = near.radiance(here.surfels, EYE, TWO)
    with ThreadPoolExecutor(3) as pool:
        assert np.array_equal(alone, near.radiance(here.surfels, EYE, TWO, pool=pool))
    some = np.arange(5, len(here.surfels), 2)
    assert np.array_equal(near.radiance(here.surfels, EYE, TWO, some), alone[some])


def test_points_of_another_surface_are_refused() -> None:
    here, other = scene(), scene("open_box.obj")
    near = ControlEvaluator(Evaluator([factors()]), made(here))
    with pytest.raises(InvalidParameter, match="control points of"):
        near.radiance(other.surfels, EYE, TWO)
    with pytest.raises(InvalidParameter, match="a quilt of"):
        made(replace(here, quilt=other.quilt))
