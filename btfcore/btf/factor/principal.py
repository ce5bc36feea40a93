"""Factors turned to their principal axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.symmetric import add_gram, eigen, product, turned, whitening
from btfcore.types import F4, F8

_LEAST = 1e-6  # singular values below this share of the greatest are rounding


def principal(weights: NDArray[Any], basis: NDArray[Any]) -> tuple[F4, F4, F8]:
    """Return factors of the same product, weights (N, K) times the transpose of basis (C, K).

    Weights (N, k) f4 with orthogonal columns of falling length, basis (C, k) f4 with
    orthonormal ones, and the lengths (k,) f8: the singular values of the product. k ≤ K; what
    is 0 is left out.
    """
    gram = np.zeros((basis.shape[1],) * 2)
    add_gram(np.ascontiguousarray(basis), gram)
    _, white = whitening(gram, least=_LEAST)
    inward = product(gram, white)  # B w = (B white) (inwardᵀ w)
    moments = np.zeros((weights.shape[1],) * 2)
    add_gram(np.ascontiguousarray(weights), moments)
    moments = product(inward.T, product(moments, inward))
    squared, turn = eigen((moments + moments.T) / 2)
    kept = squared > _LEAST**2 * max(float(squared.max(initial=0)), 0.0)
    turn, squared = turn[:, kept], squared[kept]
    peak = np.abs(turn).argmax(axis=0) if turn.size else np.zeros(0, np.int64)
    turn = turn * np.where(turn[peak, np.arange(turn.shape[1])] < 0, -1.0, 1.0)
    left = np.empty((len(weights), turn.shape[1]), np.float32)
    turned(np.ascontiguousarray(weights), product(inward, turn), left)
    right = np.empty((len(basis), turn.shape[1]), np.float32)
    turned(np.ascontiguousarray(basis), product(white, turn), right)
    return left, right, np.sqrt(squared)
