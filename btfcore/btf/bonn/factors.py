"""Images made of the factors in a DFMF, FMF or PVF file when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.bonn.models import ColourModel, decode
from btfcore.btf.stack import LARGEST_HALF
from btfcore.types import F4

_TEXELS = 1 << 13  # converted and multiplied at a time
_NUMBERS = 1 << 22  # of a factor, likewise
_MOST_CHECKED = 1 << 28  # numbers that are looked through when a file is opened


@dataclass(frozen=True, eq=False)
class Plane:
    """One colour channel of some images: value = images · texels + means.

    images (n, K), texels (H·W, K) of f2, f4 or f8, as a rule views of the mapped file;
    image_mean (n,), texel_mean (H·W,): or None.
    """

    images: NDArray[Any]
    texels: NDArray[Any]
    image_mean: NDArray[Any] | None = None
    texel_mean: NDArray[Any] | None = None

    @property
    def parts(self) -> tuple[NDArray[Any], ...]:
        """The arrays there are."""
        every = (self.images, self.texels, self.image_mean, self.texel_mean)
        return tuple(part for part in every if part is not None)


class FactorStack:
    """An `ImageStack` of factors: each slot holds as many images, in 1 or 3 planes.

    Values are decoded by the colour model; negative ones come out as 0, highlights are kept,
    and factors that are not finite count as 0. With OpenBLAS an image's bits depend neither on
    what else is read with it nor on the number of threads. The texels' factors are kept as f4
    after the first reading where they fit into `memory_mb` MiB, and converted blockwise each
    time where not. flip : the file's last row is on top.
    """

    def __init__(
        self,
        slots: Sequence[tuple[Plane, ...]],
        height: int,
        width: int,
        *,
        model: ColourModel | None = None,
        flip: bool = False,
        memory_mb: float = 512,
    ) -> None:
        """Hold the slots; `flaws`: how many factors are not finite, None if not counted."""
        self._slots = tuple(slots)
        self._per_slot = len(slots[0][0].images)
        self._shape = (self._per_slot * len(slots), height, width)
        self._model = model or ColourModel()
        self._flip = flip
        distinct = {_place(part): part for slot in slots for plane in slot for part in plane.parts}
        few = sum(part.size for part in distinct.values()) <= _MOST_CHECKED
        self.flaws = sum(map(_not_finite, distinct.values())) if few else None
        texels = {_place(plane.texels): plane.texels for slot in slots for plane in slot}
        self._keep = sum(part.size * 4 for part in texels.values()) <= memory_mb * 2**20
        self._kept: dict[tuple[Any, ...], F4] = {}

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return self._shape

    @property
    def dear(self) -> bool:
        """Reading multiplies matrices."""
        return True

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        chosen = np.asarray(numbers, np.int64).ravel()
        count, height, width = self._shape
        if len(chosen) and not (chosen.min() >= 0 and chosen.max() < count):
            raise IndexError(f"images {chosen.min()} to {chosen.max()} of {count}")
        out = np.empty((len(chosen), height * width, 3), np.float32)
        slot_of = chosen // self._per_slot
        for slot in np.unique(slot_of):
            rows = np.flatnonzero(slot_of == slot)
            self._fill(out, rows, self._slots[slot], chosen[rows] % self._per_slot)
        images = out.reshape(len(chosen), height, width, 3)
        return np.ascontiguousarray(images[:, ::-1]) if self._flip else images

    def _fill(self, out: F4, rows: Any, planes: tuple[Plane, ...], numbers: Any) -> None:
        # One image alone would take another way through BLAS, whose last bits differ.
        twice = np.repeat(numbers, 2) if len(numbers) == 1 else numbers
        factors = [_sound(plane.images[twice]) for plane in planes]
        for block in _blocks(planes):
            coded = np.empty((len(numbers), block.stop - block.start, len(planes)), np.float32)
            for channel, plane in enumerate(planes):
                with np.errstate(over="ignore", invalid="ignore"):
                    product = factors[channel] @ self._texels(plane, block).T
                coded[..., channel] = product[: len(numbers)]
                if plane.image_mean is not None:
                    coded[..., channel] += _sound(plane.image_mean[numbers])[:, None]
                if plane.texel_mean is not None:
                    coded[..., channel] += _sound(plane.texel_mean[block])
            out[rows, block] = _mended(decode(self._model, coded))

    def _texels(self, plane: Plane, block: slice) -> F4:
        if not self._keep:
            return _sound(plane.texels[block])
        place = _place(plane.texels)
        if place not in self._kept:
            self._kept[place] = _sound(plane.texels)
        return self._kept[place][block]


def _mended(values: F4) -> F4:
    """`btfcore.btf.stack.mended` in place, since negative values are the rule here."""
    np.fmax(values, 0, out=values)  # of NaN and 0 it takes 0
    if values.max() == np.inf:
        values[values == np.inf] = LARGEST_HALF
    return values


def _sound(values: NDArray[Any]) -> F4:
    """`values` as a new array of f4, with 0 for what is not finite then."""
    with np.errstate(over="ignore", invalid="ignore"):
        converted = values.astype(np.float32, order="C")
    if not np.isfinite(converted).all():
        np.nan_to_num(converted, copy=False, nan=0, posinf=0, neginf=0)
    return converted


def _not_finite(values: NDArray[Any]) -> int:
    """How many of `values` are not finite as f4, found block by block."""
    step = max(1, _NUMBERS // max(1, values[0].size))
    count = 0
    for start in range(0, len(values), step):
        with np.errstate(over="ignore", invalid="ignore"):
            block = values[start : start + step].astype(np.float32)
        count += block.size - int(np.isfinite(block).sum())
    return count


def _blocks(planes: tuple[Plane, ...]) -> Iterator[slice]:
    """Runs of texels; their length depends on nothing but the file."""
    texels = len(planes[0].texels)
    rank = max(plane.texels.shape[1] for plane in planes)
    step = max(1, min(_TEXELS, _NUMBERS // rank))
    for start in range(0, texels, step):
        yield slice(start, min(start + step, texels))


def _place(values: NDArray[Any]) -> tuple[Any, ...]:
    """Where in memory and how an array lies: the same for two views of the same numbers."""
    place = values.__array_interface__
    return place["data"][0], values.shape, values.strides, values.dtype.str
