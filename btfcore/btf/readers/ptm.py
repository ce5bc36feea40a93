"""Polynomial texture maps: `.ptm` files and folders of coefficient images (RTI)."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.directions import layout
from btfcore.btf.readers.conditions import distinct
from btfcore.btf.readers.ptm_stack import PtmStack
from btfcore.btf.sample import NORMAL, BtfSample, full_index
from btfcore.errors import InvalidBtf, InvalidParameter, PatinaError
from btfcore.types import F8

MOST_TEXELS = 1 << 28
_HEADER = 4096
_BYTES = {"PTM_FORMAT_LRGB": 9, "PTM_FORMAT_RGB": 18}
_REFUSED = {
    "PTM_FORMAT_LUM": "luminance with chroma",
    "PTM_FORMAT_PTM_LUT": "indexed",
    "PTM_FORMAT_PTM_C_LUT": "indexed",
    "PTM_FORMAT_JPEG_RGB": "JPEG-packed",
    "PTM_FORMAT_JPEG_LRGB": "JPEG-packed",
    "PTM_FORMAT_JPEGLS_RGB": "JPEG-LS-packed",
    "PTM_FORMAT_JPEGLS_LRGB": "JPEG-LS-packed",
}
CODINGS = ("srgb", "linear")


def looks_like_ptm(path: str | Path) -> bool:
    """Whether `path` is a .ptm or .rti file by content, or a folder or zip with RTI images."""
    from btfcore.btf.readers import rti_folder

    given = Path(path)
    try:
        if given.is_file():
            with given.open("rb") as stream:
                head = stream.read(8)
            if head.startswith((b"PTM_", b"#HSH")):
                return True
        return rti_folder.looks_like(given)
    except (PatinaError, OSError, ValueError):
        return False


def read_ptm(
    path: str | Path, *, lights: ArrayLike | None = None, colour: str = "srgb"
) -> BtfSample:
    """Read a polynomial texture map as a BTF of one view, evaluated under `lights` on reading.

    `path` is a PTM_1.2 file with uncompressed LRGB or RGB coefficients, or a folder (or zip)
    with `info.json` and images `layer1` …: three for "LRGB_PTM" (a0–a2, a3–a5, colours), six
    for "RGB_PTM" (one coefficient of red, green and blue each).

    A PTM is continuous in the light. lights : unit vectors (L, 3) to turn it into images
    for; by default the 81 of UBO2003 ("ubo81", up to 75°: further out the polynomial is
    extrapolated). colour : what its values are. Maps are fitted to camera JPEGs and viewers
    show their values as they come, so "srgb" is the default; "linear" for maps fitted to
    linear data.

    Raises `InvalidBtf` where a file is cut off, contradicts itself or is packed in a way that
    is not read; `InvalidParameter` for lights or a colour that make no sense.
    """
    if colour not in CODINGS:
        raise InvalidParameter(f"colour {colour!r}: it is one of {', '.join(CODINGS)}")
    chosen = _lights(lights)
    given = Path(path)
    if given.is_file():
        with given.open("rb") as stream:
            archive = stream.read(4) == b"PK\x03\x04"
        if not archive:
            return _read_file(given, chosen, colour == "srgb")
    from btfcore.btf.readers.rti_folder import read_folder

    return read_folder(given, chosen, colour == "srgb")


def ptm_sample(
    name: str,
    coefficients: np.ndarray,
    colours: np.ndarray | None,
    scale: F8,
    bias: F8,
    lights: F8,
    coded: bool,
    notes: list[str],
) -> BtfSample:
    """Assemble the sample; arguments as for `PtmStack`."""
    stack = PtmStack(coefficients, colours, scale=scale, bias=bias, lights=lights, coded=coded)
    words = "sRGB-coded, as viewers show them" if coded else "linear"
    notes = [
        *notes,
        f"a polynomial in the light, evaluated under {len(lights)} lights; its values were taken"
        f" as {words}",
    ]
    index = full_index(1, len(lights))
    return BtfSample(name, stack, NORMAL.copy(), lights, index, origin="PTM", notes=tuple(notes))


def check_numbers(where: str, scale: F8, bias: F8) -> None:
    """Refuse scales and biases that cannot have been meant."""
    for kind, values in (("scale", scale), ("bias", bias)):
        if values.shape != (6,) or not (np.abs(values) < 1e9).all():
            raise InvalidBtf(f"{where}: its {kind} {values.tolist()[:8]} is not six small numbers")


def _read_file(path: Path, lights: F8, coded: bool) -> BtfSample:
    try:
        with path.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            head = stream.read(_HEADER)
        kind, width, height, scale, bias, start = _header(path.name, head)
        need = width * height * _BYTES[kind]
        if size - start < need:
            raise InvalidBtf(
                f"{path.name}: {width} x {height} texels of {kind} need {need:,} bytes, there are"
                f" {size - start:,} after the header"
            )
        data = np.memmap(path, np.uint8, "r", start, (need,))
    except (OSError, ValueError) as error:
        raise InvalidBtf(f"{path.name}: it cannot be read: {error}") from error
    notes = []
    if size - start > need:
        notes.append(f"ignored {size - start - need:,} bytes after its data")
    first = width * height * 6
    # rows run from bottom to top in the file
    if kind == "PTM_FORMAT_LRGB":
        coefficients = data[:first].reshape(height, width, 6)[::-1]
        colours = data[first:].reshape(height, width, 3)[::-1]
    else:
        coefficients = data.reshape(3, height, width, 6)[:, ::-1]
        colours = None
    return ptm_sample(path.stem, coefficients, colours, scale, bias, lights, coded, notes)


def _header(name: str, head: bytes) -> tuple[str, int, int, F8, F8, int]:
    """Format, width, height, scale (6,), bias (6,), and where the data begin."""
    version, at = _line(name, head, 0)
    if version.startswith("#HSH"):
        raise InvalidBtf(f"{name}: a hemispherical-harmonics RTI; only PTM files are read")
    if version != "PTM_1.2":
        raise InvalidBtf(f"{name}: begins with {version[:20]!r}, only PTM_1.2 is read")
    kind, at = _line(name, head, at)
    if kind in _REFUSED:
        raise InvalidBtf(f"{name}: {kind} ({_REFUSED[kind]}) is not read, only LRGB and RGB")
    if kind not in _BYTES:
        raise InvalidBtf(f"{name}: unknown format {kind[:40]!r}")
    words: list[str] = []
    while (
        len(words) < 14
    ):  # width, height, six scales and six biases, on as many lines as they like
        text, at = _line(name, head, at)
        words += text.split()
    if len(words) > 14:
        raise InvalidBtf(f"{name}: its header holds {len(words)} numbers instead of 14")
    numbers = np.array([_number(name, word) for word in words])
    width, height = (int(word) if word.isdecimal() else 0 for word in words[:2])
    if min(width, height) < 1 or width * height > MOST_TEXELS:
        raise InvalidBtf(f"{name}: a size of {words[0][:20]} x {words[1][:20]} texels")
    check_numbers(name, numbers[2:8], numbers[8:14])
    return kind, width, height, numbers[2:8], numbers[8:14], at


def _line(name: str, head: bytes, start: int) -> tuple[str, int]:
    end = head.find(b"\n", start)
    if end < 0:
        raise InvalidBtf(f"{name}: its header breaks off after {len(head):,} bytes")
    return head[start:end].decode("latin-1").strip(), end + 1


def _number(name: str, word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or len(word) > 40:
        raise InvalidBtf(f"{name}: {word[:40]!r} in its header is no number")
    return value


def _lights(lights: ArrayLike | None) -> F8:
    if lights is None:
        return np.array(layout("ubo81").lights)
    try:
        chosen = np.array(lights, np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidParameter(f"lights: {error}") from error
    if chosen.ndim != 2 or chosen.shape[1] != 3 or len(chosen) == 0:
        raise InvalidParameter(f"lights of shape {chosen.shape}, (L, 3) is needed")
    length = np.linalg.norm(chosen, axis=1)
    if not (np.abs(length - 1) < 1e-4).all() or (chosen[:, 2] < 0).any():
        raise InvalidParameter("lights are unit vectors above the surface (z >= 0)")
    if len(distinct(chosen)[0]) < len(chosen):
        raise InvalidParameter("two of the lights are the same")
    return chosen
