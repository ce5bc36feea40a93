"""A decorated surface drawn by a fragment shader: values in textures, the rest in uniforms.

The textures' and the code's owner is the actor's property, so that VTK uploads and compiles
them again by itself when the surface is drawn in another or a new OpenGL context.

`samples = pack(materials)`, `maps = pack_maps(surfels, gutter_source(dense), samples)`, then
`Shader(actor).show(samples, maps)`; per frame `set_lights` and `set_eye(eye_of(camera))`. Where
`unfit` or `unfit_lights` name a reason, the processor must evaluate instead.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.misc import calldata_type
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.util.vtkConstants import VTK_STRING
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkRenderingCore import vtkTexture
from vtkmodules.vtkRenderingOpenGL2 import vtkTextureObject

from app.backend import Machine
from btfcore.render.glsl.harmonics import MOST_POINTS, sky_values
from btfcore.render.glsl.samples import PackedSamples
from btfcore.render.glsl.surface import (
    COLOUR,
    MOST_LIGHTS,
    SAMPLERS,
    SHADOWS,
    PackedMaps,
    light_values,
    program,
    sky_degree,
    tone_values,
)
from btfcore.render.lights import NONE, Lights
from btfcore.render.tonemap import WHITE
from btfcore.types import F8

U1 = NDArray[np.uint8]

_OUT_OF_MEMORY = 0x0505  # of glGetError
_ERROR: Any = "ErrorEvent"  # which VTK's own stubs want as a number

# VTK's own line stays where it declares something, as its text is put there afterwards
_HEAD, _BODY = "//VTK::TCoord::Dec", "//VTK::TCoord::Impl"
_PLACE = "vec3 patinaPlaceVSOutput"
_VERTEX = "  patinaPlaceVSOutput = vertexMC.xyz;\n"
_FRAGMENT = """
  vec2 uv = tcoordVCVSOutput;
  vec3 patinaPlace = patinaPlaceVSOutput;
  gl_FragData[0] = vec4({colour}, 1.0);
"""


class Shader:
    """The shader of one actor; every method must run on the thread that draws.

    The actor's mesh has texture coordinates of the atlas, (0, 0) at its upper left corner, and
    is given in scene coordinates, which VTK leaves as they are since they are near 1. Lights,
    eye and tone are uniforms; they make VTK compile only where an environment's harmonics come
    or go. After any change it is the caller who draws.
    """

    def __init__(self, actor: Any) -> None:
        """Prepare for `actor` (vtkActor); nothing is changed before `show`."""
        self._actor = actor
        self._maps: PackedMaps | None = None
        self._lighting = True
        self._code: tuple[PackedSamples, str] | None = None
        self._smooth, self._sky, self._shadowed = False, -1, False
        self._shown = False

    @property
    def shown(self) -> bool:
        """Whether the shader draws the actor."""
        return self._shown

    def show(
        self,
        samples: PackedSamples,
        maps: PackedMaps,
        *,
        shadows: tuple[U1, U1] | None = None,
        smooth: bool = False,
        colour: str = COLOUR,
    ) -> None:
        """Draw the actor by the shader from now on, black until there are lights.

        shadows : what `pack_shadows` returned, where lights cast them. smooth : see
        `set_smooth`. colour : GLSL of a fragment's vec3, from the functions of `program`, `uv`
        and `patinaPlace`.
        """
        self.remove()
        actor = self._actor
        self._lighting = bool(actor.GetProperty().GetLighting())
        actor.GetProperty().LightingOff()
        actor.ForceOpaqueOn()
        self.set_maps(maps)
        lists = (samples.weights, samples.table, samples.nodes)
        for name, each in zip(SAMPLERS[3:], lists, strict=True):
            self._set_texture(name, each.image)
        self._code = (samples, colour)
        self._shown, self._shadowed, self._smooth, self._sky = True, False, smooth, -1
        self._write()
        self.set_shadows(shadows)
        self.set_lights(NONE)
        self.set_eye(np.array([0.0, 0.0, 1.0, 0.0]))
        self.set_tone()

    def set_maps(self, maps: PackedMaps) -> None:
        """Upload other maps of the same atlas, such as after a stroke; only what is another."""
        old = self._maps
        for name, field in zip(SAMPLERS, ("quilt", "column", "normal"), strict=False):
            image = getattr(maps, field)
            if old is None or getattr(old, field) is not image:
                self._set_texture(name, image)
        self._maps = maps

    def set_lights(self, lights: Lights) -> None:
        """Light the surface; raises `InvalidParameter` for more than `MOST_LIGHTS`."""
        if self._code is None:
            return
        uniforms = self._uniforms()
        degree = sky_degree(self._code[0], lights)
        if degree != self._sky:
            self._sky = degree
            self._write()
        if degree >= 0 and lights.harmonics is not None:
            sky = sky_values(lights.harmonics, degree)
            uniforms.SetUniformMatrix4x4v("patinaSky", MOST_POINTS // 4, sky)
            uniforms.SetUniformi("patinaSampled", lights.sampled)
        uniforms.SetUniformMatrix4x4v("patinaLight", MOST_LIGHTS // 2, light_values(lights))
        uniforms.SetUniformi("patinaLightCount", len(lights))

    def set_eye(self, eye: F8) -> None:
        """Look from `eye` (4,), homogeneous scene coordinates: see `eye_of`."""
        self._uniforms().SetUniform4f("patinaEye", tuple(float(each) for each in eye))

    def set_tone(self, exposure: float = 0.0, curve: str = "clip", white: float = WHITE) -> None:
        """Show radiance as `btfcore.render.tonemap.displayed` does; exposure in stops."""
        self._uniforms().SetUniform4f("patinaTone", tone_values(exposure, curve, white))

    def set_smooth(self, smooth: bool) -> None:
        """Blend the four texels around every fragment, at four times the work; else the nearest.

        Another program, which VTK compiles once and keeps.
        """
        if self._shown and smooth != self._smooth:
            self._smooth = smooth
            self._write()

    def set_shadows(self, shadows: tuple[U1, U1] | None) -> None:
        """Upload other shadows, such as after a light moved; None: lights cast none.

        The first and the last ones come with another program, as in `set_smooth`.
        """
        if not self._shown:
            return
        for name, image in zip(SHADOWS, shadows or (), strict=shadows is not None):
            self._set_texture(name, image)
        if self._shadowed is not (shadows is not None):
            self._shadowed = shadows is not None
            self._write()

    def remove(self) -> None:
        """Let VTK draw the actor in its own way again; frees the textures."""
        if not self._shown:
            return
        for name in (*SAMPLERS, *SHADOWS):
            if self._actor.GetProperty().GetTexture(name) is not None:
                self._actor.GetProperty().RemoveTexture(name)
        code = self._actor.GetShaderProperty()
        code.ClearAllShaderReplacements()
        self._uniforms().RemoveAllUniforms()
        self._actor.GetProperty().SetLighting(self._lighting)
        self._actor.ForceOpaqueOff()
        self._maps = self._code = None
        self._shown = False

    def _write(self) -> None:
        """Put the program into VTK's own."""
        assert self._code is not None and self._maps is not None
        samples, colour = self._code
        size = len(self._maps.quilt)
        text = program(samples, size, shadows=self._shadowed, smooth=self._smooth, sky=self._sky)
        code = self._actor.GetShaderProperty()
        code.ClearAllShaderReplacements()
        for add, tag, lines in (
            (code.AddFragmentShaderReplacement, _HEAD, f"{_HEAD}\nin {_PLACE};\n{text}"),
            (code.AddFragmentShaderReplacement, _BODY, _FRAGMENT.format(colour=colour)),
            (code.AddVertexShaderReplacement, _HEAD, f"{_HEAD}\nout {_PLACE};\n"),
            (code.AddVertexShaderReplacement, _BODY, f"{_BODY}\n{_VERTEX}"),
        ):
            add(tag, True, lines, False)

    def _set_texture(self, name: str, image: NDArray[Any]) -> None:
        self._actor.GetProperty().SetTexture(name, _texture(image))

    def _uniforms(self) -> Any:
        return self._actor.GetShaderProperty().GetFragmentCustomUniforms()


_OUTPUTS: dict[str, Any] = {}


class Watch:
    """Hears what VTK finds wrong while it draws: programs that do not compile, lost textures."""

    def __init__(self, window: Any) -> None:
        """Listen to a vtkRenderWindow and all of VTK until `end`."""
        self.errors: list[str] = []

        @calldata_type(VTK_STRING)
        def hear(_caller: Any, _event: str, text: str | None = None) -> None:
            self.errors.append(str(text or "an error without a text"))

        # An output window outlives its wrapper. Collected with that, as the wrapper's observers
        # are, `hear` would be called as an emptied function.
        sources = [
            _OUTPUTS.setdefault(str(out.GetAddressAsString("vtkObject")), out)
            for out in [vtkOutputWindow.GetInstance()]
        ]
        if hasattr(window, "GetShaderCache"):
            sources.append(window.GetShaderCache())
        self._heard = [(each, each.AddObserver(_ERROR, hear)) for each in sources if each]

    def end(self) -> None:
        """Listen no longer."""
        for source, tag in self._heard:
            source.RemoveObserver(tag)
        self._heard = []


def exhausted(context: Any) -> bool:
    """Whether a current QOpenGLContext has run out of memory since it was last asked."""
    place = int(context.getProcAddress(b"glGetError") or 0)
    if not place:
        return False
    get_error = ctypes.CFUNCTYPE(ctypes.c_uint)(place)
    found = {get_error() for _ in range(8)}  # several kinds may be pending, one is told at a time
    return _OUT_OF_MEMORY in found


def machine_of(window: Any) -> Machine:
    """What the OpenGL context of a vtkRenderWindow says of itself; it is made where needed."""
    text = window.ReportCapabilities() or ""
    told = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    renderer = told.get("OpenGL renderer string", "").strip()
    if not renderer:
        return Machine()
    units = window.GetState().GetTextureUnitManager()
    return Machine(
        renderer,
        told.get("OpenGL version string", "").strip(),
        max(int(vtkTextureObject.GetMaximumTextureSize(window)), 0),
        # VTK counts the units that all stages share; a fragment has 16 of them at least
        min(units.GetNumberOfTextureUnits(), 16) if units else 0,
    )


def eye_of(camera: Any) -> F8:
    """Where a vtkCamera looks from, (4,) f8: its place, or the direction to it if parallel."""
    if camera.GetParallelProjection():
        return np.array([*(-each for each in camera.GetDirectionOfProjection()), 0.0])
    return np.array([*camera.GetPosition(), 1.0])


def _texture(image: NDArray[Any]) -> Any:
    """Texture of (rows, columns, 4) f4 or u8, read by `texelFetch` only."""
    rows, columns, bands = image.shape
    holder = vtkImageData()
    holder.SetDimensions(columns, rows, 1)
    holder.GetPointData().SetScalars(
        numpy_to_vtk(np.ascontiguousarray(image).reshape(-1, bands), deep=True)
    )
    texture = vtkTexture()
    texture.SetInputData(holder)
    texture.SetColorModeToDirectScalars()
    texture.InterpolateOff()
    texture.MipmapOff()
    texture.RepeatOff()
    texture.EdgeClampOn()
    return texture
