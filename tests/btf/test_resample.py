"""Factors under other directions: exact at own ones, off by about what is foretold between."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.directions import rings
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.svd import factorize
from btfcore.btf.interpolation.radiance import picture
from btfcore.btf.joint import common_channels
from btfcore.btf.resample import blend, expected_error, resample, same_images
from btfcore.btf.sample import BtfSample, Encoding, full_index, subset
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidBtf

LINEAR = Encoding("linear")


def table(*counts, last=75.0, turn=0.0):
    """Rings of directions from the normal to `last` degrees; `turn` in radians."""
    step = last / max(len(counts) - 1, 1)
    return rings([(ring * step, count, np.degrees(turn)) for ring, count in enumerate(counts)])


def glossy(name, views, lights, *, power=6.0, seed=0, size=(12, 13), encoding=LINEAR, rank=12):
    """A diffuse pattern with a broad lobe, factorised: smooth in its directions."""
    random = np.random.default_rng(seed)
    half = views[:, None] + lights[None]
    half /= np.linalg.norm(half, axis=2, keepdims=True)
    diffuse = np.broadcast_to(lights[None, :, 2], half.shape[:2]).ravel()
    lobe = (half[..., 2] ** power).ravel()
    colour, gloss = random.random((*size, 3)), random.random(size)
    images = diffuse[:, None, None, None] * colour
    images = images + (lobe[:, None, None] * gloss)[..., None]
    sample = BtfSample(
        name, ArrayStack(images.astype(np.float32)), views, lights,
        full_index(len(views), len(lights)),
    )  # fmt: skip
    return replace(sample, factors=factorize(sample, rank=rank, encoding=encoding))


def images(factors):
    """All images of linearly coded factors, less their means: (N, J 3) f8."""
    weights = factors.weights.reshape(-1, factors.rank).astype(np.float64)
    return weights @ factors.basis.reshape(-1, factors.rank).T.astype(np.float64)


FINE = table(1, 8, 12, 16, 16)
COARSE = table(1, 6, 9, last=60.0, turn=0.2)


def test_images_are_those_that_the_interpolation_gives():
    sample = glossy("fine", FINE, FINE)
    like = glossy("coarse", COARSE, COARSE, seed=1)
    onto = blend(sample, like)
    found = resample(sample, onto)
    assert not onto.exact and found.basis.shape[:2] == (len(COARSE) ** 2, 3)
    stack = FactorStack(found)
    source = replace(sample, stack=FactorStack(sample.factors))
    for number in (0, 37, 120, 255):
        view, light = like.pairs()[number]
        true = picture(source, COARSE[view], COARSE[light])
        assert stack.read([number])[0] == pytest.approx(true, abs=1e-5)
    basis = found.basis.reshape(-1, found.rank).astype(np.float64)
    assert np.abs(basis.T @ basis - np.eye(found.rank)).max() < 1e-5
    gram = found.weights.reshape(-1, found.rank).astype(np.float64)
    gram = gram.T @ gram
    assert np.allclose(gram, np.diag(found.singular**2), atol=1e-5 * gram.max())


@pytest.mark.parametrize("power", [4.0, 20.0])
def test_the_error_is_about_as_foretold(power):
    sample = glossy("fine", FINE, FINE, power=power)
    true = glossy("true", COARSE, COARSE, power=power)
    onto = blend(sample, true)
    found, wanted = images(resample(sample, onto)), images(true.factors)
    error = np.sqrt(((found - wanted) ** 2).sum() / (wanted**2).sum())
    assert error / 2.5 < expected_error(sample, onto) < 2.5 * error
    assert error < 0.12


def test_a_subset_of_the_directions_is_exact():
    sample = glossy("all", FINE, FINE)
    like = subset(sample, np.arange(0, len(FINE), 3), np.arange(5, 40))
    onto = blend(sample, like)
    assert onto.exact and expected_error(sample, onto) == 0.0
    assert images(resample(sample, onto)) == pytest.approx(images(like.factors), abs=1e-4)
    _, notes = common_channels([like, sample])
    assert notes == ()


def test_other_directions_and_another_encoding_still_share_a_space():
    sample = glossy("fine", FINE, FINE, encoding=Encoding("log", 0.05), seed=3, rank=20)
    like = glossy("coarse", COARSE, COARSE, seed=4, encoding=Encoding("sqrt"), rank=20)
    true = glossy("true", COARSE, COARSE, seed=3, encoding=Encoding("sqrt"), rank=20)
    (one, two), notes = common_channels([like, sample])
    assert len(notes) == 1 and notes[0].startswith("fine has other directions than coarse")
    (_, best), none = common_channels([like, true])
    assert none == () and one.channels.shape[2] > 3
    apart = [
        np.linalg.norm(one.channels[:, :, None, None] - each.channels[None, None], axis=-1)
        if each.channels.shape == one.channels.shape
        else np.linalg.norm(
            padded(one, each)[:, :, None, None] - padded(each, one)[None, None], axis=-1
        )
        for each in (two, best)
    ]
    assert np.sqrt(((apart[0] - apart[1]) ** 2).mean()) < 0.06 * apart[1].mean()


def padded(one, other):
    more = max(other.channels.shape[2] - one.channels.shape[2], 0)
    return np.pad(one.channels, ((0, 0), (0, 0), (0, more)))


def test_what_lies_just_outside_takes_the_border_and_what_lies_further_is_refused():
    sample = glossy("short", table(1, 8, 12, last=50.0), FINE)
    near = glossy("near", table(1, 8, 12, last=54.0), FINE, seed=1)
    assert blend(sample, near).spread[0] > 0
    far = glossy("far", table(1, 8, 12, last=57.0), FINE, seed=1)
    with pytest.raises(InvalidBtf, match="12 of 21 view directions lie up to 7 degrees beyond"):
        blend(sample, far)


def test_lacking_images_are_named():
    sample = glossy("holes", FINE, FINE)
    kept = np.setdiff1d(np.arange(sample.images), [0, 5])
    index = np.full(sample.index.shape, -1, np.int32)
    pairs = sample.pairs()[kept]
    index[pairs[:, 0], pairs[:, 1]] = np.arange(len(kept))
    holes = replace(sample, stack=ArrayStack(sample.stack.images[kept]), index=index, factors=None)
    assert not same_images(sample, holes)
    with pytest.raises(InvalidBtf, match="holes lacks the images near 2 of all's"):
        blend(holes, replace(sample, name="all"))
    # the other way round all that is asked for is there
    assert blend(sample, holes).exact


def test_the_error_is_unknown_where_no_direction_can_be_left_out():
    views = table(1, 3, last=40.0)
    sample = glossy("few", views, FINE)
    like = glossy("like", table(1, 3, last=20.0), FINE, seed=1)
    triangle = replace(sample, views=views[1:], index=full_index(3, len(FINE)),
        stack=ArrayStack(sample.stack.images[len(FINE):]), factors=None)  # fmt: skip
    triangle = replace(triangle, factors=factorize(triangle, rank=5, encoding=LINEAR))
    assert np.isnan(expected_error(triangle, blend(triangle, like)))
    _, notes = common_channels([like, triangle])
    assert "unknown part of its contrast" in notes[0]
