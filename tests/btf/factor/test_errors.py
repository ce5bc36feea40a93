"""Errors are what their definitions say, on all images, some, or texels left out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import correlate1d

from btfcore.btf.colour import LUMINANCE, linear_to_srgb
from btfcore.btf.factor.encoding import encode
from btfcore.btf.factor.errors import factor_errors, held_out_errors
from btfcore.btf.factor.heldout import TexelStack, held_out, projected
from btfcore.btf.factor.measure import spread
from btfcore.btf.factor.ssim import ssim, window
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import Encoding
from btfcore.btf.stack import ArrayStack
from btfcore.errors import Cancelled, InvalidBtf, InvalidParameter
from tests.btf.factor.sets import low_rank, material, rebuilt, sample_of


def defined_ssim(one, two):
    """Wang et al. 2004, equation 13, with windows wholly inside."""
    down, along = window(one.shape[0]), window(one.shape[1])

    def mean(values):
        values = correlate1d(correlate1d(values, down, axis=0), along, axis=1)
        low, left = len(down) // 2, len(along) // 2
        return values[low : len(values) - low, left : values.shape[1] - left]

    x, y = one.astype(np.float64), two.astype(np.float64)
    mx, my = mean(x), mean(y)
    vx, vy, cov = mean(x * x) - mx * mx, mean(y * y) - my * my, mean(x * y) - mx * my
    above = (2 * mx * my + 1e-4) * (2 * cov + 9e-4)
    return (above / ((mx * mx + my * my + 1e-4) * (vx + vy + 9e-4))).mean()


@pytest.mark.parametrize("size", [(30, 41), (11, 11), (12, 5), (1, 9), (2, 2), (1, 1)])
def test_ssim_is_the_definition_s(size):
    generator = np.random.default_rng(size[0])
    one = generator.random(size).astype(np.float32)
    two = np.clip(one + 0.1 * generator.standard_normal(size), 0, 1).astype(np.float32)
    assert ssim(one, two) == pytest.approx(defined_ssim(one, two), abs=1e-9)
    assert ssim(one, one) == pytest.approx(1, abs=1e-12)
    assert ssim(one, two) == pytest.approx(ssim(two, one), abs=1e-12)
    assert len(window(size[0])) % 2 == 1 and window(size[0]).sum() == pytest.approx(1)


def test_the_window_is_the_standard_one():
    at = np.arange(-5, 6)
    expected = np.exp(-(at**2) / 4.5)
    assert window(400) == pytest.approx(expected / expected.sum())
    with pytest.raises(InvalidParameter, match="shapes"):
        ssim(np.zeros((3, 3), np.float32), np.zeros((3, 4), np.float32))


@pytest.mark.parametrize("code", [Encoding("linear"), Encoding("log", 0.01), Encoding("sqrt")])
def test_figures_are_the_definitions(code):
    sample = material(14, shine=3)
    factors = factorize(sample, rank=6, encoding=code)
    found = factor_errors(sample, factors)
    own = sample.stack.read(np.arange(sample.images)).astype(np.float64)
    given = FactorStack(factors).read(np.arange(sample.images)).astype(np.float64)
    assert found.rel_l2 == pytest.approx(np.linalg.norm(own - given) / np.linalg.norm(own), 1e-5)
    coded = encode(own, code).reshape(sample.images, -1, 3).transpose(0, 2, 1).astype(np.float64)
    lost = np.linalg.norm(coded - rebuilt(factors)) / np.linalg.norm(coded)
    assert found.rel_l2_coded == pytest.approx(lost, 1e-5)
    one, two = linear_to_srgb(own).astype(np.float64), linear_to_srgb(given).astype(np.float64)
    rmse = np.sqrt(((one - two) ** 2).mean(axis=(1, 2, 3)))
    assert found.srgb_rmse == pytest.approx(rmse.mean(), 1e-5)
    assert found.srgb_rmse_worst == pytest.approx(rmse.max(), 1e-5)
    assert sample.index[found.worst] == np.argmax(rmse)
    similar = [defined_ssim(a @ LUMINANCE, b @ LUMINANCE) for a, b in zip(one, two, strict=True)]
    assert found.ssim == pytest.approx(np.mean(similar), abs=1e-5)
    assert found.ssim_worst == pytest.approx(np.min(similar), abs=1e-5)
    assert (found.rank, found.images) == (6, sample.images)


def test_more_factors_mean_smaller_errors():
    sample = material(16)
    factors = factorize(sample, rank=24)
    found = [factor_errors(sample, factors, rank=rank) for rank in (2, 8, 24)]
    assert [each.rank for each in found] == [2, 8, 24]
    for name, sign in (("rel_l2_coded", 1), ("srgb_rmse", 1), ("ssim", -1)):
        figures = [sign * getattr(each, name) for each in found]
        assert figures == sorted(figures, reverse=True)


def test_some_images_stand_for_all():
    sample = material(10)
    factors = factorize(sample, rank=6)
    whole = factor_errors(sample, factors)
    some = factor_errors(sample, factors, every=4, pictures=False)
    assert some.images == pytest.approx(sample.images / 4, abs=1)
    assert some.srgb_rmse == pytest.approx(whole.srgb_rmse, rel=0.2)
    assert np.isnan(some.ssim)
    for count, wanted in ((1, 1), (10, 10), (10, 99), (9216, 256), (22801, 300)):
        numbers = spread(count, wanted)
        assert len(numbers) >= 0.9 * min(count, wanted) and (np.diff(numbers) > 0).all()
        assert 0 <= numbers[0] and numbers[-1] < count
    lights = spread(9216, 256) % 96  # in step with the lights it would see few of them
    assert len(np.unique(lights)) > 80


def test_exact_factors_have_no_error():
    picture = sample_of(np.random.default_rng(0).random((1, 12, 13, 3)).astype(np.float32))
    found = factor_errors(picture, factorize(picture))
    assert found.rel_l2 < 1e-6 and found.srgb_rmse < 1e-6 and found.worst == (0, 0)
    assert found.ssim == pytest.approx(1, abs=1e-6)
    black = sample_of(np.zeros((5, 3, 3, 3), np.float32))
    assert factor_errors(black, factorize(black)).rel_l2 == 0


def test_what_does_not_fit_is_refused():
    sample = material(8)
    factors = factorize(sample, rank=3)
    with pytest.raises(InvalidBtf, match="material: factors of"):
        factor_errors(material(9), factors)
    with pytest.raises(InvalidParameter, match="rank 9"):
        factor_errors(sample, factors, rank=9)
    with pytest.raises(InvalidParameter, match="one image in 0"):
        factor_errors(sample, factors, every=0)

    def stop(fraction, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        factor_errors(sample, factors, progress=stop)


def test_whole_blocks_are_held_out():
    stay, out = held_out((40, 33), share=0.25, seed=0)
    assert np.array_equal(np.sort(np.concatenate([stay, out])), np.arange(40 * 33))
    mask = np.zeros(40 * 33, bool)
    mask[out] = True
    mask = mask.reshape(40, 33)[:, :32].reshape(5, 8, 4, 8)
    assert (mask.all(axis=(1, 3)) | ~mask.any(axis=(1, 3))).all()
    assert len(held_out((40, 32), share=0.25, seed=0)[1]) == 40 * 32 / 4
    for shape, share in (((8, 8), 0.25), ((40, 40), 0.0), ((40, 40), 1.0)):
        with pytest.raises(InvalidParameter, match="hold out"):
            held_out(shape, share=share, seed=0)


def test_texels_held_out_of_an_exact_rank_are_met_exactly():
    sample = sample_of(low_rank(4, 30, 24, 24))
    found = held_out_errors(sample, rank=6, encoding=Encoding("linear"))
    assert found.rel_l2 < 1e-5 and found.srgb_rmse < 1e-5 and np.isnan(found.ssim)


def test_texels_held_out_are_met_less_well_than_those_that_stayed():
    sample = material(32)
    code = Encoding("sqrt")
    inside = factor_errors(sample, factorize(sample, rank=10, encoding=code))
    found = held_out_errors(sample, rank=10, encoding=code)
    assert inside.srgb_rmse < found.srgb_rmse < 3 * inside.srgb_rmse
    assert found.rank == 10 and found.images == sample.images
    with pytest.raises(InvalidBtf, match="one image"):
        held_out_errors(sample_of(np.ones((1, 32, 32, 3), np.float32)))


def test_projecting_a_sample_on_its_own_basis_gives_its_weights():
    sample = material(12)
    factors = factorize(sample, rank=9, encoding="sqrt", passes=4)
    again = projected(sample, factors)
    assert again.weights == pytest.approx(factors.weights, abs=2e-4 * factors.singular[0])
    some = TexelStack(sample.stack, np.array([5, 0, 77]))
    assert some.shape == (sample.images, 1, 3)
    part = projected(replace(sample, stack=some), factors).weights[0]
    assert part == pytest.approx(again.weights.reshape(-1, 9)[[5, 0, 77]], abs=1e-5)


def test_flawed_images_are_compared_as_they_are_read():
    images = low_rank(3, 20)
    images[0, 0, 0, 0], images[1, 1, 1, 1] = np.nan, -2
    sample = replace(sample_of(images), stack=ArrayStack(images))
    assert np.isfinite(factor_errors(sample, factorize(sample, rank=5)).rel_l2)
