"""Contact sheets: a sample under chosen views (rows) and lights (columns), labelled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from btfcore.btf.appearance import nearest_pair
from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.directions import from_angles, to_angles
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8

DEFAULT_VIEWS = "0,0 45,0 45,90 70,45"
DEFAULT_LIGHTS = "20,135 50,0 50,90 50,225 70,180"
_MARGIN, _LABEL = 4, 16
_MOST_STOPS = 32
_GROUND, _INK = (32, 32, 34), (220, 220, 220)


def parse_angles(text: str, what: str) -> F8:
    """Directions (n, 3) of "theta,phi theta,phi …" in degrees; raises `InvalidParameter`."""
    pairs = []
    for part in text.replace(";", " ").split():
        try:
            theta, phi = (float(value) for value in part.split(","))
        except ValueError:
            raise InvalidParameter(
                f"{what} {part!r} is not of the form theta,phi in degrees"
            ) from None
        if not (0 <= theta < 90 and abs(phi) <= 3600):
            raise InvalidParameter(f"{what} {part!r}: theta must lie in 0 … 90 (excluded)")
        pairs.append((theta, phi))
    if not pairs:
        raise InvalidParameter(f"no {what} is given")
    angles = np.radians(np.array(pairs))
    return from_angles(angles[:, 0], angles[:, 1])


@dataclass(frozen=True)
class Sheet:
    """What a contact sheet shows: directions, the side of a cell in pixels, and the exposure."""

    views: F8
    lights: F8
    cell: int = 192
    exposure: float = 0.0

    def __post_init__(self) -> None:
        """Raise `InvalidParameter` for cells and exposures that make no picture."""
        if not 16 <= self.cell <= 2048:
            raise InvalidParameter(f"cells of {self.cell} pixels; 16 … 2048 are possible")
        if not abs(self.exposure) <= _MOST_STOPS:
            raise InvalidParameter(
                f"an exposure of {self.exposure} stops; -{_MOST_STOPS} … {_MOST_STOPS} are possible"
            )


def contact_sheet(
    samples: Sequence[BtfSample], sheet: Sheet, *, progress: Progress = silent
) -> NDArray[np.uint8]:
    """Lay out measured images of samples as (h, w, 3) u8; each is the nearest to its wish.

    Every cell says the angles that the image really has, not those that were asked for; of
    several samples the first cell of a row says the name too.
    """
    rows = [(sample, view) for sample in samples for view in sheet.views]
    width = _MARGIN + len(sheet.lights) * (sheet.cell + _MARGIN)
    height = _MARGIN + len(rows) * (sheet.cell + _LABEL + _MARGIN)
    if width * height > 1 << 27:
        raise InvalidParameter(f"a sheet of {width:,} x {height:,} pixels is too large")
    page = Image.new("RGB", (width, height), _GROUND)
    pen = ImageDraw.Draw(page)
    for row, (sample, view) in enumerate(rows):
        for column, light in enumerate(sheet.lights):
            progress((row + column / len(sheet.lights)) / len(rows), "preview")
            pair = nearest_pair(sample, view, light)
            left = _MARGIN + column * (sheet.cell + _MARGIN)
            top = _MARGIN + row * (sheet.cell + _LABEL + _MARGIN)
            picture = _fitted(sample.image(*pair), sheet)
            page.paste(picture, (left, top))
            label = _label(sample, pair)
            if len(samples) > 1 and column == 0:
                label += f"  {_plain(sample.name)}"
            pen.text((left + 2, top + sheet.cell + 1), label[: sheet.cell // 6], fill=_INK)
    return np.asarray(page)


def _fitted(radiance: F4, sheet: Sheet) -> Image.Image:
    """Bring an image into a cell, keeping its proportions; whole factors stay crisp."""
    coded = linear_to_srgb(radiance * np.float32(2.0**sheet.exposure))
    picture = Image.fromarray(np.round(coded * 255).astype(np.uint8))
    factor = sheet.cell / max(picture.size)
    if factor >= 2:
        factor = int(factor)
    size = (max(1, round(picture.width * factor)), max(1, round(picture.height * factor)))
    whole, larger = factor == int(factor), factor > 1
    kind = Image.Resampling.NEAREST if whole else Image.Resampling.BICUBIC
    kind = kind if larger else Image.Resampling.BOX
    cell = Image.new("RGB", (sheet.cell, sheet.cell), _GROUND)
    spare = (sheet.cell - size[0]) // 2, (sheet.cell - size[1]) // 2
    cell.paste(picture.resize(size, kind), spare)
    return cell


def _plain(name: str) -> str:
    """Letters that every built-in font has."""
    return name.encode("ascii", "replace").decode()


def _label(sample: BtfSample, pair: tuple[int, int]) -> str:
    view = np.degrees(np.concatenate(to_angles(sample.views[pair[0]][None])))
    light = np.degrees(np.concatenate(to_angles(sample.lights[pair[1]][None])))
    return f"v {view[0]:.0f},{view[1] % 360:.0f}  l {light[0]:.0f},{light[1] % 360:.0f}"
