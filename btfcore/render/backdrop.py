"""What lies behind a rendered surface, and how both become a picture for a display."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.errors import InvalidParameter
from btfcore.render.camera import Turntable
from btfcore.render.environment import Environment
from btfcore.render.tonemap import displayed, toned
from btfcore.types import F4, F8

TOP, BOTTOM = (0.95, 0.96, 0.97), (0.70, 0.73, 0.77)  # of the window's gradient, sRGB-coded
_ROWS = 256  # of a picture that are worked on at once

U1 = NDArray[np.uint8]


@dataclass(frozen=True)
class Backdrop:
    """Nothing (transparent), a gradient of sRGB-coded colours down the picture, or surroundings.

    environment : seen as the camera sees it, under the picture's own exposure and curve; colours
    are shown as they are under any exposure.
    """

    top: tuple[float, float, float] | None = None
    bottom: tuple[float, float, float] | None = None
    environment: Environment | None = None

    @property
    def transparent(self) -> bool:
        """Whether there is nothing."""
        return self.top is None and self.environment is None


NOTHING = Backdrop()
GRADIENT = Backdrop(TOP, BOTTOM)


def parse_backdrop(text: str, environment: Environment | None) -> Backdrop:
    """Read "transparent", "gradient", "environment" or "#rrggbb"; raises `InvalidParameter`."""
    word = text.strip().lower()
    if word == "transparent":
        return NOTHING
    if word == "gradient":
        return GRADIENT
    if word == "environment":
        if environment is None:
            raise InvalidParameter("a background of the environment, and no environment is given")
        return Backdrop(environment=environment)
    digits = word.removeprefix("#")
    if len(digits) == 6 and word.startswith("#") and all(c in "0123456789abcdef" for c in digits):
        red, green, blue = (int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4))
        return Backdrop((red, green, blue), (red, green, blue))
    raise InvalidParameter(
        f"background {text!r}; there are transparent, gradient, environment and #rrggbb"
    )


def over(picture: F4, backdrop: Backdrop, camera: Turntable) -> F4:
    """Linear picture (H, W, 4) f4, premultiplied, before its backdrop; still scene radiance.

    Colours of the backdrop count as radiance.
    """
    if backdrop.transparent:
        return picture
    out = picture.copy()
    for rows, behind in _strips(picture, backdrop, camera):
        out[rows, :, :3] += (1 - picture[rows, :, 3:]) * behind
        out[rows, :, 3] = 1.0
    return out


def develop_picture(
    picture: F4,
    backdrop: Backdrop,
    camera: Turntable,
    *,
    exposure: float = 0.0,
    curve: str = "clip",
) -> U1:
    """8-bit sRGB picture of linear radiance (H, W, 4), premultiplied.

    Returns (H, W, 3) u8, or (H, W, 4) with straight alpha for a transparent backdrop. exposure in
    stops and curve: see `btfcore.render.tonemap`. A colour behind is mixed in after the curve, in
    linear light. Raises `InvalidParameter`.
    """
    displayed(np.zeros(1), exposure, curve)  # refuses other knobs
    height, width = picture.shape[:2]
    out = np.empty((height, width, 4 if backdrop.transparent else 3), np.uint8)
    if backdrop.environment is not None:
        picture = over(picture, backdrop, camera)
    gain = np.float32(2.0 ** np.clip(exposure, -120.0, 120.0))
    for rows, behind in _strips(picture, backdrop, camera):
        alpha = picture[rows, :, 3:].astype(np.float64)
        straight = picture[rows, :, :3] / np.where(alpha > 0, alpha, 1.0)
        with np.errstate(over="ignore"):
            shown = toned(straight.astype(np.float32) * gain, curve)
        if backdrop.environment is None and not backdrop.transparent:
            shown = shown * alpha + behind * (1 - alpha)
        out[rows, :, :3] = np.rint(linear_to_srgb(shown) * 255).astype(np.uint8)
        if backdrop.transparent:
            out[rows, :, 3] = np.rint(alpha[..., 0] * 255).astype(np.uint8)
    return out


# --- inside


def _strips(picture: F4, backdrop: Backdrop, camera: Turntable) -> Any:
    """Rows in strips, and the linear colours (h, W, 3) or (h, 1, 3) behind them."""
    height, width = picture.shape[:2]
    for first in range(0, height, _ROWS):
        rows = slice(first, min(first + _ROWS, height))
        yield rows, _behind(backdrop, camera, (width, height), rows)


def _behind(backdrop: Backdrop, camera: Turntable, size: tuple[int, int], rows: slice) -> F8:
    row = np.arange(rows.start, rows.stop)
    if backdrop.environment is not None:
        column, place = np.meshgrid(np.arange(size[0]) + 0.5, row + 0.5)
        rays = camera.rays(np.stack([column, place], axis=-1), size)
        seen = backdrop.environment.radiance_towards(rays.reshape(-1, 3))
        return seen.reshape(len(row), size[0], 3).astype(np.float64)
    if backdrop.top is None or backdrop.bottom is None:
        return np.zeros((len(row), 1, 3))
    down = (row / max(size[1] - 1, 1))[:, None, None]
    coded = (1 - down) * np.array(backdrop.top) + down * np.array(backdrop.bottom)
    return srgb_to_linear(coded).astype(np.float64)
