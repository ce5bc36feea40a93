"""Codes of radiance can be undone, never leave the finite numbers, and keep their order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from btfcore.btf.colour import LUMINANCE, linear_to_srgb
from btfcore.btf.factor.elementary import exp_into, log_into, srgb_in_place
from btfcore.btf.factor.encoding import NAMES, decode, encode
from btfcore.btf.sample import Encoding
from btfcore.errors import InvalidParameter

CODES = [
    Encoding(name, 0.03 if knee else 1e-3, knee) for name in NAMES for knee in (None, 1.0, 0.2)
]
IDS = [f"{code.name}-{code.epsilon}-{code.knee}" for code in CODES]
few = settings(max_examples=40)
SPECIAL = np.array([0, 1e-45, 1e-39, 1e-20, 1e-6, 0.2, 1, 65504, 1e6], np.float32)
radiances = arrays(
    np.float32, (7, 3), elements=st.floats(0, np.float32(1e6), width=32, allow_subnormal=True)
)


def twin(radiance, code):
    """What `encode` says that it does, in f8."""
    x = radiance.astype(np.float64)
    if code.knee is not None:
        above = np.maximum(x, code.knee)
        x = np.where(x > code.knee, code.knee * (1 + np.log(above / code.knee)), x)
    if code.name == "sqrt":
        return np.sqrt(x)
    if code.name == "log":
        return np.log(x + code.epsilon)
    if code.name == "logluma":
        y = x @ LUMINANCE + code.epsilon
        shares = (x[..., ::2] + code.epsilon) / y[..., None]
        return np.concatenate([np.log(y)[..., None], shares], axis=-1)
    return x


def tolerance(radiance, code):
    """The precision to which `decode` claims to undo `encode`."""
    x = radiance.astype(np.float64)
    value = {
        "linear": x,
        "sqrt": x,
        "log": x + code.epsilon,
        "logluma": x.max(axis=-1, keepdims=True) + code.epsilon,
    }[code.name]
    bend = 1.0 if code.knee is None else 1 + np.log(np.maximum(x.max() / code.knee, 1))
    return 2e-6 * value * bend * (1 + np.log1p(bend)) + 1e-37


@pytest.mark.parametrize("code", CODES, ids=IDS)
@few
@given(radiance=radiances)
def test_decoding_undoes_encoding(code, radiance):
    coded = encode(radiance, code)
    assert coded.dtype == np.float32 and np.isfinite(coded).all()
    assert (np.abs(decode(coded, code) - radiance) <= tolerance(radiance, code)).all()


@pytest.mark.parametrize("code", CODES, ids=IDS)
def test_a_plain_twin_gives_the_same_codes(code):
    generator = np.random.default_rng(3)
    radiance = np.exp(generator.uniform(-12, 13, (500, 3))).astype(np.float32)
    expected = twin(radiance, code)
    assert np.abs(encode(radiance, code) - expected).max() <= 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize("code", CODES, ids=IDS)
def test_extremes_stay_finite_and_grey_keeps_its_order(code):
    grey = np.repeat(SPECIAL[:, None], 3, axis=1)
    coded = encode(grey, code)
    assert np.isfinite(coded).all()
    assert (np.diff(coded[:, 0]) >= 0).all()
    back = decode(coded, code)
    assert (np.abs(back - grey) <= tolerance(grey, code)).all()
    assert np.array_equal(encode(np.empty((0, 3), np.float32), code), np.empty((0, 3)))


@pytest.mark.parametrize("code", CODES, ids=IDS)
@few
@given(coded=arrays(np.float32, (5, 3), elements=st.floats(width=32, allow_nan=False,
                                                           allow_infinity=False)))  # fmt: skip
def test_any_codes_decode_to_radiance(code, coded):
    radiance = decode(coded, code)
    assert np.isfinite(radiance).all() and (radiance >= 0).all()


def test_the_knee_bends_without_a_break():
    code = Encoding("linear", knee=0.5)
    x = np.repeat(np.float32([0.5 - 1e-3, 0.5, 0.5 + 1e-3])[:, None], 3, axis=1)
    low, middle, high = encode(x, code)[:, 0]
    assert middle == np.float32(0.5)
    assert (high - middle) == pytest.approx(middle - low, rel=5e-3)
    assert encode(np.full((1, 3), 500, np.float32), code)[0, 0] < 5


def test_the_elementary_functions_are_those_of_numpy():
    generator = np.random.default_rng(0)
    x = np.exp(generator.uniform(-80, 85, 100_000)).astype(np.float32)
    out = np.empty_like(x)
    log_into(x, out)
    exact = np.log(x.astype(np.float64))
    assert (np.abs(out - exact) <= 2 * np.spacing(np.abs(exact).astype(np.float32))).all()
    y = generator.uniform(-86, 88, 100_000).astype(np.float32)
    exp_into(y, out)
    assert (np.abs(out / np.exp(y.astype(np.float64)) - 1) <= 3e-7).all()
    exp_into(np.float32([-1e30, 1e30]), out)
    assert out[0] < 1e-37 and 1e38 < out[1] < np.inf
    z = np.concatenate([np.linspace(-0.5, 1.5, 10_000), SPECIAL]).astype(np.float32)
    coded = z.copy()
    srgb_in_place(coded)
    assert np.abs(coded - linear_to_srgb(z)).max() < 5e-7


@pytest.mark.parametrize(
    ("code", "what"),
    [
        (Encoding("gamma"), "'gamma'"),
        (Encoding("log", 0.0), "epsilon of 0.0"),
        (Encoding("log", float("nan")), "epsilon of nan"),
        (Encoding("sqrt", knee=-1.0), "knee of -1.0"),
        (Encoding("sqrt", knee=0.0), "knee of 0.0"),
    ],
)
def test_useless_codes_are_refused(code, what):
    with pytest.raises(InvalidParameter, match=what):
        encode(np.ones((1, 3), np.float32), code)
    with pytest.raises(InvalidParameter, match=what):
        decode(np.ones((1, 3), np.float32), code)
    with pytest.raises(InvalidParameter, match="shape"):
        encode(np.ones((3, 4), np.float32), Encoding())
