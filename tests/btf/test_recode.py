"""Factors in another code: as good as factorising all decoded images, from parts of them."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf import recode as module
from btfcore.btf.appearance import frontal_colours
from btfcore.btf.factor import svd
from btfcore.btf.factor.encoding import encode
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.svd import factorize
from btfcore.btf.recode import recode
from btfcore.btf.sample import BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidBtf, InvalidParameter

SQRT, LOG, KNEE = Encoding("sqrt", 0.01), Encoding("log", 0.01), Encoding("sqrt", 0.01, knee=0.3)


def directions(count):
    angle = 2.4 * np.arange(count)
    polar = np.radians(np.linspace(0, 70, count))
    return np.stack(
        [np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)], axis=1
    )


def glossy(encoding, *, size=(40, 44), views=9, lights=10, rank=12, seed=0, spot=0):
    """A diffuse pattern with a lobe of varying gloss, factorised; `spot`: texels of another."""
    random = np.random.default_rng(seed)
    view, light = directions(views), directions(lights)
    half = view[:, None] + light[None]
    half /= np.linalg.norm(half, axis=2, keepdims=True)
    diffuse = np.broadcast_to(light[None, :, 2], (views, lights)).ravel()
    lobe = (half[..., 2] ** 30).ravel()
    colour, gloss = random.random((*size, 3)), random.random(size)
    images = diffuse[:, None, None, None] * colour
    images = images + (4 * lobe[:, None, None] * gloss**3)[..., None]
    if spot:
        flat = images.reshape(len(images), -1, 3)
        flat[:, 500 : 500 + spot] = random.random((len(images), 1, 3))
    sample = BtfSample(
        "glossy", ArrayStack(images.astype(np.float32)), view, light, full_index(views, lights)
    )
    factors = factorize(sample, rank=rank, encoding=encoding)
    return replace(sample, stack=FactorStack(factors), factors=factors)


def rows(sample, encoding):
    """All images that the factors give, coded as told: (N, J 3) f8."""
    images = encode(FactorStack(sample.factors).read(np.arange(sample.images)), encoding)
    return np.moveaxis(images.astype(np.float64), 0, 2).reshape(-1, 3 * sample.images)


def rebuilt(factors):
    weights = factors.weights.reshape(-1, factors.rank).astype(np.float64)
    basis = factors.basis.reshape(-1, factors.rank).astype(np.float64)
    return weights @ basis.T + factors.mean.reshape(-1)


def distances(values, seed=1):
    one, two = np.random.default_rng(seed).integers(0, len(values), (2, 4000))
    return np.sqrt(((values[one] - values[two]) ** 2).sum(axis=1))


def off(found, true):
    """RMS error of distances over their RMS, at the best common scale."""
    found = found * (found @ true) / (found @ found)
    return np.sqrt(((found - true) ** 2).mean() / (true**2).mean())


@pytest.mark.parametrize(("old", "new"), [(LOG, SQRT), (SQRT, LOG), (SQRT, KNEE), (KNEE, LOG)])
def test_distances_are_those_of_all_images_decoded_and_coded_anew(monkeypatch, old, new):
    sample = glossy(old)
    true = distances(rows(sample, new))
    colours = frontal_colours(sample).reshape(-1, 3).astype(np.float64)
    fallback = off(distances(colours), true)
    monkeypatch.setattr(module, "TEXELS", 400)
    monkeypatch.setattr(module, "IMAGES", 45)
    found = recode(sample, new, rank=20)
    error = distances(rebuilt(found)) - true
    assert found.encoding == new and found.rank <= 20
    assert np.sqrt((error**2).mean() / (true**2).mean()) < min(0.01, 0.1 * fallback)
    # near the best factors of all, from a quarter of the texels and half of the images
    best = factorize(sample, rank=20, encoding=new)
    lost = [((rebuilt(each) - rows(sample, new)) ** 2).sum() for each in (found, best)]
    assert lost[0] < 2 * lost[1]


def test_the_factors_are_principal_and_orthonormal_and_the_mean_is_that_of_all_texels(monkeypatch):
    sample = glossy(LOG)
    monkeypatch.setattr(module, "TEXELS", 300)
    found = recode(sample, SQRT, rank=15)
    basis = found.basis.reshape(-1, found.rank).astype(np.float64)
    weights = found.weights.reshape(-1, found.rank).astype(np.float64)
    assert np.abs(basis.T @ basis - np.eye(found.rank)).max() < 1e-5
    gram = weights.T @ weights
    assert np.allclose(gram, np.diag(found.singular**2), atol=1e-5 * gram.max())
    assert np.all(np.diff(found.singular) <= 0)
    assert np.abs(weights.mean(axis=0)).max() < 1e-5 * np.abs(weights).max()
    assert np.abs(found.mean.ravel() - rows(sample, SQRT).mean(axis=0)).max() < 0.01


def test_weights_are_the_least_squares_solution_over_the_chosen_images(monkeypatch):
    sample = glossy(LOG)
    monkeypatch.setattr(module, "TEXELS", 300)
    monkeypatch.setattr(module, "IMAGES", 40)
    found = recode(sample, SQRT, rank=10)
    # the choice depends on the functions before they are turned, so take any that are near
    functions = found.basis.reshape(-1, found.rank).astype(np.float64)
    true = rows(sample, SQRT) - found.mean.reshape(-1)
    plain = np.linalg.lstsq(functions, true.T, rcond=None)[0].T
    weights = found.weights.reshape(-1, found.rank)
    assert np.abs(weights - plain).max() < 0.02 * np.abs(plain).max()


def test_a_sample_of_few_texels_has_the_factors_of_all_its_images():
    sample = glossy(LOG, size=(20, 30))
    found = recode(sample, SQRT, rank=15)
    best = factorize(sample, rank=15, encoding=SQRT, oversample=24)
    assert np.array_equal(found.weights, best.weights) and np.array_equal(found.basis, best.basis)


def test_choices_are_even_where_nothing_stands_out_and_keep_what_does():
    share = np.ones(10_000)
    chosen, counts = module._drawn(share, 500)
    assert np.array_equal(chosen // 20, np.arange(500)) and counts == pytest.approx(20)
    share[777] = 1e4
    chosen, counts = module._drawn(share, 500)
    assert 777 in chosen and len(np.unique(chosen)) == len(chosen) <= 500
    assert counts @ share[chosen] == pytest.approx(share.sum(), rel=0.1)
    assert np.array_equal(module._drawn(share, 20_000)[0], np.arange(10_000))


def test_a_small_feature_is_not_lost(monkeypatch):
    sample = glossy(LOG, size=(60, 60), spot=5)
    monkeypatch.setattr(module, "TEXELS", 200)
    found = recode(sample, SQRT)
    true, made = rows(sample, SQRT), rebuilt(found)
    apart = [np.linalg.norm(each[500:505] - each[2000:2005], axis=1) for each in (true, made)]
    assert apart[1] == pytest.approx(apart[0], rel=0.02)


def test_any_number_of_threads_gives_the_same_bits(monkeypatch):
    sample = glossy(LOG)
    monkeypatch.setattr(module, "TEXELS", 300)
    monkeypatch.setattr(module, "IMAGES", 60)
    found = []
    for count in (1, 5):
        monkeypatch.setattr(module, "cores", lambda count=count: count)
        monkeypatch.setattr(svd, "cores", lambda count=count: count)
        found.append(recode(sample, SQRT))
    for field in ("weights", "basis", "mean"):
        assert getattr(found[0], field).tobytes() == getattr(found[1], field).tobytes()


def test_not_all_values_are_ever_held():
    sample = glossy(LOG, size=(16, 16), views=40, lights=40)
    large = np.tile(sample.factors.weights, (9, 9, 1))  # 144²
    factors = replace(sample.factors, weights=large)
    sample = replace(sample, stack=FactorStack(factors), factors=factors)
    recode(glossy(LOG), SQRT)  # compiled now
    tracemalloc.start()
    recode(sample, SQRT)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.4 * sample.images * large.shape[0] * large.shape[1] * 12


def test_bad_input_is_refused():
    sample = glossy(LOG, size=(8, 8))
    with pytest.raises(InvalidParameter, match="glossy: it has no factors"):
        recode(replace(sample, factors=None), SQRT)
    with pytest.raises(InvalidParameter, match="encoding 'cube'"):
        recode(sample, Encoding("cube"))
    dark = replace(sample.factors, mean=sample.factors.mean - 90)
    with pytest.raises(InvalidBtf, match="glossy: coded as sqrt it looks the same everywhere"):
        recode(replace(sample, stack=FactorStack(dark), factors=dark), SQRT)
