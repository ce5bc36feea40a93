"""Copies between lists of surfels, all surfels and the atlas image, in compiled code."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def grouped(chosen, group, slot, wanted, place):  # type: ignore[no-untyped-def]
    """List the groups of `chosen`, and each one's place in that list; `slot` stays all -1."""
    count = 0
    for index in range(len(chosen)):
        mine = group[chosen[index]]
        if slot[mine] < 0:
            slot[mine] = count
            wanted[count] = mine
            count += 1
        place[index] = slot[mine]
    for index in range(count):
        slot[wanted[index]] = -1
    return count


@njit(cache=True, nogil=True)
def scatter(codes, chosen, begin, end, coded):  # type: ignore[no-untyped-def]
    """Put codes (end - begin, 3) to the surfels chosen[begin:end] of coded (n, 3)."""
    for index in range(begin, end):
        vertex = chosen[index]
        for band in range(3):
            coded[vertex, band] = codes[index - begin, band]


@njit(cache=True, nogil=True)
def gather_texels(source, colours, begin, end, image):  # type: ignore[no-untyped-def]
    """Copy colours (n, 3) to the texels `begin` … `end` of the image, row by row."""
    flat = source.reshape(-1)
    out = image.reshape(-1)
    for texel in range(begin, end):
        vertex = flat[texel]
        out[3 * texel] = colours[vertex, 0]
        out[3 * texel + 1] = colours[vertex, 1]
        out[3 * texel + 2] = colours[vertex, 2]
