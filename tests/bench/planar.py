"""Errors of a planar synthesis, measured on the sample and the output picture alone.

How near the output's patches are to the sample's says little by itself, since copying the sample
verbatim makes it zero; so what was copied, how evenly and how often again belong beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.lib.stride_tricks import sliding_window_view
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from btfcore.errors import InvalidImage
from btfcore.types import F4, F8, I8

PATCH, STRIDE = 11, 8
TAIL = 0.95
PIECE, PIECE_STRIDE, APART, ALIKE = 31, 16, 48, 0.35
PARTS = 32  # principal components that rule most pairs of pieces out
CHUNK = 256
BIN = 8


@dataclass(frozen=True)
class PlanarMeasures:
    """Measures of one output against its sample; errors are in deviations of the sample.

    patch_nn : mean RMSE of each 11 x 11 output patch to its nearest sample patch.
    seam : 95 % quantile of the same errors; a patch across a visible seam is like none of the
        sample's.
    copied_side : side in pixels of the pieces copied verbatim, weighted by their area.
    source_use : perplexity of where the nearest patches lie in the sample, 1 where every part
        is used alike.
    self_repeat : share of 31 x 31 output patches that occur again 49 or more pixels away.
    """

    patch_nn: float
    seam: float
    copied_side: float
    source_use: float
    self_repeat: float


def measure_plane(sample: F4, output: F4) -> PlanarMeasures:
    """Measure `output` (H, W, C) f4 against `sample` (h, w, C) f4, both 0…1.

    Raises `InvalidImage` where either is smaller than the patches that are compared.
    """
    _check(sample, "sample", PATCH)
    _check(output, "output", 2 * APART + 1)
    error, nearest = nearest_patches(sample, output)
    error /= max(float(sample.std()), 1e-12)
    return PlanarMeasures(
        patch_nn=float(error.mean()),
        seam=float(np.quantile(error, TAIL)),
        copied_side=copied_side(nearest),
        source_use=source_use(nearest, sample.shape[0], sample.shape[1]),
        self_repeat=self_repeat(sample, output),
    )


def _check(image: F4, name: str, least: int) -> None:
    if image.ndim != 3 or min(image.shape[:2]) < least:
        raise InvalidImage(
            f"{name} has the shape {image.shape}; it takes {least} x {least} at least"
        )


def nearest_patches(sample: F4, output: F4) -> tuple[F8, I8]:
    """RMSE (n, m) of every eighth output patch to the sample patch nearest to it, and which.

    The second array (n, m, 2) holds that patch's (row, column) in the sample.
    """
    both_grey = all((image == image[..., :1]).all() for image in (sample, output))
    if both_grey:  # a mean over equal channels is that of one
        sample, output = sample[..., :1], output[..., :1]
    known = _patches(sample, 1)
    asked = _patches(output, STRIDE)
    shape = asked.shape[:2]
    columns = known.shape[1]
    known = known.reshape(-1, known.shape[2])
    asked = asked.reshape(-1, asked.shape[2])
    power = np.einsum("ij,ij->i", known, known)
    error = np.empty(len(asked))
    best = np.empty(len(asked), np.int64)
    for first in range(0, len(asked), CHUNK):
        part = asked[first : first + CHUNK]
        best[first : first + CHUNK] = (power - 2 * (part @ known.T)).argmin(axis=1)
        apart = part.astype(np.float64) - known[best[first : first + CHUNK]]
        error[first : first + CHUNK] = np.sqrt((apart**2).mean(axis=1))
    where = np.stack(np.divmod(best, columns), axis=-1)
    return error.reshape(shape), where.reshape(*shape, 2)


def _patches(image: F4, stride: int) -> F4:
    """All patches at a stride as (n, m, C·11·11)."""
    views = sliding_window_view(image, (PATCH, PATCH), axis=(0, 1))[::stride, ::stride]
    return np.ascontiguousarray(views.reshape(*views.shape[:2], -1), np.float32)


def copied_side(nearest: I8) -> float:
    """Root of the mean copied area, in pixels, that a patch of `nearest` (n, m, 2) lies in.

    Neighbouring patches belong to one copied piece where their offsets into the sample differ
    by one pixel at most.
    """
    rows, columns = nearest.shape[:2]
    offset = nearest - STRIDE * np.moveaxis(np.indices((rows, columns)), 0, -1)
    names = np.arange(rows * columns).reshape(rows, columns)
    down = np.abs(np.diff(offset, axis=0)).max(axis=2) <= 1
    across = np.abs(np.diff(offset, axis=1)).max(axis=2) <= 1
    tail = np.concatenate([names[1:][down], names[:, 1:][across]])
    head = np.concatenate([names[:-1][down], names[:, :-1][across]])
    graph = coo_array((np.ones(len(tail)), (tail, head)), shape=(names.size, names.size))
    _, piece = connected_components(graph, directed=False)
    return float(STRIDE * np.sqrt(np.bincount(piece)[piece].mean()))


def source_use(nearest: I8, height: int, width: int) -> float:
    """Perplexity over the number of 8 x 8 bins of the sample that the patches come from."""
    row, column = nearest[..., 0] // BIN, nearest[..., 1] // BIN
    bins = -(-(width - PATCH + 1) // BIN)
    count = np.bincount((row * bins + column).ravel(), minlength=bins * bins)
    share = count[count > 0] / count.sum()
    down = -(-(height - PATCH + 1) // BIN)
    return float(np.exp(-(share * np.log(share)).sum()) / (bins * down))


def self_repeat(sample: F4, output: F4) -> float:
    """Share of 31 x 31 patches, every 16th, found again far away within .35 deviations.

    The distance of two patches' leading principal components bounds theirs from below, so that
    few pairs need to be compared in full; the answer is that of comparing all.
    """
    grey = output.mean(axis=2, dtype=np.float64)
    bound = (ALIKE * float(sample.mean(axis=2).std())) ** 2 * PIECE**2
    windows = sliding_window_view(grey, (PIECE, PIECE))
    rows, columns = windows.shape[:2]
    parts = _leading_parts(grey, windows)
    power = np.einsum("ij,ij->i", parts, parts)
    row, column = np.divmod(np.arange(rows * columns), columns)
    lefts = np.arange(0, columns, PIECE_STRIDE)
    again = asked = 0
    for top in range(0, rows, PIECE_STRIDE):
        mine = top * columns + lefts
        crossed = parts[mine] @ parts.T
        for left, known, products in zip(lefts, power[mine], crossed, strict=True):
            least = power - 2 * products + known
            hopeful = np.flatnonzero(least < bound * 1.001)
            far = np.maximum(np.abs(row[hopeful] - top), np.abs(column[hopeful] - left)) > APART
            hopeful = hopeful[far]
            hopeful = hopeful[np.argsort(least[hopeful], kind="stable")]
            asked += 1
            for first in range(0, len(hopeful), CHUNK):
                some = hopeful[first : first + CHUNK]
                apart = windows[row[some], column[some]] - windows[top, left]
                if (apart**2).sum(axis=(1, 2)).min() < bound:
                    again += 1
                    break
    return again / asked


def _leading_parts(grey: F8, windows: F8) -> F4:
    """Principal components (n, 32) f4 of all 31 x 31 windows, in order of their top-left pixel."""
    some = windows[::BIN, ::BIN].reshape(-1, PIECE**2)
    mean = some.mean(axis=0)
    _, vectors = np.linalg.eigh((some - mean).T @ (some - mean))
    shape = tuple(scipy.fft.next_fast_len(side, real=True) for side in grey.shape)
    spectrum = scipy.fft.rfft2(grey, shape)
    parts = np.empty((windows.shape[0] * windows.shape[1], PARTS), np.float32)
    for k in range(PARTS):
        axis = vectors[:, -1 - k]
        product = np.conj(scipy.fft.rfft2(axis.reshape(PIECE, PIECE), shape)) * spectrum
        crossed = scipy.fft.irfft2(product, shape)[: windows.shape[0], : windows.shape[1]]
        parts[:, k] = crossed.ravel() - axis @ mean
    return parts
