"""A picture of samples side by side, each under four lights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.sample import BtfSample
from btfcore.types import F4

LOOKS = (  # polar angle and azimuth of the light, then of the view, in degrees
    ((30, 135), (0, 0)),
    ((60, 40), (0, 0)),
    ((45, 280), (0, 0)),
    ((45, 20), (30, 200)),
)
_EXPOSURE = 1.15
_LINE = 18


def looks(sample: BtfSample) -> list[F4]:
    """Linear images (H, W, 3) of a sample under the four lights (the nearest it has)."""
    return [sample.image(*_pair(sample, light, view)) for light, view in LOOKS]


def _pair(
    sample: BtfSample, light: tuple[float, float], view: tuple[float, float]
) -> tuple[int, int]:
    return (
        int(np.argmax(sample.views @ _direction(*view))),
        int(np.argmax(sample.lights @ _direction(*light))),
    )


def _direction(theta: float, phi: float) -> np.ndarray:
    polar, around = np.radians(theta), np.radians(phi)
    return np.array([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)])


def write_sheet(
    path: Path, rows: list[tuple[str, list[F4]]], *, side: int = 160, across: int = 2
) -> Path:
    """Write a JPEG of named rows of linear images, each `side` pixels wide, and return its path.

    across : rows that stand beside each other.
    """
    wide = max(len(images) for _, images in rows)
    lines = -(-len(rows) // across)
    cell = side + _LINE
    gap = 12
    page = Image.new("RGB", (across * (wide * side + gap) - gap, lines * cell), (24, 24, 26))
    pen = ImageDraw.Draw(page)
    for number, (name, images) in enumerate(rows):
        left = number // lines * (wide * side + gap)
        top = number % lines * cell
        pen.text((left + 4, top + 3), name, fill=(225, 225, 220))
        for place, image in enumerate(images):
            coded = np.round(linear_to_srgb(image * np.float32(_EXPOSURE)) * 255)
            tile = Image.fromarray(coded.astype(np.uint8))
            tile = tile.resize((side, side), Image.Resampling.BICUBIC)
            page.paste(tile, (left + place * side, top + _LINE))
    path.parent.mkdir(parents=True, exist_ok=True)
    for quality in (92, 88, 84, 80, 74, 68):
        page.save(path, "JPEG", quality=quality, optimize=True)
        if path.stat().st_size <= 400_000:
            break
    return path
