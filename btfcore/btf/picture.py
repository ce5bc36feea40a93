"""One picture as a BTF of one view and one light."""

from __future__ import annotations

from pathlib import Path

from btfcore.btf.colour import srgb_to_linear
from btfcore.btf.image import read_image_notes
from btfcore.btf.readers.decode import decode_images
from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.image_files import coding_note, radiance
from btfcore.btf.readers.listing import FileSet
from btfcore.btf.sample import BtfSample, from_picture
from btfcore.progress import Progress, silent

DEEP = (".exr", ".hdr")


def read_picture(path: str | Path, *, progress: Progress = silent) -> BtfSample:
    """Read an image file as a sample with one view and one light, both along the normal.

    OpenEXR and Radiance files hold linear radiance, and may exceed 1; all others are read as
    `btfcore.btf.image.read_image` does. Raises `InvalidImage` or `GuardedFailure`.
    """
    path = Path(path)
    if path.suffix.lower() not in DEEP:
        picture, notes = read_image_notes(path, progress=progress)
        return from_picture(picture.name, srgb_to_linear(picture.colour), notes=notes)
    entry = Entry(path.name, path.stat().st_size)
    files = FileSet(path.name, path.resolve().parent, False, (entry,))
    raw = decode_images(files, [entry], progress=progress)[0]
    notes = (*raw.notes, coding_note(raw, "auto"))
    if any(raw.flaws):
        notes += (
            "took {0} NaN and {2} negative values as 0, and {1} infinite ones as 65504".format(
                *raw.flaws
            ),
        )
    return from_picture(path.stem, radiance(raw), notes=notes)
