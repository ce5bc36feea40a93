"""Image files out through OpenImageIO: OpenEXR, Radiance HDR and JPEG; encoding only."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from btfcore.btf.colour import linear_to_srgb
from btfcore.errors import InvalidParameter, OutputFailed

LARGEST_HALF = 65504.0
_REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)


def encode_exr(image: NDArray[np.floating[Any]], *, half: bool = True) -> bytes:
    """OpenEXR file of linear Rec. 709 radiance (H, W, 3 or 4), ZIP-packed without loss.

    A fourth band is alpha, with which the others are premultiplied, as OpenEXR has it. half :
    16-bit floats, in which values beyond 65504 become 65504; else 32-bit floats. The
    chromaticities are written down.
    """
    values = np.asarray(image, np.float32)
    if half:
        values = np.clip(values, -LARGEST_HALF, LARGEST_HALF)
    kind = "half" if half else "float"
    return _encoded(values, "exr", kind, {"compression": "zip"}, bands=(3, 4))


def encode_hdr(image: NDArray[np.floating[Any]]) -> bytes:
    """Radiance HDR file of (H, W, 3) linear values of 0 or more: 8 bits and a shared exponent."""
    return _encoded(np.asarray(image, np.float32), "hdr", "float", {})


def encode_jpeg(image: NDArray[np.floating[Any]], *, quality: int = 95) -> bytes:
    """sRGB-coded JPEG of linear radiance (H, W, 3), clipped to 0–1; full chroma resolution."""
    if not 1 <= quality <= 100:
        raise InvalidParameter(f"a JPEG quality of {quality}, it is 1 to 100")
    coded = np.rint(linear_to_srgb(np.asarray(image, np.float32)) * 255).astype(np.uint8)
    settings = {"compression": f"jpeg:{quality}", "jpeg:subsampling": "4:4:4"}
    return _encoded(coded, "jpg", "uint8", settings)


def _encoded(
    values: NDArray[Any],
    ending: str,
    kind: str,
    settings: dict[str, str],
    bands: tuple[int, ...] = (3,),
) -> bytes:
    if values.ndim != 3 or values.shape[2] not in bands or values.size == 0:
        needed = " or ".join(map(str, bands))
        raise InvalidParameter(f"an image of shape {values.shape}, (H, W, {needed}) is needed")
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], values.shape[2], kind)
    if values.shape[2] == 4:
        spec.channelnames, spec.alpha_channel = ("R", "G", "B", "A"), 3
    for key, value in settings.items():
        spec.attribute(key, value)
    if ending == "exr":
        spec.attribute("chromaticities", oiio.TypeDesc("float[8]"), _REC709)
        spec.attribute("DateTime", "1980:01:01 00:00:00")  # not the clock: same image, same bytes
    with TemporaryDirectory(prefix="patina-") as folder:  # OpenImageIO writes to named files only
        path = Path(folder) / f"image.{ending}"
        target = oiio.ImageOutput.create(str(path))
        if target is None or not target.open(str(path), spec):
            raise OutputFailed(f"an image could not be encoded: {oiio.geterror()}")
        written = target.write_image(np.ascontiguousarray(values))
        if not target.close() or not written:
            raise OutputFailed(f"an image could not be encoded: {target.geterror()}")
        return path.read_bytes()
