"""Factors give back images, all or the first few of them."""

import numpy as np
import pytest

from btfcore.btf.factor.encoding import decode
from btfcore.btf.factor.optimum import optimal_errors
from btfcore.btf.factor.stack import FactorStack, truncated
from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import Encoding
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidBtf, InvalidParameter
from tests.btf.bricks import factors as random_factors
from tests.btf.factor.sets import material, rebuilt


@pytest.mark.parametrize("name", ["linear", "sqrt", "log"])
def test_images_are_the_decoded_sums(name):
    factors = random_factors(count=7, height=40, width=31, rank=5, encoding=Encoding(name))
    stack = FactorStack(factors)
    assert isinstance(stack, ImageStack) and stack.shape == (7, 40, 31) and stack.dear
    expected = decode(rebuilt(factors).transpose(0, 2, 1).reshape(7, 40, 31, 3), factors.encoding)
    images = stack.read([4, 0, 4])
    assert images.dtype == np.float32
    assert images == pytest.approx(expected[[4, 0, 4]], rel=1e-4, abs=1e-5)
    assert np.array_equal(images[0], images[2])
    assert stack.read([]).shape == (0, 40, 31, 3)


def test_a_prefix_is_the_best_of_its_rank():
    sample = material(20)
    code = Encoding("sqrt")
    factors = factorize(sample, rank=20, encoding=code, passes=3)
    best = optimal_errors(sample, [5, 20], code)
    few = truncated(factors, 5)
    assert few.rank == 5 and few.weights.flags.c_contiguous
    assert few.error == pytest.approx(best[0], rel=0.01)
    assert truncated(factors, 20).error == pytest.approx(factors.error, rel=1e-12)
    one, two = FactorStack(few).planes(9), FactorStack(factors).planes(9, rank=5)
    assert np.array_equal(one, two)


def test_what_does_not_fit_is_refused():
    factors = random_factors(rank=4)
    for rank in (0, 5):
        with pytest.raises(InvalidParameter, match=f"rank {rank} of 4"):
            truncated(factors, rank)
    from dataclasses import replace

    with pytest.raises(InvalidBtf, match="basis"):
        FactorStack(replace(factors, basis=factors.basis[:, :, :2]))
    with pytest.raises(InvalidBtf, match="mean"):
        FactorStack(replace(factors, mean=factors.mean[:3]))
    with pytest.raises(InvalidParameter, match="'cube'"):
        FactorStack(replace(factors, encoding=Encoding("cube")))
