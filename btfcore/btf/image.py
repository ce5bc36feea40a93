"""Image files and arrays as texture samples; decoding happens in a guarded child only."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from btfcore.errors import GuardedFailure, InvalidImage, PatinaError
from btfcore.guard import run_guarded
from btfcore.progress import Progress, silent
from btfcore.types import F4, Sample

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".tga")
MOST_PIXELS = 1 << 28
WORKING_PIXELS = 1 << 24
_LARGEST_FILE = 1 << 30
_POINTER = b"version https://git-lfs"
# A grey image's single channel lies as far apart as its three equal colours would.
_GREY = np.float32(np.sqrt(3))


def read_image(
    path: str | Path, *, limit_s: float = 60, limit_mb: int = 8192, progress: Progress = silent
) -> Sample:
    """Read a PNG, JPEG, TIFF, BMP, WebP or TGA file as a sample; see `read_image_notes`."""
    return read_image_notes(path, limit_s=limit_s, limit_mb=limit_mb, progress=progress)[0]


def read_image_notes(
    path: str | Path, *, limit_s: float = 60, limit_mb: int = 8192, progress: Progress = silent
) -> tuple[Sample, tuple[str, ...]]:
    """Read an image file as a sample, and say what was done to it.

    The format is recognised by content. Turned upright by its EXIF tag and brought to sRGB by
    its colour profile; 16-bit files keep their depth where Pillow can; the first picture of
    several counts. Transparent parts are laid over mid-grey (0.5). Up to 2^28 pixels are
    decoded, and more than 2^24 (4096 x 4096) are reduced to that, keeping the proportions.
    Grey images have one channel, sqrt(3) times the grey value, so that distances equal those
    of the colours; others have their three sRGB colours as channels.

    Raises `InvalidImage` where the file is missing, no such image, broken, or has too many
    pixels; `GuardedFailure` where the decoder crashed or outgrew `limit_s` seconds or
    `limit_mb` MiB. Messages begin with the file's name.
    """
    (result,) = _read([Path(path)], WORKING_PIXELS, None, limit_s, limit_mb, progress)
    if isinstance(result, PatinaError):
        raise result
    return result


def read_mask(
    path: str | Path, *, limit_s: float = 60, limit_mb: int = 8192, progress: Progress = silent
) -> F4:
    """Read an image file as a mask (H, W) f4 in 0–1.

    A colour counts as its greatest channel, so that red on black is a mask; what is transparent
    is 0. Where all that is opaque is black, the mask is what is opaque. Raises as
    `read_image_notes` does.
    """
    file = Path(path)
    over_black = _over(file, 0, limit_s, limit_mb, progress)
    if float(over_black.max()) > 0.5:
        return over_black
    # black on white is its own negative; on a transparent ground it is the mask
    over_white = _over(file, 255, limit_s, limit_mb, progress)
    return over_black if np.array_equal(over_black, over_white) else 1 - over_white


def _over(file: Path, ground: int, limit_s: float, limit_mb: int, progress: Progress) -> F4:
    """Greatest channel of an image whose transparent parts are laid over `ground` (0–255)."""
    (result,) = _read([file], WORKING_PIXELS, None, limit_s, limit_mb, progress, ground)
    if isinstance(result, PatinaError):
        raise result
    return np.ascontiguousarray(result[0].colour.max(axis=2))


def read_images(
    paths: Sequence[str | Path],
    *,
    max_side: int | None = None,
    limit_s: float = 120,
    limit_mb: int = 8192,
    progress: Progress = silent,
) -> list[Sample | PatinaError]:
    """Read many images in one child process: samples, or the error of each that failed.

    max_side : reduce every image to at most this many pixels a side (for thumbnails). Where
    one file brings the child down, the others are read without it.
    """
    files = [Path(path) for path in paths]
    results = _read(files, WORKING_PIXELS, max_side, limit_s, limit_mb, progress)
    return [item if isinstance(item, PatinaError) else item[0] for item in results]


def from_array(name: str, rgb: ArrayLike) -> Sample:
    """Make a sample of sRGB-coded colours, (H, W, 3) or grey (H, W): u1, u2 or floats in 0–1.

    Raises `InvalidImage` for another shape, no pixel, or values that are not finite or lie
    outside 0–1.
    """
    array = np.asarray(rgb)
    if array.ndim not in (2, 3) or array.size == 0 or (array.ndim == 3 and array.shape[2] != 3):
        raise InvalidImage(f"{name}: an array of shape {array.shape} is no (H, W, 3) image")
    if array.dtype == np.uint8 or array.dtype == np.uint16:
        values = array.astype(np.float32) / np.float32(np.iinfo(array.dtype).max)
    else:
        values = array.astype(np.float32)
        wrong = int((~((values >= 0) & (values <= 1))).sum())
        if wrong:
            raise InvalidImage(f"{name}: {wrong} values lie outside 0–1 or are not finite")
    if values.ndim == 2:
        colour = np.repeat(values[:, :, None], 3, axis=2)
        return Sample(name, colour, values[:, :, None] * _GREY)
    return Sample(name, values, values)


def _read(
    files: list[Path],
    working: int,
    max_side: int | None,
    limit_s: float,
    limit_mb: int,
    progress: Progress,
    ground: int | None = None,
) -> list[tuple[Sample, tuple[str, ...]] | PatinaError]:
    """Check the files, decode what is left in one child; halve the lot where that dies."""
    results: list[tuple[Sample, tuple[str, ...]] | PatinaError | None] = []
    for file in files:
        try:
            _check_file(file)
            results.append(None)
        except InvalidImage as error:
            results.append(InvalidImage(f"{file.name}: {error}"))
    open_places = [place for place, result in enumerate(results) if result is None]
    if open_places:
        chosen = [files[place] for place in open_places]
        decoded = _decode(chosen, working, max_side, limit_s, limit_mb, progress, ground)
        for place, item in zip(open_places, decoded, strict=True):
            results[place] = item
    return [result for result in results if result is not None]


def _decode(
    files: list[Path],
    working: int,
    max_side: int | None,
    limit_s: float,
    limit_mb: int,
    progress: Progress,
    ground: int | None,
) -> list[tuple[Sample, tuple[str, ...]] | PatinaError]:
    label = f"reading {files[0].name}" if len(files) == 1 else f"reading {len(files)} images"
    options = {
        "paths": [str(file.resolve()) for file in files],
        "most": MOST_PIXELS,
        "working": working,
        "max_side": max_side,
    }
    if ground is not None:
        options["ground"] = ground
    try:
        arrays, answer = run_guarded(
            "btfcore.btf.pillow_door:decode",
            {},
            options,
            limit_s=limit_s,
            limit_mb=limit_mb,
            progress=progress,
            label=label,
        )
    except GuardedFailure as error:
        if len(files) == 1:
            return [GuardedFailure(f"{files[0].name}: {error}")]
        half = len(files) // 2
        knobs = (working, max_side, limit_s, limit_mb, progress, ground)
        return _decode(files[:half], *knobs) + _decode(files[half:], *knobs)
    results: list[tuple[Sample, tuple[str, ...]] | PatinaError] = []
    for place, (file, entry) in enumerate(zip(files, answer["images"], strict=True)):
        if "error" in entry:
            results.append(InvalidImage(f"{file.name}: {entry['error']}"))
        else:
            results.append((from_array(file.stem, arrays[str(place)]), tuple(entry["notes"])))
    return results


def _check_file(file: Path) -> None:
    """Refuse what is no image at a glance, before a process is started for it."""
    try:
        if not file.exists():
            raise InvalidImage(f"there is no such file in {file.absolute().parent}")
        if file.is_dir():
            raise InvalidImage("this is a folder, not an image")
        if not file.is_file():
            raise InvalidImage("this is no regular file")
        size = file.stat().st_size
        if size == 0:
            raise InvalidImage("the file is empty (0 bytes)")
        if size > _LARGEST_FILE:
            raise InvalidImage(f"the file has {size:,} bytes, up to {_LARGEST_FILE:,} are read")
        with file.open("rb") as stream:
            head = stream.read(32)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidImage(f"the file cannot be opened: {error}") from error
    if head.startswith(_POINTER):
        raise InvalidImage("this is a Git LFS pointer, not the image itself: run `git lfs pull`")
