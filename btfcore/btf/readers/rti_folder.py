"""RTI for the web: `info.json` and coefficient images, as WebRTI and rti.js keep them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from btfcore.btf.readers.decode import decode_images
from btfcore.btf.readers.listing import FileSet, list_files
from btfcore.btf.readers.members import read_bytes
from btfcore.btf.readers.ptm import check_numbers, ptm_sample
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf, PatinaError
from btfcore.types import F8

_INFO = "info.json"
_LARGEST_INFO = 1 << 20
_IMAGES = (".png", ".jpg", ".jpeg")
_LAYERS = {"LRGB_PTM": 3, "RGB_PTM": 6}


def looks_like(path: Path) -> bool:
    """Whether a folder or zip holds an `info.json` and the images `layer1` and `layer2`."""
    try:
        files = list_files(path)
    except PatinaError:
        return False
    names = {entry.name.rpartition(".")[0].lower() for entry in files.ending(*_IMAGES)}
    return any(
        {f"{folder}layer1", f"{folder}layer2"} <= names or f"{folder}plane_0" in names
        for folder in _folders(files)
    )


def read_folder(path: Path, lights: F8, coded: bool) -> BtfSample:
    """Read such a folder or zip; see `btfcore.btf.readers.ptm.read_ptm`."""
    files = list_files(path)
    folders = _folders(files)
    if len(folders) != 1:
        raise InvalidBtf(f"{files.name}: one info.json is needed, found {len(folders)}")
    wanted = (folders[0] + _INFO).lower()
    entry = next(each for each in files.entries if each.name.lower() == wanted)
    where = f"{files.name}: {entry.name}"
    info = _parsed(where, read_bytes(files.place, entry, most=_LARGEST_INFO))
    count, scale, bias = _numbers(where, info)
    named = {each.name.rpartition(".")[0].lower(): each for each in files.ending(*_IMAGES)}
    layers = []
    for number in range(1, count + 1):
        found = named.get(f"{folders[0].lower()}layer{number}")
        if found is None:
            raise InvalidBtf(f"{files.name}: the image layer{number} is missing")
        layers.append(found)
    first = decode_images(files, layers[:1], icc=False)[0]
    size = (first.values.shape[0], first.values.shape[1])
    raws = [first, *decode_images(files, layers[1:], size=size, icc=False)]
    for layer, raw in zip(layers, raws, strict=True):
        if raw.values.dtype != np.uint8 or raw.values.ndim != 3:
            raise InvalidBtf(f"{files.name}: {layer.name} is no 8-bit RGB image")
    planes = [raw.values for raw in raws]
    notes = [f"{entry.base}: {info['type']}"]
    if any(layer.suffix != ".png" for layer in layers):
        notes.append("its coefficients are JPEG-packed, which adds noise")
    if count == 3:
        coefficients = np.concatenate(planes[:2], axis=2)
        return ptm_sample(files.name, coefficients, planes[2], scale, bias, lights, coded, notes)
    coefficients = np.moveaxis(np.stack(planes, axis=3), 2, 0)  # (3, H, W, 6)
    return ptm_sample(files.name, coefficients, None, scale, bias, lights, coded, notes)


def _folders(files: FileSet) -> list[str]:
    """Folders with an `info.json`, each "" or ending with "/", those highest up only."""
    found = [
        entry.name[: -len(entry.base)] for entry in files.entries if entry.base.lower() == _INFO
    ]
    top = min((folder.count("/") for folder in found), default=0)
    return sorted(folder for folder in found if folder.count("/") == top)


def _parsed(where: str, data: bytes) -> dict[str, Any]:
    """Return the part of the JSON that describes the map."""
    try:
        info = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InvalidBtf(f"{where}: no JSON: {str(error)[:100]}") from error
    part = info.get("PTM", info) if isinstance(info, dict) else info
    if not isinstance(part, dict):
        raise InvalidBtf(f"{where}: describes no RTI")
    return part


def _numbers(where: str, info: dict[str, Any]) -> tuple[int, F8, F8]:
    """Layers, scale (6,) and bias (6,)."""
    kind = info.get("type")
    if not isinstance(kind, str) or kind not in _LAYERS:
        raise InvalidBtf(
            f"{where}: type {str(kind)[:40]!r} is not read, only {' and '.join(_LAYERS)}"
        )
    out = []
    for key in ("scale", "bias"):
        values = info.get(key)
        plain = isinstance(values, list) and all(
            isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9
            for value in values
        )
        if not plain:
            raise InvalidBtf(f"{where}: its {key} {str(values)[:60]} is not six small numbers")
        out.append(np.array(values, np.float64))
    check_numbers(where, *out)
    return _LAYERS[kind], out[0], out[1]
