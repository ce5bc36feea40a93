"""The door to OpenImageIO's decoders, for images that Pillow would flatten; child processes only.

OpenEXR, Radiance HDR, 16-bit PNG and TIFF: values come out as they are stored, no colour
transform and no premultiplied alpha; what is not finite or negative stays in.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from btfcore.btf.pillow_door import check_size
from btfcore.errors import InvalidImage
from btfcore.guard import Options

KINDS = {
    "openexr": (".exr", (b"v/1\x01",)),
    "hdr": (".hdr", (b"#?RADIANCE", b"#?RGBE")),
    "tiff": (".tif", (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
    "png": (".png", (b"\x89PNG\r\n\x1a\n",)),
}
_TYPES = {"uint8": "uint8", "uint16": "uint16", "half": "half", "float": "float"}
_XYZ = ((1, 0), (0, 1), (0, 0), (1 / 3, 1 / 3))  # chromaticities that make RGB mean XYZ
_REC709 = ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.329))


def kind_of(head: bytes) -> str | None:
    """Format that a file beginning with `head` (32 bytes) should be read as here, or None.

    PNGs of up to 8 bits are Pillow's.
    """
    for kind, (_, magics) in KINDS.items():
        if head.startswith(magics):
            return None if kind == "png" and head[24:25] != b"\x10" else kind
    return None


def raw_picture(
    path: Path, kind: str, options: Options, notes: list[str]
) -> tuple[NDArray[Any], str] | None:
    """Pixels of `path` as stored, (H, W, 3) or (H, W), u1, u2, f2 or f4, and what they mean.

    None for a TIFF of 8 bits, whose palettes and profiles Pillow knows better.

    `path` must have the ending of its `kind`. The meaning is "xyz" or "rec709" where the
    channels' names or chromaticities say so, else "". An EXR's data window is laid into its
    display window, black around it. options as in `btfcore.btf.pillow_door.raw_picture`.
    Raises `InvalidImage`.
    """
    oiio.attribute("imageinput:strict", 1)  # no other decoder may try its luck
    oiio.attribute("threads", 1)
    oiio.attribute("exr_threads", -1)  # threads would cost address space, which is limited
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(path), config)
    if source is None:
        raise InvalidImage(f"the {kind} file is broken or cut off ({_said(oiio.geterror(), path)})")
    try:
        if kind == "tiff" and str(source.spec().format) == "uint8":
            return None
        if source.format_name() != kind:
            raise InvalidImage(f"begins like {kind}, but is read as {source.format_name()}")
        part, places, meaning = _part(source, notes)
        spec = source.spec()
        for width, height in {(spec.width, spec.height), (spec.full_width, spec.full_height)}:
            check_size(width, height, {**options, "size": None})
        check_size(spec.full_width, spec.full_height, options)
        if max(spec.depth, spec.full_depth) > 1:
            raise InvalidImage(f"a volume of {spec.depth} layers")
        low, high = min(places), max(places) + 1
        kind_of_number = _TYPES.get(str(spec.format), "float")
        values = source.read_image(part, 0, low, high, oiio.TypeDesc(kind_of_number))
        if values is None:
            said = _said(source.geterror(), path)
            raise InvalidImage(f"the {kind} file is broken or cut off ({said})")
    finally:
        source.close()
    values = np.asarray(values).reshape(spec.height, spec.width, high - low)
    values = values[:, :, [place - low for place in places]]
    window = _windowed(values, spec, notes)
    turned = _turned(window, int(spec.getattribute("Orientation") or 1))
    return np.ascontiguousarray(turned[:, :, 0] if len(places) == 1 else turned), meaning


def _part(source: Any, notes: list[str]) -> tuple[int, list[int], str]:
    """Choose the part and channels to read; leaves `source` at that part."""
    seen = []
    for part in range(64):
        if not source.seek_subimage(part, 0):
            break
        spec = source.spec()
        if spec.deep:
            seen.append("deep data")
            continue
        found = _channels(spec)
        if found is None:
            seen.append("channels " + ", ".join(spec.channelnames[:8]))
            continue
        if part:
            notes.append(f"took part {part + 1} of the file")
        if spec.nchannels > len(found[0]):
            used = {spec.channelnames[place] for place in found[0]}
            left = [name for name in spec.channelnames if name not in used]
            notes.append(f"left out channels {', '.join(left[:6])}")
        return part, *found
    raise InvalidImage(f"no colour channels R, G, B or X, Y, Z or Y, only {'; '.join(seen[:4])}")


def _channels(spec: Any) -> tuple[list[int], str] | None:
    """Places of the colour channels and what they mean, or None."""
    names = [name.upper() for name in spec.channelnames]
    if "RY" in names or "BY" in names:
        return None  # luminance with subsampled chroma
    for triple, meaning in (("RGB", ""), ("XYZ", "xyz")):
        if all(name in names for name in triple):
            return [names.index(name) for name in triple], meaning or _primaries(spec)
    layers = dict.fromkeys(name.rpartition(".")[0] for name in names if name.endswith(".R"))
    for layer in layers:
        if all(f"{layer}.{name}" in names for name in "RGB"):
            return [names.index(f"{layer}.{name}") for name in "RGB"], _primaries(spec)
    if "Y" in names:
        return [names.index("Y")], ""
    return ([0], "") if spec.nchannels <= 2 else None


def _primaries(spec: Any) -> str:
    stated = spec.getattribute("chromaticities")
    if stated is None or len(stated) != 8:
        return ""
    pairs = np.asarray(stated, np.float64).reshape(4, 2)
    for wanted, meaning in ((_XYZ, "xyz"), (_REC709, "rec709")):
        if np.abs(pairs - np.asarray(wanted))[: 3 if meaning == "xyz" else 4].max() < 2e-3:
            return meaning
    return ""


def _windowed(values: NDArray[Any], spec: Any, notes: list[str]) -> NDArray[Any]:
    """Lay the data window into the display window."""
    left, top = spec.x - spec.full_x, spec.y - spec.full_y
    size = (spec.full_height, spec.full_width)
    if (left, top) == (0, 0) and size == values.shape[:2]:
        return values
    notes.append(
        f"laid its {spec.width} x {spec.height} pixels at ({left}, {top}) into its display"
        f" window of {size[1]} x {size[0]}"
    )
    out = np.zeros((*size, values.shape[2]), values.dtype)
    rows = slice(max(top, 0), max(min(top + spec.height, size[0]), 0))
    columns = slice(max(left, 0), max(min(left + spec.width, size[1]), 0))
    if rows.start < rows.stop and columns.start < columns.stop:
        out[rows, columns] = values[
            rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
        ]
    return out


def _turned(values: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Undo the turn that an EXIF-like `orientation` (1–8) states."""
    if orientation in (5, 6, 7, 8):
        values = values.swapaxes(0, 1)
    flips = {2: (1,), 3: (0, 1), 4: (0,), 6: (1,), 7: (0, 1), 8: (0,)}
    return np.flip(values, flips.get(orientation, ()))


def _said(reason: str, path: Path) -> str:
    """OpenImageIO's own words on one line, without the name of a scratch file."""
    return " ".join(reason.replace(str(path), path.name).split())[:300] or "no reason given"
