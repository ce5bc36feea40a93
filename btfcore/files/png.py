"""PNG out: encoding only (files are decoded in a guarded child, elsewhere)."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from btfcore.errors import InvalidParameter


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """PNG of an (H, W), (H, W, 3) or (H, W, 4) u8 image, row 0 on top, sRGB-coded.

    No colour chunk is written: readers take plain PNG as sRGB, and glTF forbids others.
    """
    kinds = ((), (3,), (4,))
    if image.dtype != np.uint8 or image.ndim < 2 or image.shape[2:] not in kinds:
        raise InvalidParameter(f"a PNG needs (H, W[, 3 or 4]) u8, got {image.shape} {image.dtype}")
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="PNG", compress_level=6)
    return stream.getvalue()
