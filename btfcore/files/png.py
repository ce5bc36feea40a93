"""PNG and GIF out: encoding only (files are decoded in a guarded child, elsewhere)."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent

if TYPE_CHECKING:
    from typing_extensions import Buffer  # in collections.abc from Python 3.12


class _Heard(io.BytesIO):
    """Memory that calls `tell_on` whenever Pillow hands over a piece of the file."""

    def __init__(self, tell_on: Callable[[], None]) -> None:
        super().__init__()
        self._tell_on = tell_on

    def write(self, data: Buffer, /) -> int:
        self._tell_on()
        return super().write(data)


def encode_png(image: NDArray[np.uint8], *, progress: Progress = silent) -> bytes:
    """PNG of an (H, W), (H, W, 3) or (H, W, 4) u8 image, row 0 on top, sRGB-coded.

    No colour chunk is written: readers take plain PNG as sRGB, and glTF forbids others.
    """
    kinds = ((), (3,), (4,))
    if image.dtype != np.uint8 or image.ndim < 2 or image.shape[2:] not in kinds:
        raise InvalidParameter(f"a PNG needs (H, W[, 3 or 4]) u8, got {image.shape} {image.dtype}")
    stream = _Heard(lambda: progress(0.0, "encoding the texture"))
    Image.fromarray(image).save(stream, format="PNG", compress_level=6)
    return stream.getvalue()


def palette_of(images: Sequence[NDArray[np.uint8]]) -> Any:
    """Palette of 256 colours, as `encode_gif` takes it, of several images (h, w, 3) u8."""
    width = max(each.shape[1] for each in images)
    rows = [np.pad(each, ((0, 0), (0, width - each.shape[1]), (0, 0)), "edge") for each in images]
    whole = Image.fromarray(np.concatenate(rows))
    return whole.quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=1)


def encode_gif(
    images: Sequence[NDArray[np.uint8]], palette: Any, durations: Sequence[int]
) -> bytes:
    """GIF of (H, W, 3) u8 images, dithered to one palette, shown for ever.

    durations : milliseconds of each, in whole hundredths of a second.
    """
    coded = [
        Image.fromarray(each).quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
        for each in images
    ]
    stream = io.BytesIO()
    coded[0].save(
        stream, format="GIF", save_all=True, append_images=coded[1:], duration=list(durations),
        loop=0, optimize=False, disposal=1,
    )  # fmt: skip
    return stream.getvalue()
