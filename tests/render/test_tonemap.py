"""What the display shows: every code where it belongs, no curve ever falls, nothing breaks it."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.render.tonemap import CURVES, develop, displayed, toned


def grey(values):
    return np.repeat(np.asarray(values, np.float32)[:, None], 3, axis=1)


def all_floats(count=200_000):
    """Floats over all magnitudes, and their neighbours around every code's limit."""
    spread = np.geomspace(1e-38, 1e38, count)
    coded = (np.arange(0, 255, dtype=np.float64) + 0.5) / 255
    limits = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    near = [limits * (1 + k * 2.0**-23) for k in range(-40, 41)]
    return np.sort(np.concatenate([spread, *near]).astype(np.float32))


def test_every_code_comes_back():
    codes = np.arange(256, dtype=np.uint8)
    assert np.array_equal(develop(grey(srgb_to_linear(codes)))[:, 0], codes)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [0.0, 3.7, -2.2])
def test_codes_are_the_rounded_float_output(curve, exposure):
    values = grey(all_floats())
    codes = develop(values, exposure, curve)
    exact = displayed(values, exposure, curve).astype(np.float64) * 255
    assert np.abs(codes - exact).max() <= 0.5 + 1e-4
    assert set(np.unique(codes)) == set(range(256))


def test_clip_is_srgb_as_it_is():
    values = np.random.default_rng(0).uniform(-0.2, 1.3, (5000, 3)).astype(np.float32)
    plain = np.rint(linear_to_srgb(values) * 255).astype(int)
    difference = np.abs(develop(values) - plain)
    assert difference.max() <= 1 and (difference > 0).mean() < 1e-3
    assert np.array_equal(displayed(values), linear_to_srgb(values))


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("white", [0.01, 1.0, 4.0, 1e6])
def test_no_curve_falls(curve, white):
    values = all_floats()
    for out in (
        develop(grey(values), 0.3, curve, white=white)[:, 0].astype(int),
        toned(values, curve, white=white),
    ):
        assert (np.diff(out) >= 0).all()
        assert out[0] == 0 or out[0] < 1e-9


def test_curves_are_what_they_say():
    x = np.array([0.0, 0.18, 1.0, 4.0, 100.0])
    assert np.allclose(toned(x), np.minimum(x, 1))
    assert np.allclose(toned(x, "reinhard", white=4), np.minimum(x * (1 + x / 16) / (1 + x), 1))
    assert toned(np.array([4.0]), "reinhard", white=4)[0] == pytest.approx(1)
    fit = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    assert np.allclose(toned(x, "filmic"), np.minimum(fit, 1))


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("exposure", [0.0, 1e6, -1e6, 100.0, -100.0])
def test_nothing_breaks_it(curve, exposure):
    wild = [np.nan, -np.nan, np.inf, -np.inf, -1.0, -0.0, 0.0, 1e-45, 3e38, -3e38]
    values = grey(wild)
    codes = develop(values, exposure, curve)[:, 0]
    floats = displayed(values, exposure, curve)
    assert np.isfinite(floats).all() and floats.min() >= 0 and floats.max() <= 1
    assert np.abs(codes - floats[:, 0] * 255.0).max() <= 0.5 + 1e-4
    dark = np.array([True, True, False, True, True, True, True])
    assert (codes[:7][dark] == 0).all()
    assert codes[2] == 255


def test_exposure_is_in_stops():
    values = np.random.default_rng(0).uniform(0, 0.1, (1000, 3)).astype(np.float32)
    assert np.array_equal(develop(values, 3), develop(values * 8))


def test_it_fills_what_it_is_given_by_parts():
    values = np.random.default_rng(0).gamma(1, 0.5, (999, 3)).astype(np.float32)
    whole = develop(values, 0.5, "filmic")
    picture = np.full((999, 4), 77, np.uint8)
    parts = [slice(start, start + 100) for start in range(0, 999, 100)]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda s: develop(values[s], 0.5, "filmic", out=picture[s]), parts))
    assert np.array_equal(picture[:, :3], whole)
    assert (picture[:, 3] == 77).all()
    image = values[:990].reshape(33, 30, 3)
    assert np.array_equal(develop(image, 0.5, "filmic"), whole[:990].reshape(33, 30, 3))


def test_wrong_knobs_are_named():
    values = np.zeros((2, 3), np.float32)
    with pytest.raises(InvalidParameter, match="curve 'aces'"):
        develop(values, 0, "aces")
    with pytest.raises(InvalidParameter, match="exposure of nan"):
        displayed(values, np.nan)
    with pytest.raises(InvalidParameter, match="white point of 0"):
        develop(values, 0, "reinhard", white=0)
    with pytest.raises(InvalidParameter, match=r"\(2, 2\)"):
        develop(values[:, :2])
    with pytest.raises(InvalidParameter, match="do not fit"):
        develop(values, out=np.zeros((3, 3), np.uint8))
