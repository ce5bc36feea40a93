"""The frame loop of light: what the camera or a light moved is evaluated, shown, then refined.

Where the machine has a graphics card its shader evaluates light at full quality in every frame;
else the processor does just before a frame is painted, within what the painting leaves of a
frame's time. At rest slices of what is left to do, full quality and cast shadows, run whenever
the window has nothing else to do, so that it never waits for them.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from PyQt6.QtCore import QObject, QTimer, pyqtSignal

from app.backend import Machine, detect
from app.document import Document, Lighting
from app.lit_shader import LitShader
from app.scene import Scene
from app.shader import exhausted, machine_of
from btfcore.errors import PatinaError
from btfcore.render.glsl.decorated import PackedSurface
from btfcore.render.glsl.surface import MOST_LIGHTS, unfit_lights
from btfcore.render.lights import Lights, directional, joined
from btfcore.render.material import HarmonicMaterial
from btfcore.render.relight import Quality, Relighter

FRAME_S = 1 / 30  # aimed at while something moves
LEAST_S = 0.008  # for evaluating, however long painting takes
SLICE_S = 0.012  # of refining between two looks at the window's events
SHOW_S = 0.25  # between two pictures of a long refinement
TELL_MS = 150  # between two readings of the error while something moves
REDUCED = 2.5  # texels a pixel and axis from which a picture at rest needs mip levels
MOVING_LIGHTS, RESTING_LIGHTS = 12, 192  # in place of an environment
SKY_ORDER = 4  # of an environment's harmonics, for samples that are given in them
LONGEST = 160  # characters of a driver's complaint that are shown


@dataclass(frozen=True)
class Stages:
    """Seconds that the last frame spent on evaluating and coding, uploading, and the rest."""

    draw: float = 0.0
    upload: float = 0.0
    paint: float = 0.0


class Lit(QObject):
    """Keeps the scene's texture lit as the document says.

    told(quality, moving) after frames; backend_found(kind, reason) whenever another evaluates,
    kind being "shader" or "software"; rested() once full quality is shown; failed(text) where
    the shader is given up, or lighting for a decoration, whose colours stay.
    """

    told = pyqtSignal(object, bool)
    backend_found = pyqtSignal(str, str)
    rested = pyqtSignal()
    failed = pyqtSignal(str)

    def __init__(
        self,
        document: Document,
        scene: Scene,
        repaint: Callable[[], None],
        parent: QObject | None = None,
        *,
        window: Any = None,
    ) -> None:
        """Light what `document` shows in `scene`; `repaint` asks for a frame of `window`."""
        super().__init__(parent)
        self._card = LitShader(scene, window)
        self._machine = Machine()
        self._told_backend = ("", "")
        self._document, self._scene, self._repaint = document, scene, repaint
        self._used: Relighter | None = None
        self._broken: Relighter | None = None
        self._lighting: tuple[Lighting, Relighter, bool, Lights, Lights] | None = None
        self._slices = QTimer(self)
        self._slices.setInterval(0)
        self._slices.timeout.connect(self._refine)
        self._teller = QTimer(self)
        self._teller.setSingleShot(True)
        self._teller.timeout.connect(self._tell)
        self._height = 1
        self._still = False
        self._last_shown = 0.0
        self._begun: float | None = None
        self._others = 0.015  # seconds a frame that are not spent here
        self.stages = Stages()
        self.software = True  # what is not known yet is taken as slow

    @property
    def relighter(self) -> Relighter | None:
        """What lights the surface now; None while its colours are shown."""
        found = self._document.lit
        return None if found is self._broken else found

    @property
    def active(self) -> bool:
        """Light is shown."""
        return self.relighter is not None

    @property
    def refining(self) -> bool:
        """Slices of full quality are being evaluated."""
        return self._slices.isActive()

    @property
    def resting(self) -> bool:
        """Nothing moved since full quality was reached."""
        found = self.relighter
        done = self._card.shown or (found is not None and found.finished)
        return self._still and not self.refining and found is not None and done

    @property
    def uploaded(self) -> bool:
        """The next frame is the first that the shader draws of what was uploaded."""
        return self._card.fresh

    def moved(self) -> None:
        """Something moves: the next frame is evaluated before it is painted."""
        self._still = False
        self._slices.stop()

    def before_paint(self, height: int) -> None:
        """Bring the surface up to date for a frame `height` pixels high, unless it rests."""
        self._height = height
        self._begun = None
        if not self._still:
            self._guarded(self._draw)

    def painted(self, context: Any = None) -> None:
        """Hear that a frame is on the screen; `context`: its QOpenGLContext, which is current."""
        if self._card.fresh:
            self._card.fresh = False
            if context is not None and exhausted(context):
                self._refuse(self.tr("its memory is used up"))
        if self.broken():
            self._repaint()
        if self._begun is not None:
            others = time.perf_counter() - self._begun
            self.stages = Stages(self.stages.draw, self.stages.upload, others)
            self._others += 0.3 * (min(others, 0.2) - self._others)
            self._begun = None

    def broken(self) -> bool:
        """The shader failed since this was asked last: the processor takes over, as is told."""
        errors = self._card.errors()
        if errors:
            self._refuse(_gist(errors))
        return bool(errors)

    def follow(self) -> None:
        """Hear that the document shows something else; the scene's texture counts again."""
        if not self._fits(self.relighter):
            self._card.remove()

    def rest(self) -> None:
        """Nothing moves any more: refine from now on."""
        if self.active and not self.refining:
            self._still = True
            self._last_shown = time.perf_counter()
            self._slices.start()

    def settle(self) -> None:
        """Refine to the end at once, for a picture."""
        self._slices.stop()
        self._still = True

        def through(relighter: Relighter) -> None:
            if self._shader_draws(relighter):
                while not self._shade(relighter, 1.0):
                    pass
                return
            self._ask(relighter, resting=True)
            relighter.finish()
            self._upload(relighter)

        self._guarded(through)

    def find_backend(self, window: Any) -> None:
        """Learn from a vtkRenderWindow whose context is current what draws here."""
        self._machine = machine_of(window)
        found = detect(self._machine)
        self.software = not found.is_shader
        self._document.shader_wanted = found.is_shader
        self._scene.set_backdrop(plain=self.software)
        self._tell_backend(found.kind, found.reason)

    def stop(self) -> None:
        """Do nothing any more."""
        self._slices.stop()
        self._teller.stop()
        self._card.close()

    # --- the graphics card

    def _fits(self, relighter: Relighter | None) -> bool:
        """The shader is to draw, and can; why it cannot is told."""
        if relighter is None or self.software:
            return False
        packed = self._document.packed
        why = packed if isinstance(packed, str) else ""
        if packed is None:
            why = "the surface was prepared before a graphics card was found"
        if not why:
            why = unfit_lights(self._lights_now(relighter, True)[1])
        if why:
            self._tell_backend("software", self.tr("Not on the graphics card: {0}.").format(why))
        return not why

    def _shader_draws(self, relighter: Relighter) -> bool:
        """Let the shader draw where it can; return whether it does."""
        if not self._fits(relighter):
            if self._card.shown:
                self._card.remove()
                self._used = None
            return False
        packed = self._document.packed
        assert isinstance(packed, PackedSurface)
        self._card.show(packed)
        self._tell_backend("shader", self._machine.renderer)
        return True

    def _shade(self, relighter: Relighter, budget_s: float) -> bool:
        """Light the surface as it is at rest; return whether all shadows are there."""
        lighting, lights, _ = self._lights_now(relighter, True)
        self._card.frame(lighting, lights)
        self._card.smooth(True)
        return self._card.shade(lighting, lights, relighter, budget_s)

    def _refuse(self, why: str) -> None:
        """Give the shader up until the program ends."""
        self._card.remove()
        self.software, self._document.shader_wanted = True, False
        self._used = None
        reason = self.tr("The shader failed on {0}: {1}").format(self._machine.renderer, why)
        self._tell_backend("software", reason)
        self.failed.emit(self.tr("{0}. The processor evaluates the light.").format(reason))
        self.moved()
        self._repaint()

    def _tell_backend(self, kind: str, reason: str) -> None:
        if (kind, reason) != self._told_backend:
            self._told_backend = kind, reason
            self.backend_found.emit(kind, reason)

    # --- inside

    def _guarded(self, act: Callable[[Relighter], None]) -> None:
        """Do something with the relighter; what it raises is told, and colours are shown."""
        relighter = self.relighter
        if relighter is None:
            self._slices.stop()
            return
        try:
            act(relighter)
        except (PatinaError, MemoryError) as error:
            self._give_up(relighter, str(error) or "there is not enough memory for this")
        except Exception as error:  # a defect of ours must not take the window down
            self._give_up(relighter, f"internal error: {type(error).__name__}: {error}")

    def _give_up(self, relighter: Relighter, text: str) -> None:
        self.stop()
        self._broken = relighter
        self._scene.set_texture(self._document.texture)
        self._repaint()
        self.failed.emit(self.tr("The light cannot be shown: {0}").format(text))

    def _draw(self, relighter: Relighter) -> None:
        if self._shader_draws(relighter):
            self._begun = time.perf_counter()
            lighting, _, moving = self._lights_now(relighter, True)
            self._card.frame(lighting, moving)
            self._card.smooth(False)
            self.stages = Stages(time.perf_counter() - self._begun, 0.0, self.stages.paint)
            if not self._teller.isActive():
                self._teller.start(TELL_MS)
            return
        self._ask(relighter, resting=False)
        start = time.perf_counter()
        changed = relighter.draw(max(FRAME_S - self._others, LEAST_S))
        drawn = time.perf_counter()
        if changed or relighter is not self._used:
            self._upload(relighter, smooth=False)
            self._begun = time.perf_counter()
            self.stages = Stages(drawn - start, self._begun - drawn, self.stages.paint)
            if not self._teller.isActive():
                self._teller.start(TELL_MS)

    def _refine(self) -> None:
        self._guarded(self._slice)

    def _slice(self, relighter: Relighter) -> None:
        if self._shader_draws(relighter):
            done = self._shade(relighter, SLICE_S)
            if done:
                self._repaint()
                self._rested(Quality("full", 0.0))
            return
        self._ask(relighter, resting=True)
        done = relighter.refine(SLICE_S)
        now = time.perf_counter()
        if not done and now - self._last_shown < SHOW_S:
            return
        self._last_shown = now
        if relighter.show() or relighter is not self._used or self._reduced(relighter):
            self._upload(relighter)
            self._repaint()
        if done:
            self._rested(relighter.quality())
        else:
            self.told.emit(relighter.quality(), False)

    def _rested(self, quality: Quality) -> None:
        self._slices.stop()
        self._teller.stop()
        self.told.emit(quality, False)
        self.rested.emit()

    def _upload(self, relighter: Relighter, *, smooth: bool | None = None) -> None:
        wanted = self._reduced(relighter) if smooth is None else smooth
        self._scene.set_texture(relighter.image, radiance=True)
        self._scene.filter_reduced(wanted)
        self._used = relighter

    def _tell(self) -> None:
        def tell(relighter: Relighter) -> None:
            if self._card.shown:
                self.told.emit(Quality("full", 0.0), False)
                return
            quality = relighter.quality()
            self.told.emit(quality, quality != Quality("full", 0.0, quality.lights, 1.0))

        self._guarded(tell)

    def _reduced(self, relighter: Relighter) -> bool:
        return self._scene.reduction(relighter.step, self._height) > REDUCED

    def _ask(self, relighter: Relighter, *, resting: bool) -> None:
        lighting, lights, moving = self._lights_now(relighter, False)
        relighter.everything(resting and self._reduced(relighter))
        relighter.look(self._scene.eye())
        relighter.light(lights, moving=moving, shadows=lighting.shadows)
        relighter.expose(lighting.exposure, lighting.curve)

    def _lights_now(self, relighter: Relighter, shader: bool) -> tuple[Lighting, Lights, Lights]:
        """The document's lighting, its lights at rest, and the fewer ones while it moves."""
        lighting, known = self._document.lighting, self._lighting
        if known is None or known[:3] != (lighting, relighter, shader):
            harmonic = any(isinstance(each, HarmonicMaterial) for each in relighter.materials)
            most = min(RESTING_LIGHTS, max(MOST_LIGHTS - len(lighting.lamps), 1))
            lights = lights_of(
                lighting, resting=most if shader else RESTING_LIGHTS,
                order=SKY_ORDER if harmonic else None,
            )  # fmt: skip
            known = self._lighting = (lighting, relighter, shader, *lights)
        return known[0], known[3], known[4]


def lights_of(
    lighting: Lighting, *, resting: int = RESTING_LIGHTS, order: int | None = None
) -> tuple[Lights, Lights]:
    """Lights at rest, and the fewer ones while something moves.

    resting : in place of an environment. order : of its harmonics that go along; None: none.
    """
    lamps = [
        directional(lamp.direction, np.array([lamp.colour]) * lamp.strength)
        for lamp in lighting.lamps
    ]
    sky = lighting.environment
    if sky is None:
        alone = joined(lamps)
        return alone, alone
    most, few = (
        joined([*lamps, sky.lights(count, rotation=lighting.turn, order=order)])
        for count in (resting, min(MOVING_LIGHTS, resting))
    )
    return most, few


def _gist(errors: list[str]) -> str:
    """What a driver complains about first, in a line; it repeats the program's own before."""
    lines = [line.strip() for text in errors for line in text.splitlines()]
    own = [line for line in lines if not re.match(r"\d+: |ERROR: In |$", line)]
    telling = [line for line in own if re.search(r"error\b.*:", line, re.IGNORECASE)]
    found = (telling or own or ["of an unknown cause"])[0]
    return found[:LONGEST].rstrip(". ")
