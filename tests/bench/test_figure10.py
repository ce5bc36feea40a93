"""The pictures of painting: what figure 10 says holds, and both pages can be made."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from PIL import Image

from btfcore.paint.constrained import energy
from tests.bench import figure10, painted_picture
from tests.bench.figure10 import WAYS, Figures, Trial, painted_bricks, said

RATE = 256


@cache
def sample():
    return painted_bricks()


@cache
def results() -> dict[str, Figures]:
    trial = Trial(sample(), rate=RATE)
    half = RATE / figure10.RATE  # the pattern has so many times fewer steps
    return {way.name: trial.run(replace(way, zone=half * way.zone))[1] for way in WAYS}


def test_bricks_are_painted_whole():
    """Every painted texel is feature; the mask has blue bricks alone, and half their joints."""
    colour, mask = sample().colour, sample().mask
    assert 0.1 < (mask > 0.5).mean() < 0.4
    blue = colour[..., 2] > colour[..., 0] + 0.15
    assert (mask[blue] > 0.4).all()
    assert (blue & (mask > 0.5)).sum() > 0.7 * (mask > 0.5).sum()
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    assert border.max() == 0


def test_the_zone_breaks_less_than_what_is_abrupt():
    abrupt, strict, small, zone = (results()[way.name] for way in WAYS)
    assert zone.near < 0.8 * abrupt.near < abrupt.near < strict.near
    assert zone.per_edge < abrupt.per_edge
    assert strict.D < abrupt.D


def test_a_small_weight_leaves_background_in_the_area():
    abrupt, strict, small, zone = (results()[way.name] for way in WAYS)
    assert small.reached < min(abrupt.reached, strict.reached) - 0.05
    assert small.D > 2 * abrupt.D and small.V < abrupt.V
    assert zone.reached > 0.75


def test_figures_are_what_is_on_the_surface():
    trial = Trial(sample(), rate=RATE)
    engine = trial.document.engine
    target = trial.target(0.0)
    before = energy(engine.net, engine.state, engine.palette, 0, target)
    colours, figures = trial.run(WAYS[0])
    assert colours.shape == (len(target), 3)
    assert figures.E == pytest.approx(0.5 * figures.D + figures.V)
    assert figures.V_before == pytest.approx(before.smooth)
    assert figures.D < before.constraint
    assert figures.E < 0.5 * before.constraint + before.smooth
    again = energy(engine.net, engine.state, engine.palette, 0, target)
    assert again == before  # the surface is as it was
    text = said(figures)
    assert f"{figures.D:.0f}" in text and f"{figures.near_before:.0f}" in text


def test_the_page_can_be_made(tmp_path, monkeypatch):
    monkeypatch.setattr(figure10, "RATE", RATE)
    monkeypatch.setattr(figure10, "Trial", lambda each: Trial(each, rate=RATE))
    monkeypatch.setattr(figure10, "painted_bricks", sample)
    figure10.main([str(tmp_path / "page.jpg")])
    page = Image.open(tmp_path / "page.jpg")
    assert page.width > 1600 and page.height > 800
    assert np.asarray(page).std() > 20


def test_a_line_on_the_picture_lies_on_the_side_that_is_seen():
    piece = painted_picture.PIECES[0]
    prepared = figure10.prepare(
        figure10.load_mesh(figure10.found(piece.mesh))[0], rate=96
    )  # fmt: skip
    points, normals = painted_picture.on_surface(prepared, piece.view, piece.lines[0])
    assert (normals @ piece.view.axes()[2] > 0.2).all()
    dense = prepared.dense
    apart = np.linalg.norm(points[:, None] - dense.vertices[None], axis=2).min(axis=1)
    assert apart.max() == 0
    jumps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert jumps.max() < 12 * dense.step


def test_a_piece_is_painted():
    before, after, told = painted_picture.panels(painted_picture.PIECES[0], rate=192)
    assert before.shape == after.shape == (*painted_picture.PANEL[::-1], 3)
    changed = (np.abs(before.astype(int) - after).max(axis=2) > 12)[:, 120:]
    assert 0.01 < changed.mean() < 0.5
    assert told.startswith("vase.obj cracked-brick.btfz: reached")
