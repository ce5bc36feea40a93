"""Samples in one space of channels: distances across samples are those of the coded images."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf import joint
from btfcore.btf.appearance import quilting_sample
from btfcore.btf.factor.encoding import encode
from btfcore.btf.factor.svd import factorize
from btfcore.btf.joint import common_channels
from btfcore.btf.sample import BtfSample, Encoding, from_picture, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidBtf, InvalidParameter

SQRT = Encoding("sqrt", 0.01)


def directions(count, tilt=0.0):
    angle = 2 * np.pi * np.arange(count) / count
    polar = np.radians(np.linspace(10 + tilt, 60 + tilt, count))
    return np.stack(
        [np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)], axis=1
    )


def small(name, seed, size=(14, 17), parts=4, views=5, lights=6, tilt=0.0, **details):
    """BTF whose images are mixtures of a few patterns, each its own."""
    random = np.random.default_rng(seed)
    maps = random.random((*size, parts))
    mix = random.random((parts, views * lights, 3)) ** 2
    images = np.einsum("hwp,pjc->jhwc", maps, mix).astype(np.float32)
    return BtfSample(
        name, ArrayStack(images), directions(views, tilt), directions(lights, tilt + 1),
        full_index(views, lights), **details,
    )  # fmt: skip


def factorised(sample, rank=200, encoding=SQRT):
    return replace(sample, factors=factorize(sample, rank=rank, encoding=encoding))


def coded(sample, encoding=SQRT):
    """All coded images as rows of texels, (H W, J 3) f8."""
    images = encode(sample.stack.read(np.arange(sample.images)), encoding).astype(np.float64)
    return np.moveaxis(images, 0, 2).reshape(-1, sample.images * 3)


def rebuilt(sample):
    """What a sample's factors make of its coded images, (H W, J 3) f8."""
    factors = sample.factors
    weights = factors.weights.reshape(-1, factors.rank).astype(np.float64)
    basis = factors.basis.reshape(-1, factors.rank).astype(np.float64)
    return weights @ basis.T + factors.mean.reshape(-1)


def pairwise(one, two):
    return np.sqrt(((one[:, None] - two[None]) ** 2).sum(axis=2))


def texels(sample):
    return sample.channels.reshape(-1, sample.channels.shape[2]).astype(np.float64)


def all_errors(samples, ready, images=coded):
    """Largest error of any distance between two texels, over the largest distance."""
    worst = 0.0
    for a in range(len(samples)):
        for b in range(a, len(samples)):
            true = pairwise(images(samples[a]), images(samples[b])) / np.sqrt(samples[a].images)
            found = pairwise(texels(ready[a]), texels(ready[b]))
            worst = max(worst, float(np.abs(found - true).max() / true.max()))
    return worst


def test_distances_between_any_two_texels_are_those_of_the_coded_images(monkeypatch):
    samples = [
        factorised(small("one", 1)),
        factorised(small("two", 2, size=(9, 11))),
        factorised(small("three", 3, size=(8, 8), parts=2)),
    ]
    ready, notes = common_channels(samples)
    assert notes == () and len({each.channels.shape[2] for each in ready}) == 1
    # what is left out carries less than 0.1 % of the variance, direction by direction
    assert all_errors(samples, ready) < 0.02
    monkeypatch.setattr(joint, "LEAST", 0.0)
    exact, _ = common_channels(samples)
    assert exact[0].channels.shape[2] > ready[0].channels.shape[2]
    assert all_errors(samples, exact, rebuilt) < 1e-5
    assert all_errors(samples, exact) < 1e-3


def test_only_the_mean_may_set_two_samples_apart():
    one = factorised(small("one", 1))
    brighter = small("brighter", 1)
    images = (np.sqrt(brighter.stack.images) + 0.2) ** 2
    two = factorised(replace(brighter, stack=ArrayStack(images.astype(np.float32))))
    ready, _ = common_channels([one, two])
    step = texels(ready[1]) - texels(ready[0])
    assert np.linalg.norm(step, axis=1) == pytest.approx(0.2 * np.sqrt(3), rel=1e-3)


def assert_prefixes(samples):
    """A sample's channels are the same bits whatever follows it, but for zeros behind them."""
    before = [common_channels(samples[: count + 1])[0] for count in range(len(samples))]
    assert np.array_equal(before[0][0].channels, quilting_sample(samples[0]).channels)
    for fewer, more in zip(before, before[1:], strict=False):
        for one, two in zip(fewer, more, strict=False):
            count = one.channels.shape[2]
            assert two.channels[..., :count].tobytes() == one.channels.tobytes()
            assert not two.channels[..., count:].any()


def test_samples_keep_their_channels_when_others_are_added():
    assert_prefixes([factorised(small(str(seed), seed)) for seed in range(4)])


def test_the_same_sample_twice_needs_no_further_channel():
    sample = factorised(small("one", 1))
    ready, _ = common_channels([sample, replace(sample, name="again")])
    assert ready[0].channels.shape == quilting_sample(sample).channels.shape
    assert np.abs(ready[0].channels - ready[1].channels).max() < 1e-6


def test_samples_without_factors_get_the_others_encoding():
    log = Encoding("log", 0.02)
    samples = [small("plain", 1), factorised(small("coded", 2), encoding=log)]
    ready, notes = common_channels(samples)
    assert notes == ()
    true = pairwise(coded(samples[0], log), coded(samples[1], log)) / np.sqrt(30)
    assert np.abs(pairwise(texels(ready[0]), texels(ready[1])) - true).max() < 0.03 * true.max()


def test_epsilon_matters_only_where_codes_depend_on_it():
    one = factorised(small("one", 1), encoding=Encoding("sqrt", 0.01))
    two = factorised(small("two", 2), encoding=Encoding("sqrt", 0.03))
    assert common_channels([one, two])[1] == ()
    same = factorised(small("two", 2), encoding=Encoding("sqrt", 0.01))
    assert np.array_equal(
        common_channels([one, two])[0][1].channels, common_channels([one, same])[0][1].channels
    )
    # the logarithms' differ, and so the second has to be coded anew
    one = factorised(small("one", 1), encoding=Encoding("log", 0.01))
    two = factorised(small("two", 2), encoding=Encoding("log", 0.3))
    ready, _ = common_channels([one, two])
    assert all_errors([one, two], ready, lambda each: coded(each, Encoding("log", 0.01))) < 0.03


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (SQRT, Encoding("log", 0.01)),
        (Encoding("log", 0.03), SQRT),
        (SQRT, Encoding("sqrt", 0.01, knee=0.3)),
    ],
)
def test_distances_of_samples_of_two_encodings_are_those_in_the_first_ones(first, second):
    samples = [
        factorised(small("one", 1), encoding=first),
        factorised(small("two", 2, size=(9, 11)), encoding=second),
    ]
    ready, notes = common_channels(samples)
    assert notes == () and ready[0].channels.shape[2] > 3
    assert all_errors(samples, ready, lambda each: coded(each, first)) < 0.03


def test_samples_of_other_encodings_leave_those_before_them_alone():
    codes = [SQRT, Encoding("log", 0.01), SQRT, Encoding("log", 0.1)]
    samples = [factorised(small(str(k), k), encoding=code, rank=12) for k, code in enumerate(codes)]
    assert_prefixes(samples)


def nudged(sample, angle):
    """The sample with its directions turned about the normal."""
    turn = np.array([
        [np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]
    ])  # fmt: skip
    return replace(sample, views=sample.views @ turn.T, lights=sample.lights @ turn.T)


def test_directions_off_by_less_than_a_thousandth_are_the_same():
    one, two = factorised(small("one", 1)), factorised(small("two", 2))
    exact, _ = common_channels([one, two])
    near, notes = common_channels([one, nudged(two, 9.9e-4)])
    assert notes == () and near[1].channels.tobytes() == exact[1].channels.tobytes()
    _, notes = common_channels([one, nudged(two, 0.02)])
    assert len(notes) == 1 and "other directions" in notes[0] and "% of its contrast" in notes[0]


def test_the_same_images_in_another_order_are_matched_up():
    one, two = factorised(small("one", 1)), factorised(small("two", 2))
    order = np.random.default_rng(0).permutation(two.images)
    back = np.argsort(order).astype(np.int32)
    factors = replace(two.factors, basis=two.factors.basis[order], mean=two.factors.mean[order])
    mixed = replace(
        two, stack=ArrayStack(two.stack.images[order]), index=back[two.index], factors=factors
    )
    ready, notes = common_channels([one, mixed])
    assert notes == ()
    assert all_errors([one, two], ready) < 0.02


def missing():
    sample = small("holes", 4)
    index = sample.index.copy()
    index[0, 0], index[index > 0] = -1, index[index > 0] - 1
    return replace(sample, stack=ArrayStack(sample.stack.images[1:]), index=index)


@pytest.mark.parametrize(
    ("other", "why"),
    [
        (
            lambda: small("steep", 2, tilt=-9.0),
            "4 of 5 view directions lie up to 9 degrees beyond those of steep",
        ),
        (lambda: small("few", 2, lights=3), "6 light directions lie up to"),
        (lambda: from_picture("photo", np.ones((6, 6, 3), np.uint8)), "photo is a picture, one"),
        (missing, "holes lacks the images near 1 of one's"),
        (lambda: small("bare", 2, cosine=False), "the light's cosine"),
    ],
)
def test_what_cannot_be_compared_falls_back_to_colours(other, why):
    two = other()
    ready, notes = common_channels([factorised(small("one", 1)), two])
    assert len(notes) == 1 and why in notes[0] and "colours" in notes[0]
    for each in ready:
        assert np.array_equal(each.channels, each.colour) and each.channels.shape[2] == 3
    assert ready[1].channels.shape[:2] == two.shape


def test_pictures_have_their_colours_and_no_note():
    random = np.random.default_rng(0)
    pictures = [
        from_picture("a", random.random((5, 6, 3)).astype(np.float32)),
        from_picture("b", random.random((7, 4, 3)).astype(np.float32)),
    ]
    ready, notes = common_channels(pictures)
    assert notes == ()
    for picture, each in zip(pictures, ready, strict=True):
        assert np.array_equal(each.channels, quilting_sample(picture).channels)


def test_masks_and_names_are_handed_on():
    mask = np.zeros((14, 17), np.float32)
    mask[3:8, 4:9] = 1
    one = factorised(small("one", 1))
    two = factorised(replace(small("two", 2), mask=mask, tiles=True))
    ready, _ = common_channels([one, two])
    assert ready[0].mask is None and np.array_equal(ready[1].mask, mask) and ready[1].tiles
    assert [each.name for each in ready] == ["one", "two"]
    assert np.array_equal(quilting_sample(two).mask, mask)


def test_nothing_and_uniform_samples_are_refused():
    with pytest.raises(InvalidParameter, match="no sample"):
        common_channels([])
    even = small("even", 1)
    even = replace(even, stack=ArrayStack(np.full_like(even.stack.images, 0.5)))
    with pytest.raises(InvalidBtf, match="even: it looks the same everywhere"):
        common_channels([factorised(small("one", 1)), even])
