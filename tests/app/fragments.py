"""Pictures by the shader, and what the reference gives for the same fragments."""

from dataclasses import replace

import numpy as np

from app.scene import FRONT, Scene, off_screen_plotter
from app.shader import Shader, eye_of
from btfcore.render.glsl.samples import pack
from btfcore.render.glsl.surface import pack_maps, pack_shadows
from btfcore.render.reference import radiance
from btfcore.render.surfels import BARE
from btfcore.render.tonemap import displayed
from btfcore.types import Quilt

SIZE = (96, 72)
_BYTES = "vec3(float({0} & 255), float(({0} >> 8) & 255), float({0} >> 16)) / 255.0"
TEXEL = _BYTES.format("(patinaTexel(uv).y * ATLAS_SIZE + patinaTexel(uv).x)")
U, V = (_BYTES.format(f"int(uv.{axis} * 16777215.0)") for axis in "xy")
PLACE = _BYTES.format("int((patinaPlace.{axis} * 0.5 + 0.5) * 16777215.0)")
NOWHERE = (1 << 24) - 1  # white, the background's


class Stage:
    """A surface in an off-screen window, the way the scene shows it."""

    def __init__(
        self, surface, surfels, gutter, *, camera=FRONT, size=SIZE, parallel=False, plotter=None
    ):
        self.surfels, self.gutter = surfels, gutter
        self.plotter = plotter or off_screen_plotter(size)
        self.scene = Scene(self.plotter)
        self.plotter.set_background("white")
        self.plotter.ren_win.SetMultiSamples(0)
        self.scene.show(surface)
        self.scene.camera = camera
        self.scene.frame(aspect=size[0] / size[1])
        self.scene.place_camera()
        self.plotter.camera.parallel_projection = parallel
        self.shader = Shader(self.scene._actor)

    def close(self):
        self.plotter.close()

    @property
    def eye(self):
        return eye_of(self.plotter.camera)

    def show(self, materials, lights, *, tone=None, visible=None):
        samples = pack(materials)
        maps = pack_maps(self.surfels, self.gutter, samples)
        shadows = None if visible is None else pack_shadows(visible, self.gutter)
        self.shader.show(samples, maps, shadows=shadows)
        self.shader.set_lights(lights)
        self.shader.set_eye(self.eye)
        self.shader.set_tone(**(tone or {}))

    def draw(self):
        """Picture (H, W, 3) u8 as it stands."""
        self.plotter.ren_win.Render()
        return np.asarray(self.plotter.screenshot(return_img=True))

    def fragments(self):
        """Pixels (n, 2) that show the surface, their texels (n,) and places (n, 3)."""
        number = self._number(TEXEL)
        pixel = np.argwhere(number != NOWHERE)
        places = [self._number(PLACE.format(axis=axis)) for axis in "xyz"]
        place = np.stack([each[tuple(pixel.T)] for each in places], axis=1)
        return pixel, number[tuple(pixel.T)], (place + 0.5) / NOWHERE * 2 - 1

    def coordinates(self, pixel):
        """Texture coordinates (n, 2) of pixels that show the surface."""
        found = [self._number(axis)[tuple(pixel.T)] for axis in (U, V)]
        return (np.stack(found, axis=1) + 0.5) / NOWHERE

    def _number(self, colour):
        samples = pack([])
        bare = replace(self.surfels, sample=np.full(len(self.surfels), BARE, np.uint16))
        self.shader.show(samples, pack_maps(bare, self.gutter, samples), colour=colour)
        return self.draw().astype(np.int64) @ [1, 256, 65536]


def expected(stage, materials, lights, fragments, *, tone=None, visible=None):
    """Coded colours (n, 3) u8 by the reference."""
    _, texel, place = fragments
    chosen = stage.gutter.ravel()[texel]
    linear = radiance(
        materials, stage.surfels, stage.eye, lights, chosen=chosen, position=place,
        visible=None if visible is None else visible[:, chosen],
    )  # fmt: skip
    return np.rint(displayed(linear, **(tone or {})) * 255).astype(np.uint8)


def differences(stage, materials, lights, *, fragments=None, **details):
    """Absolute differences (n, 3) of shader and reference in 1/255, and the expected colours."""
    if fragments is None:
        fragments = stage.fragments()
    stage.show(materials, lights, **details)
    found = stage.draw()[tuple(fragments[0].T)]
    wanted = expected(stage, materials, lights, fragments, **details)
    return np.abs(found.astype(int) - wanted.astype(int)), wanted


def patched(dense, samples=1, *, bare=False):
    """Quilt of 16 patches on the torus, each turned and set off in its own way."""
    random = np.random.default_rng(4)
    row, column = dense.texel.T
    side = dense.size // 4
    patch = (row // side * 4 + column // side).astype(np.int32)
    set_off = random.uniform(0, 40, size=(16, 2))[patch]
    source = np.stack([column * 0.37, row * 0.29], axis=1) + set_off - 5.0
    if bare:
        patch = np.where(patch == 5, -1, patch).astype(np.int32)
    return Quilt(
        source.astype(np.float32),
        random.uniform(-3, 3, size=16)[np.maximum(patch, 0)].astype(np.float32),
        (np.maximum(patch, 0) % samples).astype(np.uint16),
        patch,
    )
