"""Keeps weights in memory, or where they are too large for it in an unnamed temporary file."""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F8


class WeightStore:
    """Takes in weights band by band, and hands out (V, H, W, K) at the end.

    A file is written by position and mapped only at the end, so that its pages do not count
    as memory while the work goes on; it vanishes with the array.
    """

    def __init__(self, shape: tuple[int, int, int, int], *, half: bool, memory_mb: float) -> None:
        """Make room: in memory up to `memory_mb` MiB."""
        self._shape = shape
        self._kind = np.dtype(np.float16 if half else np.float32)
        inside = np.prod(shape, dtype=float) * self._kind.itemsize <= memory_mb * 2**20
        self._array = np.empty(shape, self._kind) if inside else None
        self._file = None if inside else tempfile.TemporaryFile(prefix="patina-")

    def put(self, view: int, rows: slice, found: F8) -> F8:
        """Keep `found` (K, n) of the texels of `rows`; return what is kept, rounded, as f8."""
        _, _, width, rank = self._shape
        kept = found.T.astype(self._kind, order="C")
        if self._array is not None:
            self._array[view, rows] = kept.reshape(-1, width, rank)
        elif self._file is not None:
            texel = (view * self._shape[1] + rows.start) * width
            self._file.seek(texel * rank * self._kind.itemsize)
            self._file.write(kept.data)
        return kept.T.astype(np.float64, order="C")

    def weights(self) -> NDArray[Any]:
        """All that was put."""
        if self._array is not None:
            return self._array
        assert self._file is not None
        self._file.flush()
        return np.memmap(self._file, self._kind, "r", shape=self._shape)
