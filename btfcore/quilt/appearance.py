"""Channels that stand for a texel's neighbourhood, so that a seam's cost looks beside the seam.

The principal parts of the (2r + 1)² texels around each texel ("appearance vectors", Lefebvre &
Hoppe 2006, "Appearance-space texture synthesis", §3). What is seen of a seam is how both patches
differ along it, not at the two texels alone that it parts.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from btfcore.types import F4

PARTS = 8


def appearance(channels: F4, radius: int) -> F4:
    """Return (h, w, k) f4, k ≤ 8, for channels (h, w, K) f4; borders are repeated outwards.

    Distances are near the root mean square difference of the neighbourhoods, from below.
    """
    side = 2 * radius + 1
    padded = np.pad(channels, ((radius, radius), (radius, radius), (0, 0)), mode="edge")
    windows = sliding_window_view(padded, (side, side), axis=(0, 1))
    flat = windows.reshape(channels.shape[0] * channels.shape[1], -1).astype(np.float64) / side
    flat -= flat.mean(axis=0)
    # einsum, not a BLAS product: its sums do not depend on the number of threads
    _, vectors = np.linalg.eigh(np.einsum("ik,il->kl", flat, flat))
    vectors = vectors[:, ::-1][:, :PARTS]
    signs = np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(vectors.shape[1])])
    parts = np.einsum("ik,kl->il", flat, vectors * signs)
    return np.ascontiguousarray(parts.reshape(*channels.shape[:2], -1), np.float32)
