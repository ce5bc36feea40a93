"""The frame loop of light: what the camera or a light moved is evaluated, shown, then refined.

While something moves a frame is evaluated just before it is painted, within what the painting
leaves of a frame's time. At rest slices of full quality run whenever the window has nothing else
to do, so that it never waits for them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from PyQt6.QtCore import QObject, QTimer, pyqtSignal

from app.backend import detect
from app.document import Document, Lighting
from app.scene import Scene
from app.shader import machine_of
from btfcore.errors import PatinaError
from btfcore.render.importance import LightTree
from btfcore.render.lights import Lights, directional, joined
from btfcore.render.relight import Quality, Relighter

FRAME_S = 1 / 30  # aimed at while something moves
LEAST_S = 0.008  # for evaluating, however long painting takes
SLICE_S = 0.012  # of refining between two looks at the window's events
SHOW_S = 0.25  # between two pictures of a long refinement
TELL_MS = 150  # between two readings of the error while something moves
REDUCED = 2.5  # texels a pixel and axis from which a picture at rest needs mip levels
MOVING_LIGHTS, RESTING_LIGHTS = 12, 192  # in place of an environment


@dataclass(frozen=True)
class Stages:
    """Seconds that the last frame spent on evaluating and coding, uploading, and the rest."""

    draw: float = 0.0
    upload: float = 0.0
    paint: float = 0.0


class Lit(QObject):
    """Keeps the scene's texture lit as the document says.

    told(quality, moving) after frames; backend_found(kind, reason) once the view is drawn;
    rested() once full quality is shown; failed(text) where lighting is given up for a
    decoration, whose colours stay.
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
    ) -> None:
        """Light what `document` shows in `scene`; `repaint` asks for a frame."""
        super().__init__(parent)
        self._document, self._scene, self._repaint = document, scene, repaint
        self._used: Relighter | None = None
        self._broken: Relighter | None = None
        self._lighting: tuple[Lighting, Lights, Lights] | None = None
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
        return self._still and not self.refining and found is not None and found.finished

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

    def painted(self) -> None:
        """Hear that a frame is on the screen."""
        if self._begun is not None:
            others = time.perf_counter() - self._begun
            self.stages = Stages(self.stages.draw, self.stages.upload, others)
            self._others += 0.3 * (min(others, 0.2) - self._others)
            self._begun = None

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
            self._ask(relighter, resting=True)
            relighter.finish()
            self._upload(relighter)

        self._guarded(through)

    def find_backend(self, window: Any) -> None:
        """Learn from a vtkRenderWindow whose context is current what draws here."""
        machine = machine_of(window)
        found = detect(machine)
        self.software = not found.is_shader
        reason = found.reason
        if found.is_shader:
            reason = self.tr("The processor evaluates the light; {0} draws.").format(
                machine.renderer
            )
        self.backend_found.emit("software", reason)

    def stop(self) -> None:
        """Do nothing any more."""
        self._slices.stop()
        self._teller.stop()

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
            self._slices.stop()
            self._teller.stop()
            self.told.emit(relighter.quality(), False)
            self.rested.emit()
        else:
            self.told.emit(relighter.quality(), False)

    def _upload(self, relighter: Relighter, *, smooth: bool | None = None) -> None:
        wanted = self._reduced(relighter) if smooth is None else smooth
        self._scene.set_texture(relighter.image, radiance=True)
        self._scene.filter_reduced(wanted)
        self._used = relighter

    def _tell(self) -> None:
        def tell(relighter: Relighter) -> None:
            quality = relighter.quality()
            self.told.emit(quality, quality != Quality("full", 0.0, quality.lights, 1.0))

        self._guarded(tell)

    def _reduced(self, relighter: Relighter) -> bool:
        return self._scene.reduction(relighter.step, self._height) > REDUCED

    def _ask(self, relighter: Relighter, *, resting: bool) -> None:
        lighting = self._document.lighting
        if self._lighting is None or self._lighting[0] is not lighting:
            self._lighting = (lighting, *lights_of(lighting))
        _, lights, moving = self._lighting
        relighter.everything(resting and self._reduced(relighter))
        relighter.look(self._scene.eye())
        relighter.light(lights, moving=moving, shadows=lighting.shadows)
        relighter.expose(lighting.exposure, lighting.curve)


def lights_of(lighting: Lighting) -> tuple[Lights, Lights]:
    """Lights at rest, and the fewer ones while something moves."""
    lamps = [
        directional(lamp.direction, np.array([lamp.colour]) * lamp.strength)
        for lamp in lighting.lamps
    ]
    sky = lighting.environment
    if sky is None:
        alone = joined(lamps)
        return alone, alone
    return tuple(  # type: ignore[return-value]
        joined([*lamps, _from_all_around(sky, count, lighting)])
        for count in (RESTING_LIGHTS, MOVING_LIGHTS)
    )


def _from_all_around(sky: LightTree, count: int, lighting: Lighting) -> Lights:
    return sky.lights(count, rotation=lighting.turn)
