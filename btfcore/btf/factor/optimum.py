"""The least error that any factors can have, by an exact SVD: for crops, to compare with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from btfcore.btf.factor.encoding import encode
from btfcore.btf.sample import BtfSample, Encoding
from btfcore.errors import InvalidParameter
from btfcore.types import F8

LARGEST = 4096  # texels, or images × colours: LAPACK's time grows with the cube


def optimal_errors(
    sample: BtfSample, ranks: Sequence[int], encoding: Encoding, *, centred: bool = True
) -> F8:
    """Relative L2 errors in coded values (len(ranks),) of the best factors of each rank.

    centred : take the means over texels off first, as `factorize` does; they count as value.
    All in f8 and in memory, from the smaller Gram matrix: exact down to errors of 1e-7.
    Raises `InvalidParameter` where texels and columns are both more than 4096.
    """
    images, height, width = sample.stack.shape
    small = min(height * width, images * 3)
    if small > LARGEST:
        raise InvalidParameter(
            f"{sample.name}: an exact SVD of {height * width} texels and {images} images; at most"
            f" {LARGEST} of either are allowed"
        )
    coded = encode(sample.stack.read(np.arange(images)), encoding).astype(np.float64)
    matrix = coded.reshape(images, -1, 3).transpose(1, 0, 2).reshape(height * width, -1)
    total = float((matrix**2).sum())
    if centred:
        matrix = matrix - matrix.mean(axis=0)
    gram = matrix @ matrix.T if len(matrix) <= matrix.shape[1] else matrix.T @ matrix
    energy = np.maximum(np.linalg.eigvalsh(gram)[::-1], 0)
    lost = np.array([energy[rank:].sum() for rank in ranks])
    return np.sqrt(lost / total) if total > 0 else np.zeros(len(ranks))
