"""The kernels agree with numpy, and the number of threads changes no bit."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.harmonics.errors import TABLE
from btfcore.btf.harmonics.kernels import add_errors, shade
from btfcore.btf.harmonics.linear import PART, gram, product, svd

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("rows, inner, columns", [(1, 1, 1), (5, 7, 300), (4, 8, PART + 3)])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_product(rows, inner, columns, kind):
    matrix, right = RNG.normal(size=(rows, inner)), RNG.normal(size=(inner, columns)).astype(kind)
    expected = matrix @ right.astype(np.float64)
    np.testing.assert_allclose(product(matrix, right), expected, atol=1e-13)
    start = np.ones((rows, columns))
    assert product(matrix, right, out=start) is start
    np.testing.assert_allclose(start, expected + 1, atol=1e-13)


@pytest.mark.parametrize("size, columns", [(1, 1), (6, 9), (11, 2 * PART + 5)])
def test_gram(size, columns):
    right = RNG.normal(size=(size, columns))
    np.testing.assert_allclose(gram(right), right @ right.T, rtol=1e-11, atol=1e-9)


def test_threads_change_no_bit():
    matrix, right = RNG.normal(size=(9, 13)), RNG.normal(size=(13, 3 * PART + 100))
    with ThreadPoolExecutor(3) as pool:
        np.testing.assert_array_equal(product(matrix, right, pool=pool), product(matrix, right))
        np.testing.assert_array_equal(gram(right, pool=pool), gram(right))


@pytest.mark.parametrize("rows, columns", [(30, 12), (5, 9), (1, 1), (40, 40)])
def test_svd(rows, columns):
    matrix = RNG.normal(size=(rows, columns))
    left, singular, right = svd(matrix)
    few = min(rows, columns)
    np.testing.assert_allclose((left * singular) @ right.T, matrix, atol=1e-13)
    np.testing.assert_allclose(right.T @ right, np.eye(columns), atol=1e-13)
    np.testing.assert_allclose(left[:, :few].T @ left[:, :few], np.eye(few), atol=1e-12)
    expected = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose(singular[:few], expected, atol=1e-13)
    assert (np.abs(singular[few:]) < 1e-13).all()
    assert (right[np.abs(right).argmax(axis=0), np.arange(columns)] > 0).all()


def test_svd_of_nearly_nothing():
    _, singular, right = svd(np.zeros((4, 3)))
    assert (singular == 0).all() and (right == np.eye(3)).all()
    steep = np.diag([1.0, 1e-9, 1e-20])[:, ::-1]
    np.testing.assert_allclose(svd(steep)[1], [1, 1e-9, 1e-20], rtol=1e-12)


def test_shade():
    weights = RNG.normal(size=(6, 4)).astype(np.float32)
    colours, mean = RNG.normal(size=(4, 3)), RNG.normal(size=3)
    out = np.empty((6, 3), np.float32)
    shade(weights, colours, mean, out)
    np.testing.assert_allclose(out, np.maximum(mean + weights @ colours, 0), atol=1e-6)
    assert (out == 0).any()


def test_error_sums():
    truth = RNG.uniform(0, 1.3, 500).astype(np.float32)
    series, final = truth + RNG.normal(0, 0.1, 500), truth + RNG.normal(0, 0.2, 500)
    sums = np.zeros(6)
    add_errors(truth, series, final, TABLE, sums)
    first, one, two = (
        linear_to_srgb(values).astype(np.float64) for values in (truth, series, final)
    )
    expected = [
        (truth.astype(np.float64) ** 2).sum(),
        ((truth - series) ** 2).sum(),
        ((series - final) ** 2).sum(),
        ((truth - final) ** 2).sum(),
        ((first - one) ** 2).sum(),
        ((first - two) ** 2).sum(),
    ]
    np.testing.assert_allclose(sums, expected, rtol=1e-5)


def test_straight_pieces_follow_the_srgb_curve():
    values = np.linspace(0, 1.2, 30001).astype(np.float32)
    sums = np.zeros((len(values), 6))
    for value, row in zip(values, sums, strict=True):
        add_errors(np.array([value]), np.zeros(1), np.zeros(1), TABLE, row)
    coded = np.sqrt(sums[:, 4])
    np.testing.assert_allclose(coded, linear_to_srgb(values), atol=2e-6)
