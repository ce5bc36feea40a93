"""Thousands of image files or zip members as the images of a BTF, decoded when asked for."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.colour import srgb_to_linear, xyz_to_linear
from btfcore.btf.materialize import Flaws
from btfcore.btf.readers.decode import Raw, decode_images
from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.listing import FileSet
from btfcore.btf.stack import mended
from btfcore.errors import InvalidParameter
from btfcore.types import F4

COLOURS = ("auto", "srgb", "linear", "xyz")
_CACHE_MB = 48.0


class ImageFiles:
    """J images of one size in a folder or zip archive, number j being `entries[j]`.

    colour : what the stored numbers are: "srgb", "linear" Rec. 709, "xyz" (CIE XYZ, D65), or
    "auto": integers sRGB, floats XYZ where their file says so, else what `floats` says.
    first : the image `probe`, already decoded, which settles the size.
    Reading in ascending order decodes ahead, so that child processes are started for some 48
    MiB of raw pixels each. `flaws` counts, in the images read so far, what `read` mended: NaN,
    infinite and negative values. Safe to use from several threads.
    """

    def __init__(
        self,
        files: FileSet,
        entries: Sequence[Entry],
        first: Raw,
        *,
        probe: int = 0,
        colour: str = "auto",
        floats: str = "linear",
        cache_mb: float = _CACHE_MB,
    ) -> None:
        """Refer to the files; nothing is read. Raises `InvalidParameter` for another colour."""
        check_colour(colour)
        self._files = files
        self._entries = tuple(entries)
        self._size = first.values.shape[:2]
        self._colour = colour
        self._floats = floats
        self._batch = max(1, int(cache_mb * 2**20 / max(first.values.nbytes, 1)))
        self._cache = {probe: first}
        self._flaws = {probe: first.flaws}
        self._next = 0
        self._lock = threading.Lock()

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of images, rows, columns."""
        return len(self._entries), *self._size

    @property
    def dear(self) -> bool:
        """Reading decodes."""
        return True

    @property
    def flaws(self) -> Flaws:
        """What `read` had to mend in the images read so far."""
        counts = np.array(list(self._flaws.values()) or [(0, 0, 0)]).sum(axis=0)
        return Flaws(int(counts[0]), int(counts[1]), int(counts[2]))

    def read(self, numbers: ArrayLike) -> F4:
        """Images `numbers` (n,) as (n, H, W, 3) f4 linear radiance, finite and not negative.

        Raises `InvalidImage`, `InvalidBtf` or `GuardedFailure`, with the name of the file that
        could not be read.
        """
        wanted = np.atleast_1d(np.asarray(numbers, np.int64))
        count = len(self._entries)
        if wanted.size and not -count <= wanted.min() <= wanted.max() < count:
            raise IndexError(f"image {wanted.min()} … {wanted.max()} of {count}")
        wanted %= count
        out = np.empty((len(wanted), *self._size, 3), np.float32)
        with self._lock:
            remaining = wanted
            while len(remaining):
                self._fetch(remaining)
                known = np.array([number in self._cache for number in remaining.tolist()])
                for number in np.unique(remaining[known]).tolist():
                    out[wanted == number] = self._radiance(number)
                remaining = remaining[~known]
        return out

    def _fetch(self, wanted: np.ndarray) -> None:
        """Make sure that at least one of `wanted` is in the cache, with what may come next."""
        if any(number in self._cache for number in wanted.tolist()):
            return
        batch = list(dict.fromkeys(wanted.tolist()))[: self._batch]
        if len(batch) > 1 or batch[0] == self._next:
            following = range(batch[-1] + 1, len(self._entries))
            batch += [number for number in following if number not in batch][
                : self._batch - len(batch)
            ]
        self._next = batch[-1] + 1
        found = decode_images(
            self._files, [self._entries[number] for number in batch], size=self._size
        )
        self._cache = dict(zip(batch, found, strict=True))
        self._flaws.update({number: raw.flaws for number, raw in self._cache.items()})

    def _radiance(self, number: int) -> F4:
        return radiance(self._cache[number], self._colour, self._floats)


def check_colour(colour: str) -> None:
    """Raise `InvalidParameter` for what is no colour coding of `ImageFiles`."""
    if colour not in COLOURS:
        raise InvalidParameter(f"colour {colour!r}: it is one of {', '.join(COLOURS)}")


def radiance(raw: Raw, colour: str = "auto", floats: str = "linear") -> F4:
    """Linear Rec. 709 radiance (H, W, 3) f4 of a decoded image; see `ImageFiles`."""
    values = raw.values
    if values.ndim == 2:
        values = np.repeat(values[:, :, None], 3, axis=2)
    whole = values.dtype.kind == "u"
    if colour == "auto":
        colour = "srgb" if whole else "xyz" if raw.meaning == "xyz" else floats
    if colour == "srgb":
        return mended(srgb_to_linear(values if whole else np.nan_to_num(mended(values))))
    with np.errstate(over="ignore", invalid="ignore"):
        linear = values.astype(np.float32)
        if whole:
            linear /= np.float32(np.iinfo(values.dtype).max)
        if colour == "xyz":
            linear = xyz_to_linear(mended(linear))
    return mended(linear)


def coding_note(first: Raw, colour: str, floats: str = "linear") -> str:
    """Say what the values of a set are taken as."""
    if colour == "auto":
        whole = first.values.dtype.kind == "u"
        colour = "srgb" if whole else "xyz" if first.meaning == "xyz" else floats
    words = {"srgb": "sRGB-coded", "linear": "linear Rec. 709", "xyz": "CIE XYZ under D65"}
    return f"took its {first.values.dtype.itemsize * 8}-bit values as {words[colour]}"


def probed(files: FileSet, entry: Entry) -> Raw:
    """Decode one image of a set, to learn size and kind of all."""
    return decode_images(files, [entry])[0]
