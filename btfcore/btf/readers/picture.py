"""A single image file, of any depth, as a BTF of one view and one light."""

from __future__ import annotations

from pathlib import Path

from btfcore.btf.readers.decode import IMAGES, MOST_PIXELS, decode_images
from btfcore.btf.readers.image_files import check_colour, coding_note, radiance
from btfcore.btf.readers.listing import pick_files
from btfcore.btf.sample import BtfSample, from_picture
from btfcore.errors import InvalidImage
from btfcore.progress import Progress, silent


def looks_like_picture(path: str | Path) -> bool:
    """Whether `path` is a file with an image's ending."""
    given = Path(path)
    try:
        return given.suffix.lower() in IMAGES and given.is_file()
    except (OSError, ValueError):
        return False


def read_picture(
    path: str | Path, *, colour: str = "auto", most: int = MOST_PIXELS, progress: Progress = silent
) -> BtfSample:
    """Read a PNG, JPEG, EXR, HDR, TIFF, BMP, WebP or TGA file as a sample of one image.

    Deep and float images keep their depth and range. colour : "srgb", "linear", "xyz", or
    "auto" (integers sRGB, floats linear unless they say XYZ). NaN, infinite and negative
    values are mended, with a note. most : pixels that are read at all.

    Raises `InvalidImage` or `GuardedFailure`, beginning with the file's name.
    """
    check_colour(colour)
    given = Path(path)
    files = pick_files(given.absolute().parent, [given.name])
    if not files.entries:
        raise InvalidImage(f"{given.name}: there is no such file")
    raw = decode_images(files, files.entries, most=most, free=1 << 24, progress=progress)[0]
    notes = [*raw.notes, coding_note(raw, colour)]
    if any(raw.flaws):
        nan, infinite, negative = raw.flaws
        notes.append(f"mended {nan} NaN, {infinite} infinite and {negative} negative values")
    return from_picture(given.stem, radiance(raw, colour), origin="image", notes=tuple(notes))
