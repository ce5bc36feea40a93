"""Factors are the best there are, or all there are, for every BTF however odd."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.btf.factor.encoding import EPSILON, NAMES, encode
from btfcore.btf.factor.optimum import optimal_errors
from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.factor.svd import factorize
from btfcore.btf.materialize import flaws
from btfcore.btf.sample import BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import Cancelled, InvalidParameter
from tests.btf.factor.sets import low_rank, material, rebuilt, sample_of, spiral

LINEAR = Encoding("linear")


class Dear:
    """A stack that counts how often each image is read."""

    dear = True

    def __init__(self, stack):
        self.stack, self.shape = stack, stack.shape
        self.reads = np.zeros(self.shape[0], int)

    def read(self, numbers):
        self.reads[np.asarray(numbers)] += 1
        return self.stack.read(numbers)


def coded(sample, code):
    """Coded values (J, 3, N) f8 of a sample."""
    images = sample.stack.read(np.arange(sample.images))
    flat = encode(images, code).reshape(sample.images, -1, 3)
    return flat.transpose(0, 2, 1).astype(np.float64)


def check(sample, factors):
    """What holds for all factors; returns their relative error, measured."""
    height, width = sample.shape
    rank = factors.rank
    assert factors.weights.shape == (height, width, rank)
    assert factors.basis.shape == (sample.images, 3, rank)
    assert factors.mean.shape == (sample.images, 3)
    assert factors.singular.shape == (rank,)
    for part in (factors.weights, factors.basis, factors.mean):
        assert part.dtype == np.float32 and not part.flags.writeable
        assert np.isfinite(part).all()
    basis = factors.basis.reshape(3 * sample.images, rank).astype(np.float64)
    assert np.abs(basis.T @ basis - np.eye(rank)).max(initial=0) < 1e-4
    assert (np.diff(factors.singular) <= 0).all() and (factors.singular >= 0).all()
    maps = factors.weights.reshape(height * width, rank).astype(np.float64)
    assert np.linalg.norm(maps, axis=0) == pytest.approx(factors.singular, rel=1e-4)
    values = coded(sample, factors.encoding)
    lost = np.linalg.norm(values - rebuilt(factors))
    error = lost / max(np.linalg.norm(values), 1e-300)
    assert factors.error == pytest.approx(error, rel=2e-3, abs=1e-4)
    return error


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("rank", [3, 16])
def test_the_error_is_the_optimum_s(name, rank):
    sample = material(18)
    code = Encoding(name, 0.03)
    factors = factorize(sample, rank=rank, encoding=code, oversample=16)
    assert rank == factors.rank
    assert check(sample, factors) <= 1.01 * optimal_errors(sample, [rank], code)[0]


@pytest.mark.parametrize("shape", [(40, 12, 10), (300, 5, 5), (12, 20, 25), (4, 2, 3)])
def test_an_exact_rank_is_found_exactly(shape):
    rank = min(4, shape[1] * shape[2] - 1)
    sample = sample_of(low_rank(rank, *shape))
    factors = factorize(sample, rank=10, encoding=LINEAR, oversample=5)
    assert factors.rank >= rank
    assert check(sample, factors) < 1e-6
    assert factors.singular[rank:].sum() < 1e-4 * factors.singular[0]


def test_a_small_sample_is_factorised_exactly():
    for shape in ((50, 6, 7), (9, 30, 31)):  # fewer texels, fewer images
        images = np.random.default_rng(0).gamma(2, 0.2, (*shape, 3)).astype(np.float32)
        sample = sample_of(images)
        factors = factorize(sample, rank=12, encoding=LINEAR, passes=1)
        assert check(sample, factors) == pytest.approx(
            optimal_errors(sample, [12], LINEAR)[0], rel=1e-5
        )


def test_more_passes_and_columns_never_harm():
    sample = material(24)
    errors = [
        factorize(sample, rank=10, encoding=LINEAR, oversample=over, passes=passes).error
        for over, passes in ((2, 1), (2, 2), (2, 4), (20, 4))
    ]
    assert errors == sorted(errors, reverse=True)


def test_a_rank_beyond_the_sample_s_gives_all_there_is():
    sample = material(4)
    factors = factorize(sample, rank=500)
    assert factors.rank <= 16
    assert check(sample, factors) < 1e-4
    assert factorize(sample, rank=500, oversample=0).rank == factors.rank


def test_a_flat_sample_has_no_factors():
    images = np.random.default_rng(1).gamma(2, 0.2, (30, 1, 1, 3)).astype(np.float32)
    sample = sample_of(np.broadcast_to(images, (30, 8, 9, 3)).copy())
    factors = factorize(sample, rank=5)
    assert factors.rank == 0
    assert check(sample, factors) < 1e-6
    given = FactorStack(factors).read([3])[0]
    assert given == pytest.approx(sample.stack.read([3])[0], rel=1e-5)


def test_one_texel_and_black_ones():
    one = sample_of(np.random.default_rng(2).random((25, 1, 1, 3)).astype(np.float32))
    assert factorize(one, rank=5).rank == 0
    assert check(one, factorize(one)) < 1e-6
    black = sample_of(np.zeros((30, 6, 6, 3), np.float32))
    for name in NAMES:
        factors = factorize(black, encoding=name)
        assert factors.rank == 0 and factors.error == 0
        # log(ε) is rounded, so that its exponential is not quite ε
        assert FactorStack(factors).read([0]).max() < 1e-7


def test_rank_one():
    generator = np.random.default_rng(3)
    maps, angular = generator.random(120), generator.random((60, 3))
    values = (maps[None, :, None] * angular[:, None, :]).reshape(60, 10, 12, 3)
    sample = sample_of(values.astype(np.float32))
    factors = factorize(sample, encoding=LINEAR)
    assert factors.singular[0] > 0 and factors.singular[1:].sum() < 1e-4 * factors.singular[0]
    assert check(sample, factors) < 1e-6
    pattern = factors.weights[:, :, 0].ravel()
    assert abs(np.corrcoef(pattern, maps)[0, 1]) == pytest.approx(1, abs=1e-6)


def test_one_image_comes_back_exactly_and_unasked():
    picture = np.random.default_rng(4).random((1, 9, 11, 3)).astype(np.float32)
    sample = sample_of(picture)
    for name in NAMES:
        factors = factorize(sample, rank=1, encoding=name)
        assert factors.rank == 3
        assert check(sample, factors) < 1e-6
        assert FactorStack(factors).read([0]) == pytest.approx(picture, abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_saturated_highlights_drown_nothing_but_in_linear(name):
    clean = material(16)
    images = clean.stack.images.copy()
    generator = np.random.default_rng(5)
    images.reshape(-1)[generator.integers(0, images.size, 40)] = 1e6
    sample = replace(clean, stack=ArrayStack(images, sound=True))
    factors = factorize(sample, rank=20, encoding=name, oversample=20)
    check(sample, factors)
    assert np.isfinite(FactorStack(factors).read(np.arange(sample.images))).all()
    best = optimal_errors(sample, [20], factors.encoding)[0]
    assert factors.error <= 1.01 * best + 1e-6
    if name == "linear":
        assert factors.encoding.knee is not None


def test_automatic_encoding_follows_the_highlights():
    dull, shiny = material(12, shine=0.1), material(12, shine=60, roughness=0.2)
    assert factorize(dull, rank=4).encoding == Encoding("sqrt", EPSILON)
    assert factorize(shiny, rank=4).encoding == Encoding("log", EPSILON)
    assert factorize(shiny, rank=4, encoding="sqrt").encoding.knee is not None
    assert factorize(shiny, rank=4, encoding="sqrt", knee=None).encoding.knee is None
    assert factorize(dull, rank=4, encoding="sqrt", knee=0.7).encoding.knee == 0.7
    given = Encoding("logluma", 0.01, 3.0)
    assert factorize(dull, rank=4, encoding=given).encoding == given


def test_half_floats_subnormals_and_flaws_are_taken_as_they_are_read():
    generator = np.random.default_rng(6)
    images = generator.gamma(2, 0.2, (40, 7, 8, 3)).astype(np.float16)
    images[3, 2, 2] = np.float16(6e-8)
    images[4, 0, 0, 0], images[5, 1, 1, 1], images[6, 2, 2, 2] = np.nan, np.inf, -1
    images[7, 0, 0] = 65504
    stack = ArrayStack(images, scale=generator.uniform(1, 50, 40).astype(np.float32))
    sample = replace(sample_of(np.ones((40, 7, 8, 3), np.float32)), stack=stack)
    assert flaws(stack).total == 3
    for name in NAMES:
        check(sample, factorize(sample, rank=12, encoding=name))


def test_missing_images_and_a_single_ring():
    images = low_rank(5, 10, noise=0.05)
    index = full_index(3, 4)
    index[1, 2] = index[2, 3] = -1
    index[index >= 0] = np.arange(10)
    sample = BtfSample("holes", ArrayStack(images), spiral(3), spiral(4), index)
    factors = factorize(sample, rank=6)
    assert check(sample, factors) < 0.2
    whole = factorize(sample_of(images), rank=6)
    assert np.array_equal(factors.weights, whole.weights)


def test_the_greatest_weight_of_every_factor_is_positive():
    sample = material(16)
    for seed in range(3):
        factors = factorize(sample, rank=12, seed=seed)
        maps = factors.weights.reshape(-1, factors.rank)
        place = np.argmax(np.abs(maps), axis=0)
        assert (maps[place, np.arange(factors.rank)] > 0).all()
    # so that other random numbers lead to the same factors, where these are well apart
    other = factorize(sample, rank=12, seed=7, passes=4)
    assert np.abs(other.weights[:, :, :3] - factors.weights[:, :, :3]).max() < 1e-2


def test_blocks_and_memory_change_nothing_that_matters():
    sample = material(40)  # needs several blocks under the smaller bound
    ample = factorize(sample, rank=10, oversample=10)
    tight = factorize(sample, rank=10, oversample=10, memory_mb=36)
    assert tight.error == pytest.approx(ample.error, rel=1e-4)
    assert np.array_equal(
        tight.weights, factorize(sample, rank=10, oversample=10, memory_mb=36).weights
    )


def test_a_dear_stack_is_read_once():
    sample = material(40)
    for memory in (36, 2048):
        stack = Dear(sample.stack)
        factors = factorize(
            replace(sample, stack=stack), rank=10, oversample=10, memory_mb=memory, encoding=LINEAR
        )
        assert (stack.reads == 1).all()
        plain = factorize(sample, rank=10, oversample=10, memory_mb=memory, encoding=LINEAR)
        assert np.array_equal(factors.weights, plain.weights)


def test_a_dear_stack_is_read_again_where_the_disk_is_full(monkeypatch):
    from btfcore.btf.factor import blocks

    written = []

    class Full(blocks.Spool):
        def __init__(self):
            super().__init__()
            real = self._file

            class File:
                def write(self, data):
                    if len(written) >= 2:
                        raise OSError(28, "No space left on device")
                    written.append(len(data))
                    return real.write(data)

                truncate, seek, readinto = real.truncate, real.seek, real.readinto

            self._file = File()

    monkeypatch.setattr(blocks, "Spool", Full)
    sample = material(40)
    stack = Dear(sample.stack)
    factors = factorize(
        replace(sample, stack=stack), rank=10, oversample=10, memory_mb=36, encoding=LINEAR
    )
    assert len(written) == 2 and stack.reads.min() == 1 and stack.reads.max() > 1
    plain = factorize(sample, rank=10, oversample=10, memory_mb=36, encoding=LINEAR)
    assert np.array_equal(factors.weights, plain.weights)


def test_progress_runs_forward_and_can_cancel():
    sample = material(40)
    seen = []
    factorize(sample, rank=4, oversample=4, memory_mb=34, progress=lambda f, label: seen.append(f))
    assert seen == sorted(seen) and seen[-1] == 1 and seen[0] < 0.3 and len(seen) > 5

    def stop(fraction, label):
        if fraction > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        factorize(sample, rank=4, progress=stop)


@pytest.mark.parametrize(
    ("knobs", "what"),
    [
        ({"rank": 0}, "rank 0"),
        ({"rank": -3}, "rank -3"),
        ({"rank": 2.5}, "rank 2.5"),
        ({"rank": "many"}, "rank many"),
        ({"rank": float("nan")}, "rank nan"),
        ({"seed": -1}, "seed of -1"),
        ({"oversample": -1}, "-1 columns"),
        ({"passes": 0}, "0 passes"),
        ({"rank": "auto", "rmse": 0.0}, "RMSE of 0.0"),
        ({"encoding": "zip"}, "'zip'"),
        ({"knee": "high"}, "'high'"),
        ({"knee": -2.0}, "knee of -2"),
        ({"memory_mb": 3}, "3 MiB of memory"),
        ({"memory_mb": float("nan")}, "nan MiB of memory"),
    ],
)
def test_useless_knobs_are_refused_with_their_numbers(knobs, what):
    with pytest.raises(InvalidParameter, match=what):
        factorize(material(6), **knobs)
