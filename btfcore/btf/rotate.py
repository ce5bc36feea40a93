"""Rotation of a sample about its normal (Zhou §III-B, "Patch Matching": 72 rotated copies).

A copy is never stored: it is an affine map of texel coordinates, and a rotation of the local
frame, in which light and view are looked up. The angle runs counter-clockwise as seen from
outside, from s towards t, like phi: what pointed along +column points along `angle` in the copy,
so that a copy's angle is that of `Quilt.angle`. Positions are (column, row), whole at centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.interpolation.pairs import pair_weights, settled
from btfcore.btf.interpolation.radiance import blended, prepared
from btfcore.btf.interpolation.texels import bilinear
from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidParameter
from btfcore.types import F4, F8, I4

COPIES = 72
FITS = ("inside", "all")
_NEAR = 1e-9


@dataclass(frozen=True)
class Rotation:
    """A rotated copy of a sample as coordinates: `shape` (H, W) turned by `angle` (radians).

    extent : rows and columns of the copy. Both have the same middle, (size - 1) / 2.
    """

    shape: tuple[int, int]
    angle: float
    extent: tuple[int, int]

    @property
    def turn(self) -> tuple[float, float]:
        """Cosine and sine of the angle, whole ones at quarter turns."""
        return cosine_sine(self.angle)

    def to_copy(self, position: ArrayLike) -> F8:
        """Where texels at `position` (…, 2) of the sample lie in the copy."""
        cosine, sine = self.turn
        return self._mapped(position, self.shape, self.extent, cosine, sine)

    def to_sample(self, position: ArrayLike) -> F8:
        """Where texels at `position` (…, 2) of the copy lie in the sample."""
        cosine, sine = self.turn
        return self._mapped(position, self.extent, self.shape, cosine, -sine)

    def source(self) -> F8:
        """Position (h, w, 2) in the sample of every texel of the copy."""
        row, column = np.mgrid[: self.extent[0], : self.extent[1]]
        return self.to_sample(np.stack([column, row], axis=-1))

    def valid(self) -> NDArray[np.bool_]:
        """Which texels (h, w) of the copy lie among texel centres of the sample."""
        limit = np.array(self.shape[::-1]) - 1
        position = self.source()
        inside = (position >= -_NEAR) & (position <= limit + _NEAR)
        return np.all(inside, axis=-1)

    def _mapped(
        self,
        position: ArrayLike,
        start: tuple[int, int],
        stop: tuple[int, int],
        cosine: float,
        sine: float,
    ) -> F8:
        x, y = np.moveaxis(np.asarray(position, np.float64), -1, 0)
        x, y = x - (start[1] - 1) / 2, y - (start[0] - 1) / 2
        # rows run downwards, t upwards
        across, down = x * cosine + y * sine, y * cosine - x * sine
        return np.stack([across + (stop[1] - 1) / 2, down + (stop[0] - 1) / 2], axis=-1)


def cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at quarter turns."""
    quarter = angle / (np.pi / 2)
    if abs(quarter - round(quarter)) < _NEAR:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarter) % 4]
    return float(np.cos(angle)), float(np.sin(angle))


def rotation(shape: tuple[int, int], angle: float, *, fit: str = "all") -> Rotation:
    """Coordinates of a sample of `shape` (rows, columns) turned by `angle` (radians).

    fit : "all" makes the copy large enough for the whole sample (see `Rotation.valid` for what
    lies outside), "inside" cuts the largest rectangle out that has no such texel.
    Raises `InvalidParameter`.
    """
    if fit not in FITS or not np.isfinite(angle) or min(shape) < 1:
        raise InvalidParameter(
            f"a rotation of {shape} by {angle} with fit={fit!r}; fit can be {', '.join(FITS)}"
        )
    cosine, sine = (abs(part) for part in cosine_sine(angle))
    height, width = shape[0] - 1, shape[1] - 1  # between the outermost centres
    if fit == "all":
        across, down = width * cosine + height * sine, width * sine + height * cosine
        extent = (int(np.ceil(down - 1e-6)) + 1, int(np.ceil(across - 1e-6)) + 1)
    else:
        extent = _inside(height, width, cosine, sine)
    return Rotation((int(shape[0]), int(shape[1])), float(angle), extent)


def _inside(height: int, width: int, cosine: float, sine: float) -> tuple[int, int]:
    """Rows and columns of the largest upright rectangle in a turned one, about its middle."""
    across = np.arange(int(np.ceil(width * cosine + height * sine)) + 1, dtype=np.float64)
    slack = np.stack([width - across * cosine, height - across * sine])
    parts = np.array([[sine], [cosine]])
    room = np.divide(slack, parts, out=np.full_like(slack, np.inf), where=parts > 0)
    room[:, (slack < -_NEAR).any(axis=0)] = -1
    down = np.floor(room.min(axis=0) + _NEAR)
    best = int(((down + 1) * (across + 1)).argmax())
    return int(down[best]) + 1, int(across[best]) + 1


def copies(shape: tuple[int, int], count: int = COPIES, *, fit: str = "all") -> Iterator[Rotation]:
    """Zhou's rotated copies: `count` of them, evenly around, the first one not turned."""
    for k in range(count):
        yield rotation(shape, 2 * np.pi * k / count, fit=fit)


def rotate_directions(directions: ArrayLike, angle: float) -> F8:
    """Vectors (…, 3) f8 turned about n by `angle`, as the material turns with its frame.

    Light and view of a rotated copy are looked up in the sample at minus the copy's angle.
    """
    cosine, sine = cosine_sine(angle)
    x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
    return np.stack([x * cosine - y * sine, x * sine + y * cosine, z], axis=-1)


def rotated(
    sample: BtfSample,
    angle: float,
    *,
    fit: str | None = None,
    directions: str = "same",
    method: str = "auto",
) -> BtfSample:
    """Return the sample as if the piece of material had been turned by `angle` (radians).

    A reference, which synthesis need not build: images are made when they are read.
    fit : see `rotation`; None takes "all" for a sample that tiles, which fills the corners by
    repetition, and "inside" for others. With "all", texels outside show the border's values.
    directions : "same" keeps the tables of views and lights, and mixes each image from those
    at the directions turned back (`method`: see `prepare`), which is exact where they fall on
    directions of the table; a pair is missing where all images of its mixture are. "turned"
    keeps the images and turns the tables, which is exact always.

    Between texels values are bilinear. The feature mask turns along; factors are dropped; the
    copy tiles only where the sample does and the angle is a quarter turn.
    Raises `InvalidParameter`.
    """
    if directions not in ("same", "turned"):
        raise InvalidParameter(f"directions={directions!r}, where same or turned can be")
    if fit is None:
        fit = "all" if sample.tiles else "inside"
    place = rotation(sample.shape, angle, fit=fit)
    if directions == "turned":
        tables = (rotate_directions(sample.views, angle), rotate_directions(sample.lights, angle))
        index = sample.index.copy()
        mixtures = [(np.array([k], np.int32), np.ones(1)) for k in range(sample.images)]
    else:
        tables = (sample.views, sample.lights)
        index, mixtures = _turned_back(sample, angle, method)
        if not mixtures:
            raise InvalidParameter(f"{sample.name}: no image is left by a turn of {angle:.4f}")
    mask = sample.mask
    if mask is not None:
        mask = bilinear(mask[None, :, :, None], place.source(), tiles=sample.tiles)[0, :, :, 0]
    return replace(
        sample,
        stack=RotatedStack(sample.stack, place, mixtures, tiles=sample.tiles),
        views=tables[0],
        lights=tables[1],
        index=index,
        mask=mask,
        tiles=sample.tiles and 0.0 in place.turn,
        factors=None,
    )


def _turned_back(sample: BtfSample, angle: float, method: str) -> tuple[I4, list[tuple[I4, F8]]]:
    """Index (V, L) of the turned sample, and the images that each of its images mixes."""
    view, light = prepared(sample, method)
    views = view.weights(rotate_directions(sample.views, -angle))
    lights = light.weights(rotate_directions(sample.lights, -angle))
    index = np.full(sample.index.shape, -1, np.int32)
    mixtures: list[tuple[I4, F8]] = []
    for v in range(len(sample.views)):
        one = tuple(np.repeat(part[v : v + 1], len(sample.lights), axis=0) for part in views)
        image, weight = pair_weights(sample, (one[0], one[1]), lights, substitute=False)
        for k in np.flatnonzero(weight.sum(axis=1) > 0):
            index[v, k] = len(mixtures)
            mixtures.append(settled(image[k], weight[k]))
    return index, mixtures


class RotatedStack:
    """Images of a rotated copy, each mixed from images of another stack and turned when read."""

    def __init__(
        self,
        stack: ImageStack,
        place: Rotation,
        mixtures: list[tuple[I4, F8]],
        *,
        tiles: bool = False,
    ) -> None:
        """Take image k of the copy from images and weights `mixtures[k]` of `stack`."""
        self._stack = stack
        self._source = place.source()
        self._mixtures = mixtures
        self._tiles = tiles
        self._shape = (len(mixtures), *place.extent)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns of the copy."""
        return self._shape

    @property
    def dear(self) -> bool:
        """Every read mixes and turns."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, h, w, 3) f4 linear radiance."""
        chosen = np.asarray(numbers, np.int64)
        out = np.empty((len(chosen), *self._shape[1:], 3), np.float32)
        for place, number in enumerate(chosen):
            image = blended(self._stack, *self._mixtures[number])
            out[place] = bilinear(image[None], self._source, tiles=self._tiles)[0]
        return out
