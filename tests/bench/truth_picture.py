"""Draws the truth beside what is rendered: a plane and a ball of the woven sample, two lights.

Run as ``python -m tests.bench.truth_picture``; writes docs/gallery/truth.jpg.
"""

from __future__ import annotations

import numpy as np
from PIL import Image

from btfcore.btf.bake.relief import relief
from btfcore.btf.colour import linear_to_srgb
from btfcore.render.material import factor_material
from btfcore.types import F4
from tests.bench.table import ROOT
from tests.bench.truth_scenes import Scene, slope, sphere, towards
from tests.bench.woven import woven_btf, woven_maps

SIDE, FINE = 230, 3  # pixels of a panel, samples a pixel and axis
PAPER = 0.93  # sRGB around the panels
LIGHTS = (towards(62, 60), towards(24, 150))
GAIN = 4


def panels(scene: Scene, light: np.ndarray) -> list[F4]:
    """Truth, rendering and GAIN times their difference, as sRGB pictures."""
    found = []
    material, ground = factor_material(woven_btf()), relief(woven_maps())
    for values in (scene.truth(ground, light), scene.rendered(material, light)):
        found.append(coded(scene, values))
    return [*found, np.clip(GAIN * np.abs(found[0] - found[1]), 0, 1)]


def coded(scene: Scene, values: F4) -> F4:
    """An sRGB picture (SIDE, SIDE, 3): the mean radiance of each pixel's samples."""
    linear = scene.picture(values).reshape(SIDE, FINE, SIDE, FINE, 3).mean(axis=(1, 3))
    share = scene.shown.reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))[..., None]
    shown = linear_to_srgb(linear / np.maximum(share, 1e-6))
    return np.asarray(share * shown + (1 - share) * PAPER, np.float32)


def main() -> None:
    """Write the picture."""
    side = SIDE * FINE
    rows = []
    for light in LIGHTS:
        row: list[F4] = []
        for scene in (slope(side, 110.0, 40), sphere(side, 90.0)):
            for panel in panels(scene, light):
                row.append(np.pad(panel, ((4, 4), (4, 4), (0, 0)), constant_values=PAPER))
        rows.append(np.concatenate(row, axis=1))
    picture = np.rint(np.concatenate(rows) * 255).astype(np.uint8)
    path = ROOT / "docs" / "gallery" / "truth.jpg"
    Image.fromarray(picture).save(path, quality=80, optimize=True)
    print(path, picture.shape)


if __name__ == "__main__":
    main()
