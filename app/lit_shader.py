"""Light that the graphics card evaluates: the scene's shader, kept up with the document.

Light, camera and exposure change uniforms only. What is found at rest, cast shadows and blended
texels, is another program, which the driver compiles once and keeps.
"""

from __future__ import annotations

from typing import Any

from app.document import Lighting
from app.scene import Scene
from app.shader import Shader, Watch
from btfcore.render.glsl.decorated import PackedSurface
from btfcore.render.glsl.surface import MOST_SHADOWED, pack_shadows
from btfcore.render.lights import Lights
from btfcore.render.relight import Relighter


class LitShader:
    """Draws the scene's surface by the shader; every method must run on the thread that draws."""

    def __init__(self, scene: Scene, window: Any) -> None:
        """Prepare for a scene that is drawn in `window` (vtkRenderWindow)."""
        self._scene, self._window = scene, window
        self._shader: Shader | None = None
        self._actor: Any = None
        self._packed: PackedSurface | None = None
        self._watch: Watch | None = None
        self._lights: Lights | None = None
        self._tone: tuple[float, str] | None = None
        self._shaded: bytes | None = None  # directions of the lights whose shadows are shown
        self.fresh = False  # nothing was drawn since it was uploaded

    @property
    def shown(self) -> bool:
        """The shader draws what the scene shows."""
        return self._shader is not None and self._actor is self._scene.actor

    def show(self, packed: PackedSurface) -> None:
        """Draw by the shader from now on; what is already there is not uploaded again."""
        if self.shown and self._packed is packed:
            return
        self.remove()
        self._watch = Watch(self._window)
        self._actor, self._packed = self._scene.actor, packed
        self._shader = Shader(self._actor)
        self._shader.show(packed.samples, packed.maps)
        self.fresh = True

    def frame(self, lighting: Lighting, lights: Lights) -> None:
        """Light the surface for the scene's eye; shadows of other lights than these go."""
        if self._shader is None:
            return
        self._shader.set_eye(self._scene.eye())
        if lights is not self._lights:
            self._shader.set_lights(lights)
            self._lights = lights
        tone = lighting.exposure, lighting.curve
        if tone != self._tone:
            self._shader.set_tone(*tone)
            self._tone = tone
        if self._shaded is not None and self._shaded != _casting(lights, lighting):
            self._shader.set_shadows(None)
            self._shaded = None

    def shade(
        self, lighting: Lighting, lights: Lights, relighter: Relighter, budget_s: float
    ) -> bool:
        """Send rays for cast shadows, and show these once all are sent; return whether so."""
        wanted = _casting(lights, lighting)
        if self._shader is None or wanted == self._shaded:
            return True
        if wanted is not None:
            casters = _casters(lights)
            if not relighter.shadows.complete(casters, budget_s):
                return False
            arriving = relighter.shadows.everywhere(casters)
            self._shader.set_shadows(pack_shadows(arriving, relighter.gutter))
        self._shaded = wanted
        return True

    def smooth(self, wanted: bool) -> None:
        """Blend four texels, or take the nearest."""
        if self._shader is not None:
            self._shader.set_smooth(wanted)

    def close(self) -> None:
        """Hear no more of what VTK finds wrong."""
        if self._watch is not None:
            self._watch.end()
            self._watch = None

    def errors(self) -> list[str]:
        """What went wrong since the shader was shown."""
        return self._watch.errors if self._watch is not None else []

    def remove(self) -> None:
        """Let the scene draw its texture again."""
        if self._shader is not None:
            self._shader.remove()
        if self._watch is not None:
            self._watch.end()
        self._shader = self._actor = self._packed = self._watch = None
        self._lights = self._tone = self._shaded = None
        self.fresh = False


def _casters(lights: Lights) -> Lights:
    """The lights whose shadows are shown: none that stand for an environment, and not too many."""
    count = min(len(lights) - lights.sampled, MOST_SHADOWED)
    return Lights(lights.direction[:count].copy(), lights.intensity[:count].copy())


def _casting(lights: Lights, lighting: Lighting) -> bytes | None:
    """What shadows depend on; None where none are wanted."""
    casters = _casters(lights)
    return casters.direction.tobytes() if lighting.shadows and len(casters) else None
