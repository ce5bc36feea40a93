"""The products of blocks are those of plain numpy, whatever the sizes."""

import numpy as np
import pytest

from btfcore.btf.factor.blocks import strips
from btfcore.btf.factor.encoding import encode, knobs
from btfcore.btf.factor.kernels import LANES, combine, down, fill, sketch, up
from btfcore.btf.factor.symmetric import add_gram, eigen, product, turned, whitening
from btfcore.btf.sample import Encoding

SIZES = [(1, 1, 1), (7, 31, 3), (5, 32, 8), (90, 33, 17), (200, 300, 80)]


def block(images, texels, *, seed=0):
    """Random images (n, N, 3), their tiles, and them as a plain matrix (m, N) with its means."""
    generator = np.random.default_rng(seed)
    pixels = generator.gamma(2, 0.3, (images, texels, 3)).astype(np.float32)
    code = Encoding("sqrt")
    tiles = np.full((-(-texels // LANES), -(-3 * images // 4) * 4, LANES), 9, np.float32)
    tiles[:, 3 * images :] = 0
    mean = np.zeros(tiles.shape[1], np.float32)
    energy = np.array([fill(pixels[j], tiles, 3 * j, *knobs(code), mean) for j in range(images)])
    plain = encode(pixels, code).transpose(0, 2, 1).reshape(3 * images, texels)
    return tiles, mean[: 3 * images], energy.sum(axis=0), plain.astype(np.float64)


def flat(tiles, images, texels):
    return tiles.transpose(1, 0, 2).reshape(tiles.shape[1], -1)[: 3 * images, :texels]


@pytest.mark.parametrize(("images", "texels", "width"), SIZES)
def test_a_block_is_coded_and_centred(images, texels, width):
    tiles, mean, energy, plain = block(images, texels)
    centre = plain.mean(axis=1)
    assert np.abs(mean - centre).max() < 1e-6
    assert np.abs(flat(tiles, images, texels) - (plain - centre[:, None])).max() < 1e-6
    whole = tiles.transpose(1, 0, 2).reshape(tiles.shape[1], -1)
    assert (whole[:, texels:] == 0).all() and (whole[3 * images :] == 0).all()
    expected = [(plain**2).sum(), ((plain - centre[:, None]) ** 2).sum()]
    assert energy == pytest.approx(expected, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize(("images", "texels", "width"), SIZES)
def test_products_are_those_of_numpy(images, texels, width):
    tiles = block(images, texels)[0]
    matrix = flat(tiles, images, texels).astype(np.float64)
    generator = np.random.default_rng(1)
    padded, rows = len(tiles) * LANES, tiles.shape[1]

    tall = generator.standard_normal((padded, width)).astype(np.float32)
    out = np.full((rows, width), 7.0)
    for start, stop in strips(rows, pieces=3, unit=4):
        down(tiles, tall, start, stop, out)
    expected = matrix @ tall[:texels]
    assert np.abs(out[: 3 * images] - expected).max() < 1e-5 * np.sqrt(texels)

    wide = generator.standard_normal((rows, width)).astype(np.float32)
    total = np.ones((padded, width))
    for start, stop in strips(len(tiles), pieces=3):
        up(tiles, wide, start, stop, total)
    expected = 1 + matrix.T @ wide[: 3 * images]
    assert np.abs(total[:texels] - expected).max() < 1e-5 * np.sqrt(rows)

    columns = generator.integers(0, width, (3 * images, 4), dtype=np.int32)
    signs = generator.choice(np.float32([-1, 1]), columns.shape)
    omega = np.zeros((3 * images, width))
    np.add.at(omega, (np.arange(3 * images)[:, None], columns), signs)
    total = np.zeros((padded, width))
    sketch(tiles, columns, signs, 0, len(tiles), total)
    assert np.abs(total[:texels] - matrix.T @ omega).max() < 1e-5 * np.sqrt(rows)


def test_strips_do_not_change_a_bit():
    tiles = block(90, 100)[0]
    tall = np.random.default_rng(2).standard_normal((len(tiles) * LANES, 13)).astype(np.float32)
    whole, parts = np.zeros((2, tiles.shape[1], 13))
    down(tiles, tall, 0, tiles.shape[1], whole)
    for start, stop in strips(tiles.shape[1], pieces=7, unit=4):
        down(tiles, tall, start, stop, parts)
    assert np.array_equal(whole, parts)


@pytest.mark.parametrize(("count", "depth", "length"), [(3, 1, 5), (3, 4, 40), (6, 43, 100)])
def test_combinations_of_rows(count, depth, length):
    generator = np.random.default_rng(4)
    one = generator.standard_normal((count, depth)).astype(np.float32)
    rows = generator.standard_normal((depth, length)).astype(np.float32)
    out = np.empty((count, length), np.float32)
    combine(one, rows, out)
    assert np.abs(out - one.astype(np.float64) @ rows).max() < 1e-5


def test_small_products_are_those_of_numpy():
    generator = np.random.default_rng(5)
    tall = generator.standard_normal((50, 9))
    gram = np.ones((9, 9))
    add_gram(tall, gram)
    assert gram == pytest.approx(1 + tall.T @ tall, rel=1e-12)
    matrix = generator.standard_normal((9, 4))
    out = np.empty((50, 4), np.float32)
    turned(tall, matrix, out)
    assert out == pytest.approx(tall @ matrix, abs=1e-5)
    assert product(tall, matrix) == pytest.approx(tall @ matrix, rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("size", [1, 2, 5, 40, 90])
def test_eigenvalues_are_those_of_lapack(size):
    generator = np.random.default_rng(size)
    root = generator.standard_normal((size, size)) * 0.8 ** np.arange(size)
    matrix = root.T @ root
    values, vectors = eigen(matrix)
    assert values == pytest.approx(np.linalg.eigvalsh(matrix)[::-1], abs=1e-13 * values[0])
    assert np.abs(vectors.T @ vectors - np.eye(size)).max() < 1e-13
    assert np.abs(matrix @ vectors - vectors * values).max() < 1e-13 * values[0]


def test_whitened_columns_are_orthonormal_however_they_are_scaled():
    generator = np.random.default_rng(7)
    tall = generator.standard_normal((60, 12)) * 10.0 ** -np.linspace(0, 4, 12)
    singular, matrix = whitening(tall.T @ tall, least=1e-6)
    white = tall @ matrix
    assert np.abs(white.T @ white - np.eye(12)).max() < 1e-9
    assert singular == pytest.approx(np.linalg.svd(tall, compute_uv=False), rel=1e-9)


def test_whitening_leaves_out_what_is_not_there():
    tall = np.zeros((20, 5))
    tall[:, 1] = 1
    tall[:, 3] = 1
    singular, matrix = whitening(tall.T @ tall, least=1e-6)
    assert singular == pytest.approx([np.sqrt(40)])
    assert matrix.shape == (5, 1)
    assert len(whitening(np.zeros((3, 3)), least=1e-6)[0]) == 0
