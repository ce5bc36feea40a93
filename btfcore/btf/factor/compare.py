"""Compares one image with what factors give for it: sums of squares in f8."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.btf.colour import LUMINANCE
from btfcore.btf.factor.elementary import code_rows, decode_rows, srgb_in_place

_RED, _GREEN, _BLUE = (np.float32(weight) for weight in LUMINANCE)


@njit(cache=True, nogil=True, error_model="numpy")
def _squares(one, two):  # type: ignore[no-untyped-def]
    # lane by lane, so that the sums vectorise without being reordered
    own, apart = np.zeros(32), np.zeros(32)
    count = len(one)
    for first in range(0, count, 32):
        for x in range(min(32, count - first)):
            a, b = np.float64(one[first + x]), np.float64(two[first + x])
            own[x] += a * a
            apart[x] += (a - b) * (a - b)
    return own.sum(), apart.sum()


@njit(cache=True, nogil=True, error_model="numpy")
def compare(image, planes, kind, epsilon, knee, out, grey):  # type: ignore[no-untyped-def]
    """Compare an image (N, 3) f4 with coded colours `planes` (3, N) f4, which are overwritten.

    out (5,) f8 takes sums of squares: of the linear image and of its error; of the coded image
    and of its error; of the error of sRGB-coded values. grey (2, N) f4 takes the luminance of
    the sRGB-coded image and of what is compared with it.
    """
    texels = len(image)
    own = np.empty((3, texels), np.float32)
    for i in range(texels):
        own[0, i], own[1, i], own[2, i] = image[i, 0], image[i, 1], image[i, 2]
    coded = own.copy()
    code_rows(coded[0], coded[1], coded[2], kind, epsilon, knee)
    out[2], out[3] = _squares(coded.ravel(), planes.ravel())
    decode_rows(planes[0], planes[1], planes[2], kind, epsilon, knee)
    out[0], out[1] = _squares(own.ravel(), planes.ravel())
    srgb_in_place(own.ravel())
    srgb_in_place(planes.ravel())
    out[4] = _squares(own.ravel(), planes.ravel())[1]
    for i in range(texels):
        grey[0, i] = _RED * own[0, i] + _GREEN * own[1, i] + _BLUE * own[2, i]
        grey[1, i] = _RED * planes[0, i] + _GREEN * planes[1, i] + _BLUE * planes[2, i]
