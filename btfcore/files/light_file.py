"""Lights from outside: environment maps from image files, directional lights from words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from btfcore.btf.colour import srgb_to_linear
from btfcore.btf.readers.decode import MOST_PIXELS, decode_images
from btfcore.btf.readers.image_files import coding_note, radiance
from btfcore.btf.readers.listing import pick_files
from btfcore.errors import InvalidImage, InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.render.environment import Environment, reduced
from btfcore.render.lights import BRIGHTEST, NONE, Lights
from btfcore.types import F8

MOST_ROWS = 1024  # of a map that is kept; a background of 2048 texels around
STRONGEST = 1e6
_FORM = "AZIMUTH,ELEVATION[,INTENSITY[,#RRGGBB]], in degrees, after camera: or not"


@dataclass(frozen=True)
class LightSetting:
    """One directional light as a user says it.

    azimuth, elevation : degrees of where it stands, 0/0 at +z, azimuth turning towards +x, +y up:
    the angles of a camera on a turntable. camera : these are in the camera's frame instead
    (0/0 shines from the camera, 0/90 from above it), so that the light goes along with it.
    intensity : 1 gives a sample's own radiance. colour : linear Rec. 709, 0–1.
    """

    azimuth: float
    elevation: float
    intensity: float = 1.0
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    camera: bool = False

    def direction(self, axes: F8 | None = None) -> F8:
        """Unit vector (3,) f8 towards it; axes (3, 3): rows right, up, backwards of a camera.

        Raises `InvalidParameter` where the light is the camera's and no axes are given.
        """
        a, e = np.radians(self.azimuth % 360.0), np.radians(self.elevation)
        local = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        if not self.camera:
            return local
        if axes is None:
            raise InvalidParameter("a light in the camera's frame, and no camera")
        return np.einsum("ij,i->j", np.asarray(axes, np.float64), local)


def parse_light(text: str) -> LightSetting:
    """Read "azimuth,elevation[,intensity[,#rrggbb]]", optionally after "camera:" or "world:".

    #rrggbb is sRGB-coded. Raises `InvalidParameter`, with the text, for anything else, an
    elevation outside -90 … 90 and an intensity outside 0 … 1,000,000.
    """
    frame, colon, rest = text.strip().partition(":")
    if not colon:
        frame, rest = "world", text
    parts = [part.strip() for part in rest.split(",")]
    if frame.strip().lower() not in ("camera", "world") or not 2 <= len(parts) <= 4:
        raise InvalidParameter(f"light {text!r} is not of the form {_FORM}")
    numbers = [_number(part, text) for part in parts[:3]]
    if not -90 <= numbers[1] <= 90:
        raise InvalidParameter(f"light {text!r}: an elevation of {numbers[1]:g}, not -90 to 90")
    intensity = numbers[2] if len(numbers) > 2 else 1.0
    if not 0 <= intensity <= STRONGEST:
        raise InvalidParameter(
            f"light {text!r}: an intensity of {intensity:g}, 0 to {STRONGEST:,.0f} can be"
        )
    colour = _colour(parts[3], text) if len(parts) > 3 else (1.0, 1.0, 1.0)
    camera = frame.strip().lower() == "camera"
    return LightSetting(numbers[0], numbers[1], intensity, colour, camera)


def parse_lights(texts: Sequence[str], axes: F8 | None = None) -> Lights:
    """Directional lights of several texts; see `parse_light` and `lights_of`."""
    return lights_of([parse_light(text) for text in texts], axes)


def lights_of(settings: Sequence[LightSetting], axes: F8 | None = None) -> Lights:
    """`Lights` of settings, seen from a camera with `axes` (3, 3); none: no light."""
    if not settings:
        return NONE
    direction = np.stack([each.direction(axes) for each in settings])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    intensity = np.array([each.intensity * np.array(each.colour) for each in settings])
    return Lights(direction, intensity)


def read_environment(
    path: str | Path,
    *,
    rotation: float = 0.0,
    intensity: float = 1.0,
    most_rows: int = MOST_ROWS,
    progress: Progress = silent,
) -> tuple[Environment, tuple[str, ...]]:
    """Read a latitude–longitude map, twice as wide as high, and say what was done to it.

    OpenEXR, Radiance HDR, and PNG, JPEG, TIFF … whose integers are sRGB-coded and reach 1.
    Decoded in a guarded child. Values are never clamped at the top; NaN and negative ones
    become 0, infinite ones 65504. Maps of more than `most_rows` rows are reduced in linear
    radiance, which keeps their energy. How the picture is laid out: see
    `btfcore.render.environment`; rotation and intensity go into its fields.

    Raises `InvalidImage` or `GuardedFailure`, beginning with the file's name; `InvalidParameter`
    for a rotation or intensity that cannot be.
    """
    given = Path(path)
    files = pick_files(given.absolute().parent, [given.name])
    if not files.entries:
        raise InvalidImage(f"{given.name}: there is no such file")
    raw = decode_images(files, files.entries, most=MOST_PIXELS, free=1 << 24, progress=progress)[0]
    height, width = raw.values.shape[:2]
    if width != 2 * height:
        raise InvalidImage(
            f"{given.name}: its size is {width} x {height}; an environment map is twice as wide"
            " as high (latitude–longitude)"
        )
    notes = [*raw.notes, coding_note(raw, "auto")]
    if any(raw.flaws):
        nan, infinite, negative = raw.flaws
        notes.append(f"mended {nan} NaN, {infinite} infinite and {negative} negative values")
    values = radiance(raw)
    highest = float(values.max())
    if highest * 4 > BRIGHTEST:
        raise InvalidImage(f"{given.name}: radiances up to {highest:g}, brighter than any light")
    if raw.values.dtype.kind == "u":
        notes.append("holds no radiance above 1: light sources in it are too dim")
    kept = reduced(values, most_rows)
    if kept is not values:
        notes.append(
            f"reduced from {width} x {height} to {2 * len(kept)} x {len(kept)}, keeping its energy"
        )
    return Environment(np.ascontiguousarray(kept), rotation, intensity), tuple(notes)


def _number(part: str, text: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InvalidParameter(f"light {text!r}: {part!r} is no number; the form is {_FORM}")
    return value


def _colour(part: str, text: str) -> tuple[float, float, float]:
    if not re.fullmatch("#[0-9a-fA-F]{6}", part):
        raise InvalidParameter(f"light {text!r}: {part!r} is no colour of the form #rrggbb")
    code = np.array([int(part[k : k + 2], 16) for k in (1, 3, 5)], np.uint8)
    red, green, blue = srgb_to_linear(code).tolist()
    return red, green, blue
