"""Writes a BTF as a zip of images named as in UBO2003, with an exact table where that needs one."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.materialize import blocks
from btfcore.btf.readers.conditions import to_angles
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidParameter
from btfcore.files import exr
from btfcore.files.atomic import atomic_output
from btfcore.files.png import encode_png
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8

TABLE = "directions.csv"
_DATE = (1980, 1, 1, 0, 0, 0)  # the same sample makes the same bytes
_WHOLE = 1e-6  # degrees


def _png(image: F4) -> bytes:
    coded: NDArray[Any] = np.rint(linear_to_srgb(image) * 255)
    return encode_png(coded.astype(np.uint8))


# Ending, encoder, and the largest radiance that survives.
KINDS: dict[str, tuple[str, Callable[[F4], bytes], float]] = {
    "png": ("png", _png, 1.0),
    "jpeg": ("jpg", exr.encode_jpeg, 1.0),
    "hdr": ("hdr", exr.encode_hdr, np.inf),
    "exr": ("exr", exr.encode_exr, exr.LARGEST_HALF),
    "exr-float": ("exr", lambda image: exr.encode_exr(image, half=False), np.inf),
}


def write_bonn_zip(
    path: str | Path,
    sample: BtfSample,
    *,
    kind: str = "png",
    block_mb: float = 64,
    progress: Progress = silent,
) -> tuple[str, ...]:
    """Write `sample` as a zip of images `tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.png`.

    kind : "png" or "jpeg" (8 bits, sRGB-coded, radiance clipped at 1), "exr" (half floats,
    up to 65504), "exr-float", or "hdr" (ATRIUM's). Angles in names are whole degrees; where
    a direction is not, `directions.csv` with exact vectors is added, which our reader
    follows. Missing conditions are left out. Images pass through in blocks of `block_mb` MiB.

    Returns notes: what was clipped, and what of the sample such a zip cannot hold. Raises
    `InvalidParameter` for another kind, `OutputFailed` where the file cannot be written; an
    older file under `path` then stays as it was.
    """
    if kind not in KINDS:
        raise InvalidParameter(f"kind {kind!r}: it is one of {', '.join(KINDS)}")
    ending, encode, largest = KINDS[kind]
    names, exact = _names(sample, ending)
    clipped = done = 0
    with atomic_output(path) as handle, zipfile.ZipFile(handle, "w", allowZip64=True) as archive:
        if not exact:
            _add(archive, TABLE, _table(sample, names))
        for numbers in blocks(sample.stack, block_mb=block_mb):
            images = sample.stack.read(numbers)
            clipped += int((images > largest).sum())
            for number, image in zip(numbers.tolist(), images, strict=True):
                _add(archive, names[number], encode(image))
                done += 1
                progress(done / sample.images, "writing images")
    return tuple(_notes(sample, kind, largest, clipped, exact))


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name, _DATE), data)  # stored: images are packed already


def _names(sample: BtfSample, ending: str) -> tuple[list[str], bool]:
    """Names of the images, and whether whole degrees say all about the directions."""
    angles = [to_angles(vectors) for vectors in (sample.views, sample.lights)]
    whole = [np.rint(each).astype(int) for each in angles]
    exact = True
    for given, rounded in zip(angles, whole, strict=True):
        exact &= bool(np.abs(given - rounded).max() < _WHOLE)
        rounded[:, 1] %= 360
    names = []
    for number, (view, light) in enumerate(sample.pairs().tolist()):
        (tv, pv), (tl, pl) = whole[0][view], whole[1][light]
        names.append(
            f"tv{tv:03d}_pv{pv:03d}/{number:05d} tl{tl:03d} pl{pl:03d} tv{tv:03d} pv{pv:03d}"
            f".{ending}"
        )
    return names, exact


def _table(sample: BtfSample, names: list[str]) -> bytes:
    def row(vector: F8) -> str:
        return ",".join(repr(float(value)) for value in vector)

    lines = ["file,vx,vy,vz,lx,ly,lz"]
    for name, (view, light) in zip(names, sample.pairs().tolist(), strict=True):
        lines.append(f"{name},{row(sample.views[view])},{row(sample.lights[light])}")
    return ("\n".join(lines) + "\n").encode()


def _notes(sample: BtfSample, kind: str, largest: float, clipped: int, exact: bool) -> list[str]:
    notes = []
    if clipped:
        notes.append(f"clipped {clipped:,} values above {largest:g}, the most that {kind} holds")
    if not exact:
        notes.append(f"directions are not whole degrees: {TABLE} holds them exactly")
    if sample.missing:
        notes.append(f"{sample.missing} conditions without an image were left out")
    lost = [
        word
        for word, there in (
            ("mask", sample.mask is not None),
            ("factors", sample.factors is not None),
            ("texel size", sample.texel_size is not None),
            ("tiling", sample.tiles),
            ("licence", bool(sample.licence)),
            ("citation", bool(sample.citation)),
            ("that the cosine is divided out", not sample.cosine),
        )
        if there
    ]
    if lost:
        notes.append(f"such a zip cannot hold: {', '.join(lost)}")
    return notes
