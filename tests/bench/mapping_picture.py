"""Pictures of what the methods of `tests.bench.mapping` make, side by side, whole and close."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from app.scene import BOTTOM, TOP, U1, Scene, off_screen_plotter
from btfcore.files.surface import ExportSurface, export_input
from btfcore.render.camera import Turntable
from btfcore.render.modes import seam_colours
from btfcore.render.texture import atlas_texture, vertex_colours
from tests.bench.mapping import Case, Method

PANEL = (600, 460)
SIDE = Turntable(-70.0, 12.0)
CLOSE = (0.0, 0.09, 3.3)  # shift in fractions of the picture's height, enlargement
SMOOTHING = 2
LARGEST = 150_000  # bytes of the JPEG


def write_picture(path: Path, case: Case, methods: Mapping[str, Method]) -> Path:
    """Run the methods on a case and write them as columns: all seams above, a part below."""
    pictures = {}
    surface = export_input(case.prepared.mesh, case.prepared.atlas)
    for name, method in methods.items():
        dense, quilt = case.prepared.dense, method(case).quilt
        colours = vertex_colours(quilt, [case.sample])
        seams = seam_colours(dense, quilt, colours, width=2)
        pictures[name] = views(surface, atlas_texture(dense, seams), atlas_texture(dense, colours))
    width, height = PANEL
    page = Image.new("RGB", (width * len(pictures), 2 * height))
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=20)
    for column, (name, panels) in enumerate(pictures.items()):
        for row, panel in enumerate(panels):
            page.paste(Image.fromarray(panel), (column * width, row * height))
        pen.text((column * width + 14, 10), name, fill=(40, 40, 44), font=font)
    path.parent.mkdir(parents=True, exist_ok=True)
    for quality in range(90, 30, -4):
        page.save(path, "JPEG", quality=quality, optimize=True, progressive=True)
        if path.stat().st_size <= LARGEST:
            break
    return path


def views(surface: ExportSurface, whole: U1, near: U1) -> list[U1]:
    """Draw a surface as a whole and a part of it, each with its texture: two (H, W, 3) u8."""
    width, height = PANEL
    plotter = off_screen_plotter((width * SMOOTHING, height * SMOOTHING))
    try:
        scene = Scene(plotter)
        plotter.set_background(BOTTOM, top=TOP)
        scene.show(surface)
        scene.camera = SIDE
        scene.frame(aspect=width / height)
        right, up, larger = CLOSE
        aside = scene.camera
        out = []
        for camera, texture in (
            (aside, whole),
            (aside.panned(right, up).zoomed(larger), near),
        ):
            scene.camera = camera
            scene.set_texture(texture)
            scene.place_camera()
            plotter.render()
            drawn = np.asarray(plotter.screenshot(return_img=True))[..., :3]
            picture = Image.fromarray(drawn).resize(PANEL, Image.Resampling.BOX)
            out.append(np.asarray(picture))
        return out
    finally:
        plotter.close()
