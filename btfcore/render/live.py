"""The atlas image of a quilt that is being painted: only what changed is looked up anew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.render.copying import gather_texels
from btfcore.render.modes import SEAM
from btfcore.render.texture import quantise, vertex_colours
from btfcore.types import F4, I4, Quilt, Sample

U1 = NDArray[np.uint8]

TINT = np.array([86, 156, 255], np.float32)  # of an area that is asked for
_STRENGTH = 0.55  # of the tint where m_0 is 1


class LiveTexture:
    """Colours and seams of one quilt, kept vertex by vertex; for one thread at a time.

    The images are those of `atlas_texture` with `vertex_colours` and with `seam_colours`, bit
    for bit, and each is an array of its own.
    """

    def __init__(
        self, gutter: I4, indptr: I4, indices: I4, samples: Sequence[Sample], quilt: Quilt
    ) -> None:
        """Begin with `quilt`; gutter: of the dense mesh (`gutter_source`), whose rows these are."""
        self._gutter, self._indptr, self._indices = gutter, indptr, indices
        count = len(indptr) - 1
        if len(quilt.patch) != count:
            raise InvalidParameter(
                f"a quilt of {len(quilt.patch)} vertices on a dense mesh of {count}"
            )
        self._patch: I4 = np.full(count, -1, np.int32)
        self._coded: U1 = np.zeros((count, 3), np.uint8)
        self._seam: NDArray[np.bool_] = np.zeros(count, np.bool_)
        self.update(np.arange(count, dtype=np.int32), quilt, samples)

    def update(self, vertices: I4, part: Quilt, samples: Sequence[Sample]) -> None:
        """Take the values `part` of `vertices` (n,), one each in the same order."""
        if len(part.patch) != len(vertices):
            raise InvalidParameter(f"{len(part.patch)} values for {len(vertices)} vertices")
        if not len(vertices):
            return
        self._coded[vertices] = quantise(vertex_colours(part, samples))
        self._patch[vertices] = part.patch
        _mark_seams(self._indptr, self._indices, vertices, self._patch, self._seam)

    def image(self) -> U1:
        """Colours: (size, size, 3) u8, row 0 on top."""
        return self._gathered(self._coded)

    def seams(self) -> U1:
        """Colours with the seams in yellow."""
        coded = self._coded.copy()
        coded[self._seam] = quantise(SEAM[None])[0]
        return self._gathered(coded)

    def tinted(self, wanted: F4, done: I4) -> U1:
        """Colours, tinted by m_0 `wanted` (N,) where the vertices `done` (n,) are not."""
        at = np.flatnonzero(wanted > 0)
        share = wanted[at] * np.float32(_STRENGTH)
        mark = np.zeros(len(wanted), np.bool_)
        mark[done] = True
        share[mark[at]] = 0
        coded = self._coded.copy()
        mixed = coded[at] * (1 - share)[:, None] + TINT * share[:, None]
        coded[at] = (mixed + 0.5).astype(np.uint8)
        return self._gathered(coded)

    def overlaid(self, vertices: I4, colours: F4, alpha: F4) -> U1:
        """Colours, with `colours` (n, 3) 0–1 laid over `vertices` (n,) by `alpha` (n,)."""
        coded = self._coded.copy()
        share = np.clip(alpha, 0, 1)[:, None]
        mixed = coded[vertices] * (1 - share) + np.clip(colours, 0, 1) * 255 * share
        coded[vertices] = (mixed + 0.5).astype(np.uint8)
        return self._gathered(coded)

    def _gathered(self, coded: U1) -> U1:
        image = np.empty((*self._gutter.shape, 3), np.uint8)
        gather_texels(self._gutter, coded, 0, self._gutter.size, image)
        return image


@njit(cache=True, nogil=True)
def _mark_seams(indptr, indices, vertices, patch, seam):  # type: ignore[no-untyped-def]
    """Say of `vertices` and their neighbours whether a neighbour is of another patch."""
    for vertex in vertices:
        seam[vertex] = _on_seam(indptr, indices, vertex, patch)
        for slot in range(indptr[vertex], indptr[vertex + 1]):
            near = indices[slot]
            seam[near] = _on_seam(indptr, indices, near, patch)


@njit(cache=True, nogil=True)
def _on_seam(indptr, indices, vertex, patch):  # type: ignore[no-untyped-def]
    if patch[vertex] < 0:
        return False
    for slot in range(indptr[vertex], indptr[vertex + 1]):
        other = patch[indices[slot]]
        if other >= 0 and other != patch[vertex]:
            return True
    return False
