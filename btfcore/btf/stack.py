"""The images of a BTF, read in blocks: from an array, a mapped file, or made when asked for."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from btfcore.btf.colour import srgb_to_linear
from btfcore.errors import InvalidBtf
from btfcore.types import F4

LARGEST_HALF = 65504.0


@runtime_checkable
class ImageStack(Protocol):
    """J images of one size as linear radiance, whatever they are kept as.

    `shape` is (J, H, W); `dear` says that reading decodes or computes, so that work which
    reads more than once should `btfcore.btf.materialize` the stack first.
    """

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""

    @property
    def dear(self) -> bool:
        """Whether reading costs more than copying."""

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance, finite and not negative."""


class ArrayStack:
    """Images kept as an array or a mapped file.

    images : (J, H, W, 3); u1 and u2 are sRGB-coded (or linear, with `linear`), floats are
    linear radiance. scale : (J,) f4 factors of the images, or None. sound : the values are
    known to be finite and not negative, so that `read` need not mend them; otherwise it takes
    NaN and negative values as 0 and infinite ones as 65504 (count them with `flaws`).
    """

    def __init__(
        self,
        images: NDArray[Any],
        *,
        linear: bool = False,
        scale: F4 | None = None,
        sound: bool = False,
    ) -> None:
        """Hold `images`; raises `InvalidBtf` for another shape or kind of number."""
        if images.ndim != 4 or images.shape[3] != 3 or 0 in images.shape:
            raise InvalidBtf(f"images of shape {images.shape}, where (J, H, W, 3) is needed")
        if images.dtype.kind not in "uf" or (
            images.dtype.kind == "u" and images.dtype.itemsize > 2
        ):
            raise InvalidBtf(f"images of {images.dtype}, where u1, u2 or floats are needed")
        self.images = images
        self.linear = linear
        self.scale = scale
        self.sound = sound or images.dtype.kind == "u"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        count, height, width, _ = self.images.shape
        return count, height, width

    @property
    def dear(self) -> bool:
        """Copying is all that reading does."""
        return False

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance."""
        raw = self.raw(numbers)
        return raw if self.sound else mended(raw)

    def raw(self, numbers: ArrayLike) -> F4:
        """Like `read`, but with whatever is not finite or negative left in."""
        chosen = np.asarray(numbers, np.int64)
        block = self.images[chosen]
        if block.dtype.kind == "u" and not self.linear:
            values = srgb_to_linear(block)
        elif block.dtype.kind == "u":
            values = block.astype(np.float32) / np.float32(np.iinfo(block.dtype).max)
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # hostile values are mended later
                values = block.astype(np.float32)
        if self.scale is not None:
            with np.errstate(over="ignore", invalid="ignore"):
                values *= self.scale[chosen, None, None, None]
        return values


class CropStack:
    """A window of another stack's images: rows and columns as slices with step 1."""

    def __init__(self, stack: ImageStack, rows: slice, columns: slice) -> None:
        """Look at `stack` through the window; raises `InvalidBtf` where it is empty."""
        count, height, width = stack.shape
        self._stack = stack
        self._rows = slice(*rows.indices(height))
        self._columns = slice(*columns.indices(width))
        size = (self._rows.stop - self._rows.start, self._columns.stop - self._columns.start)
        if min(size) <= 0 or self._rows.step != 1 or self._columns.step != 1:
            raise InvalidBtf(f"a crop of {size[1]} x {size[0]} texels out of {width} x {height}")
        self._shape = (count, *size)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns of the window."""
        return self._shape

    @property
    def dear(self) -> bool:
        """As dear as what is behind it."""
        return self._stack.dear

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, h, w, 3) f4 linear radiance."""
        whole = self._stack.read(numbers)
        return np.ascontiguousarray(whole[:, self._rows, self._columns])


class SubsetStack:
    """Some images of another stack, in an order of their own."""

    def __init__(self, stack: ImageStack, numbers: ArrayLike) -> None:
        """Number anew the images `numbers` of `stack`."""
        self._stack = stack
        self._numbers = np.asarray(numbers, np.int64)
        self._shape = (len(self._numbers), *stack.shape[1:])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return self._shape

    @property
    def dear(self) -> bool:
        """As dear as what is behind it."""
        return self._stack.dear

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) of the subset as (n, H, W, 3) f4 linear radiance."""
        return self._stack.read(self._numbers[np.asarray(numbers, np.int64)])


def mended(values: F4) -> F4:
    """Return `values` with NaN and negative ones as 0 and infinite ones as 65504."""
    low, high = float(values.min(initial=0)), float(values.max(initial=0))
    if low >= 0 and high < np.inf:  # false where either is NaN
        return values
    return np.clip(np.nan_to_num(values, nan=0, posinf=LARGEST_HALF, neginf=0), 0, None)


def block_size(stack: ImageStack, *, budget_mb: float) -> int:
    """How many images of `stack` fit into `budget_mb` MiB as f4, at least one."""
    _, height, width = stack.shape
    return max(1, int(budget_mb * 2**20 / (height * width * 12)))
