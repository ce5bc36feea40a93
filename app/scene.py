"""What is drawn, without any window system: a surface, its texture, lights and a camera.

A `Scene` draws into a pyvista plotter that somebody else made: the window's interactor or an
off-screen one. The surface is moved and scaled into the unit ball, so that meshes far from
the origin or of absurd size keep their precision on the graphics card.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkTexture

from btfcore.files.atomic import write_bytes
from btfcore.files.png import encode_png
from btfcore.files.surface import ExportSurface
from btfcore.render.backdrop import BOTTOM, TOP
from btfcore.render.camera import ANGLE, Turntable
from btfcore.render.surfels import Placement, placement
from btfcore.types import F8, Sample

PLAIN = tuple(0.35 * above + 0.65 * below for above, below in zip(TOP, BOTTOM, strict=True))
CLAY = (0.80, 0.79, 0.77)
AMBIENT, DIFFUSE = 0.48, 0.72
# (position in the camera's frame, intensity): a key light from the upper left, a headlight
# and a weak fill from the right; a surface facing the viewer is shown at its own brightness.
LIGHTS = (((-0.9, 1.1, 1.2), 0.55), ((0.0, 0.0, 1.0), 0.30), ((1.2, 0.2, 0.6), 0.15))
FRONT, BACK = Turntable(30.0, 18.0), Turntable(210.0, 18.0)

U1 = NDArray[np.uint8]


class Scene:
    """A textured surface in a plotter; every method must run on the plotter's own thread."""

    def __init__(self, plotter: Any) -> None:
        """Prepare lights and background of `plotter` (pyvista, made with lighting='none')."""
        self._plotter = plotter
        self._actor: Any = None
        self._markers: Any = None
        self._textures: tuple[vtkTexture, ...] = ()  # of one image: plain, and filtered
        self._reduced = True
        self._image: vtkImageData | None = None
        self._lit = False
        self.place = Placement((0.0, 0.0, 0.0), 1.0)
        self._points: F8 = np.zeros((0, 3))
        self._smooth = self._closed = False
        self.camera = Turntable()
        self.set_backdrop(plain=False)
        plotter.remove_all_lights()
        for position, intensity in LIGHTS:
            light = pv.Light(position=position, light_type="camera light", intensity=intensity)
            plotter.add_light(light)
        plotter.camera.view_angle = ANGLE

    def set_backdrop(self, *, plain: bool) -> None:
        """Draw a gradient behind the surface, or one colour, which software clears far faster."""
        if plain:
            self._plotter.set_background(PLAIN)
        else:
            self._plotter.set_background(BOTTOM, top=TOP)

    @property
    def actor(self) -> Any:
        """What draws the surface (vtkActor), another one after every `show`; None without one."""
        return self._actor

    def show(self, surface: ExportSurface | None) -> None:
        """Draw `surface` in plain clay until a texture comes; None clears the scene."""
        for actor in (self._actor, self._markers):
            if actor is not None:
                self._plotter.remove_actor(actor, render=False)
        self._actor = self._markers = self._image = None
        self._textures = ()
        if surface is None:
            self._points = np.zeros((0, 3))
            return
        self.place = placement(surface.positions)
        self._points = self.place.to_scene(surface.positions)
        self._closed = surface.closed
        points: Any = self._points.astype(np.float32)
        faces: Any = surface.faces
        mesh = pv.PolyData.from_regular_faces(points, faces)
        mesh.point_data.active_normals = surface.normals
        mesh.point_data.active_texture_coordinates = surface.uv
        self._actor = self._plotter.add_mesh(
            mesh,
            color=CLAY,
            ambient=AMBIENT,
            diffuse=DIFFUSE,
            specular=0.0,
            smooth_shading=False,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
        )
        self._actor.prop.interpolation = "Phong"
        self._lit = False

    def set_texture(self, image: U1 | None, *, radiance: bool = False) -> None:
        """Put an atlas image (H, W, 3) u8, row 0 on top, on the surface; None is clay.

        radiance : the image is what is to be seen, and no light of the scene falls on it.
        """
        if self._actor is None:
            return
        self._shine(radiance and image is not None)
        if image is None:
            self._actor.SetTexture(None)
            self._textures = ()
            self._actor.prop.color = CLAY
            return
        # uv count from the upper left corner and VTK's first row is v = 0: no row is flipped
        height, width, bands = image.shape
        holder = vtkImageData()
        holder.SetDimensions(width, height, 1)
        values = numpy_to_vtk(np.ascontiguousarray(image).reshape(-1, bands), deep=True)
        holder.GetPointData().SetScalars(values)
        if not self._textures:
            self._textures = (_filtered(False), _filtered(True))
            self._actor.prop.color = (1.0, 1.0, 1.0)
            self._actor.SetTexture(self._textures[self._reduced])
        for each in self._textures:  # each is uploaded when it is drawn
            each.SetInputData(holder)
        self._image = holder

    def filter_reduced(self, wanted: bool) -> None:
        """Average what of the texture falls into a pixel, or read it bilinearly in the middle.

        The former takes a driver without a graphics card long.
        """
        if wanted is not self._reduced:
            self._reduced = wanted
            if self._textures:
                self._actor.SetTexture(self._textures[wanted])

    def _shine(self, radiance: bool) -> None:
        """Show colours as they are, or under the scene's own light."""
        if radiance is not self._lit:
            self._lit = radiance
            look = self._actor.prop
            look.lighting = not radiance
            # without lighting a colour is shown (ambient + diffuse) times
            look.ambient, look.diffuse = (1.0, 0.0) if radiance else (AMBIENT, DIFFUSE)

    def set_markers(self, points: F8 | None) -> None:
        """Draw small balls at world positions (S, 3), for the field's singularities."""
        if self._markers is not None:
            self._plotter.remove_actor(self._markers, render=False)
            self._markers = None
        if points is None or len(points) == 0 or self._actor is None:
            return
        ball = pv.Sphere(radius=0.018, theta_resolution=20, phi_resolution=14)
        cloud = pv.PolyData(self.place.to_scene(points)).glyph(geom=ball, scale=False, orient=False)
        self._markers = self._plotter.add_mesh(
            cloud, color=(0.93, 0.27, 0.16), ambient=0.45, diffuse=0.6, specular=0.15,
            smooth_shading=True, reset_camera=False, render=False,
        )  # fmt: skip

    def frame(self, *, aspect: float, margin: float = 0.08) -> None:
        """Bring the whole surface into view without turning it."""
        if len(self._points):
            self.camera = self.camera.framing(self._points, aspect=aspect, margin=margin)

    def place_camera(self) -> None:
        """Hand the turntable's camera to the plotter."""
        camera = self._plotter.camera
        camera.position = tuple(self.camera.position)
        camera.focal_point = self.camera.focus
        camera.up = tuple(self.camera.axes()[1])
        camera.view_angle = ANGLE
        away = float(np.linalg.norm(self.camera.position))
        if self._actor is not None:
            # from outside the backs of a closed surface are behind its front
            self._actor.prop.culling = "back" if self._closed and away > 1.0 else "none"
        camera.clipping_range = (max(away - 1.2, 0.004), away + 1.2)

    def eye(self) -> F8:
        """Where the camera is, (4,) f8 homogeneous scene coordinates."""
        return np.array([*self.camera.position, 1.0])

    def reduction(self, step: float, height: int) -> float:
        """Texels a pixel and axis at the middle of a picture `height` pixels high.

        step : edge of a texel on the surface in world units.
        """
        reach = 2 * self.camera.distance * np.tan(np.radians(ANGLE / 2))
        return float(reach / max(height, 1) / max(step * self.place.scale, 1e-12))

    def smooth_edges(self, wanted: bool) -> None:
        """Draw four times the pixels and average them, or not."""
        if wanted is not self._smooth:
            self._smooth = wanted
            if wanted:
                self._plotter.enable_anti_aliasing("ssaa")
            else:
                self._plotter.disable_anti_aliasing()


def _filtered(reduced: bool) -> vtkTexture:
    """Return a texture without an image.

    Two rather than one that is switched: VTK leaves a texture's anisotropy as it was first, and
    without mip levels llvmpipe then reads thousands of texels for a pixel.
    """
    texture = vtkTexture()
    texture.InterpolateOn()
    texture.RepeatOff()
    texture.EdgeClampOn()
    texture.SetColorModeToDirectScalars()
    texture.SetMipmap(reduced)
    if reduced:
        texture.SetMaximumAnisotropicFiltering(8.0)
    return texture


def off_screen_plotter(size: tuple[int, int]) -> Any:
    """Plotter that needs no display: width and height in pixels."""
    if not os.environ.get("DISPLAY"):  # VTK would complain of that before it turns to EGL
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    return pv.Plotter(off_screen=True, window_size=list(size), lighting="none", border=False)


def render(
    surface: ExportSurface,
    texture: U1 | None,
    cameras: Sequence[Turntable],
    *,
    size: tuple[int, int],
    markers: F8 | None = None,
    smoothing: int = 2,
) -> list[U1]:
    """Pictures (H, W, 4) u8 of a surface from several sides, `size` being (width, height).

    Colours are premultiplied by alpha, which is 0 beside the surface. Every camera is moved so
    that the surface fills the picture. Each is drawn `smoothing` times larger and averaged
    down, which no driver does differently.
    """
    width, height = size
    plotter = off_screen_plotter((width * smoothing, height * smoothing))
    try:
        scene = Scene(plotter)
        plotter.set_background("black")
        scene.show(surface)
        scene.set_texture(texture)
        scene.set_markers(markers)
        pictures = []
        for camera in cameras:
            scene.camera = camera
            scene.frame(aspect=width / height)
            scene.place_camera()
            plotter.render()
            drawn = np.asarray(plotter.screenshot(transparent_background=True, return_img=True))
            pictures.append(_averaged(drawn, smoothing))
        return pictures
    finally:
        plotter.close()


def render_preview(
    path: str | Path | None,
    surface: ExportSurface,
    texture: U1,
    *,
    sample: Sample | Sequence[Sample] | None = None,
    seams: U1 | None = None,
    views: Sequence[Turntable] = (FRONT, BACK),
    size: tuple[int, int] = (1200, 900),
) -> U1:
    """Picture of a decorated surface from several sides: (H, W, 3) u8, the same every time.

    The `views` stand side by side, or below each other where that shows a flat surface larger,
    the first once more with the `seams` texture where one is given; the `sample`, or
    several while there is room, lies in the lower left corner. Saved as a PNG at `path` unless
    that is None; raises `OutputFailed` where it cannot be written, leaving nothing
    half-written. Needs no display.
    """
    width, height = size
    strip = round(height * 0.22) if sample is not None else 0
    count = len(views) + (seams is not None)
    beside, below = (width // count, height - strip), (width, (height - strip) // count)
    panel = max(beside, below, key=lambda each: _apparent_size(surface, views[0], each))
    panels = render(surface, texture, views, size=panel)
    if seams is not None:
        panels += render(surface, seams, views[:1], size=panel)
    ramp = np.linspace(np.array(TOP), np.array(BOTTOM), height)[:, None] * 255
    picture = np.broadcast_to(ramp, (height, width, 3)).copy()
    for place, drawn in enumerate(panels):
        left, top = (place * panel[0], 0) if panel == beside else (0, place * panel[1])
        under = picture[top : top + panel[1], left : left + panel[0]]
        under *= 1 - drawn[..., 3:] / 255.0
        under += drawn[..., :3]
    side, left = round(strip * 0.8), round(strip * 0.12)
    for each in () if sample is None else [sample] if isinstance(sample, Sample) else sample:
        if left + side + 3 > width:
            break
        _inset(picture, each, side=side, left=left, margin=round(strip * 0.12))
        left += side + round(strip * 0.12)
    done = np.clip(picture + 0.5, 0, 255).astype(np.uint8)
    if path is not None:
        write_bytes(path, encode_png(done))
    return done


def _apparent_size(surface: ExportSurface, camera: Turntable, size: tuple[int, int]) -> float:
    """How large a surface appears that fills a picture of `size`, in pixels per unit."""
    framed = camera.framing(surface.positions, aspect=size[0] / size[1])
    return size[1] / framed.distance


def _inset(picture: F8, sample: Sample, *, side: int, left: int, margin: int) -> None:
    """Lay the sample in a white frame along the lower edge, its longer side `side`."""
    rows, columns = sample.colour.shape[:2]
    high, wide = (max(1, round(side * n / max(rows, columns))) for n in (rows, columns))
    small = Image.fromarray((np.clip(sample.colour, 0, 1) * 255 + 0.5).astype(np.uint8))
    small = small.resize((wide, high), Image.Resampling.LANCZOS)
    bottom = picture.shape[0] - margin
    picture[bottom - high - 3 : bottom + 3, left - 3 : left + wide + 3] = 255
    picture[bottom - high : bottom, left : left + wide] = np.asarray(small)


def _averaged(image: U1, factor: int) -> U1:
    """Mean over blocks of `factor` x `factor` pixels."""
    height, width, bands = image.shape[0] // factor, image.shape[1] // factor, image.shape[2]
    blocks = image.reshape(height, factor, width, factor, bands)
    total = blocks.sum(axis=(1, 3), dtype=np.uint16)
    return ((total + factor * factor // 2) // (factor * factor)).astype(np.uint8)
