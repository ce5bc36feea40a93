"""Radiance of points of a relief: Lambert and GGX, under lights that the horizon may hide.

Values are radiances under a light whose irradiance, at normal incidence, is π: a white
Lambertian texel that faces it has radiance 1, and one lit at angle θ has cos θ.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F4, F8, I8

LOWEST = 0.05  # cosine between normal and view or light, below which it counts as this
LANES = 256  # texels that lie side by side, so that a processor's vector units share one loop
ROWS = 14  # of a surface: the 12 channels of the relief's maps, cosine to the viewer, masking

_ONE, _HALF, _ZERO = np.float32(1), np.float32(0.5), np.float32(0)
_LOWEST = np.float32(LOWEST)


def blocks(count: int) -> int:
    """Number of blocks of `LANES` texels that hold `count` of them."""
    return -(-count // LANES)


@njit(cache=True, nogil=True, error_model="numpy")
def fresnel(straight, edge, shut):  # type: ignore[no-untyped-def]
    """Schlick's reflectance at an incidence whose cosine is 1 - `shut`."""
    square = shut * shut
    return straight + (edge - straight) * (square * square * shut)


@njit(cache=True, nogil=True, error_model="numpy")
def look(maps: F4, x: F8, y: F8, view: F4, coat: F4, out: F4) -> None:
    """Fill in the material that a viewer sees at points of a relief.

    maps (h, w, 12) f4, read bilinearly at columns x and rows y (n,) f8; view (3,) f4; coat :
    of a `Relief`. out (blocks, 14, LANES) f4: the maps' channels with a unit normal, alpha²,
    and the diffuse albedo times the share of light that leaves towards the view; the cosine n·v
    (at least 0.05); Smith's masking root √(n·v² (1 - α²) + α²).
    """
    rows, columns, channels = maps.shape
    mean = coat[0] + (coat[1] - coat[0]) / np.float32(21)  # ∫ 2 F(c) c dc
    for k in range(len(x)):
        point = out[k // LANES, :, k % LANES]
        i, j = int(x[k]), int(y[k])
        u, w = np.float32(x[k] - i), np.float32(y[k] - j)
        right = i + 1 if i + 1 < columns else 0
        below = j + 1 if j + 1 < rows else 0
        one, two = (_ONE - u) * (_ONE - w), u * (_ONE - w)
        three, four = (_ONE - u) * w, u * w
        for c in range(channels):
            point[c] = (
                one * maps[j, i, c]
                + two * maps[j, right, c]
                + three * maps[below, i, c]
                + four * maps[below, right, c]
            )
        length = np.sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
        if length > np.float32(1e-6):
            point[:3] /= length
        else:  # neighbours that cancel out
            point[0], point[1], point[2] = _ZERO, _ZERO, _ONE
        square = point[10] * point[10]
        cosine = point[0] * view[0] + point[1] * view[1] + point[2] * view[2]
        cosine = max(cosine, _LOWEST)
        point[10], point[12] = square, cosine
        point[3:6] *= (_ONE - fresnel(coat[0], coat[1], _ONE - cosine)) / (_ONE - mean)
        point[13] = np.sqrt(cosine * cosine * (_ONE - square) + square)


@njit(cache=True, nogil=True, error_model="numpy")
def shade(
    surface: F4,
    horizon: F4,
    way: I8,
    tangent: F4,
    view: F4,
    coat: F4,
    lights: F4,
    images: F4,
    places: I8,
    texels: I8,
) -> None:
    """Fill in the radiance of consecutive texels under several lights.

    surface (blocks, 14, LANES) f4 of `look`; horizon (A, blocks * LANES) f4: tangents of the
    horizon; way (m,): which of them belongs to a light; tangent (m,) f4 of the lights'
    elevations; view (3,), lights (m, 3) f4 unit; coat : of a `Relief`. images (J, texels, 3)
    f4: written at images `places` (m,), from texel texels[0] to before texels[1].

    Cook-Torrance with GGX, Smith's height-correlated masking and Schlick's Fresnel. The diffuse
    part is what a dielectric lets in and out again, (1 - F(n·l)) (1 - F(n·v)) / (1 - mean F)
    times Lambert's law, which is reciprocal and loses nothing (Kelemen and Szirmay-Kalos 2001).
    """
    first, last = texels
    flat = surface.reshape(-1)
    for m in range(len(lights)):
        light_x, light_y, light_z = lights[m]
        x, y, z = light_x + view[0], light_y + view[1], light_z + view[2]
        length = max(np.sqrt(x * x + y * y + z * z), np.float32(1e-6))
        x, y, z = x / length, y / length, z / length
        shut = max(_ONE - (x * view[0] + y * view[1] + z * view[2]), _ZERO)
        fifth = fresnel(_ZERO, _ONE, shut)
        limit = tangent[m]
        for block in range(len(surface)):
            start = block * LANES
            stop = min(start + LANES, last - first)
            hidden = horizon[way[m], start:stop]
            point = flat[block * ROWS * LANES : (block + 1) * ROWS * LANES]
            out = images[places[m], first + start : first + stop].reshape(-1)
            # constant distances within one array let the compiler vectorise this: 15 times faster
            for k in range(stop - start):
                nx, ny, nz = point[k], point[LANES + k], point[2 * LANES + k]
                cosine = nx * light_x + ny * light_y + nz * light_z
                lit = cosine if limit > hidden[k] else _ZERO
                lit = lit if lit > _ZERO else _ZERO
                across = nx * x + ny * y + nz * z
                across = across if across > _ZERO else _ZERO
                square, masking = point[10 * LANES + k], point[13 * LANES + k]
                thin = across * across * (square - _ONE) + _ONE
                shadowing = np.sqrt(lit * lit * (_ONE - square) + square)
                smith = lit * masking + point[12 * LANES + k] * shadowing
                gloss = square * _HALF / (thin * thin * smith)
                edge = point[9 * LANES + k]
                shine = lit * point[11 * LANES + k]
                matt = shine * (_ONE - fresnel(coat[0], coat[1], _ONE - lit))
                shine *= gloss
                red, green, blue = point[6 * LANES + k], point[7 * LANES + k], point[8 * LANES + k]
                red, green, blue = (
                    red + (edge - red) * fifth,
                    green + (edge - green) * fifth,
                    blue + (edge - blue) * fifth,
                )
                out[3 * k] = matt * point[3 * LANES + k] + shine * red
                out[3 * k + 1] = matt * point[4 * LANES + k] + shine * green
                out[3 * k + 2] = matt * point[5 * LANES + k] + shine * blue
