"""The view of the surface: a scene inside Qt, with a mouse that turns, shifts and zooms it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

from PyQt6.QtCore import QEvent, QObject, Qt, QTimer, pyqtSignal
from PyQt6.QtGui import QImage, QKeyEvent, QMouseEvent, QNativeGestureEvent, QWheelEvent
from PyQt6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleUser

from app.document import Document, Mode
from app.lit import Lit
from app.navigation import Device, Verb, device_of, gesture_verb, wheel_way
from app.picking import View
from app.scene import FRONT, Scene
from app.steering import CameraDrag, LightDrag, Steering
from btfcore.render.camera import Turntable

REST_MS = 250
LIT_REST_MS = 80  # of stillness after which light is refined


@dataclass(frozen=True)
class _Point:
    """A mouse's event, as far as steering reads it."""

    pixel: tuple[float, float]
    button: Qt.MouseButton
    modifiers: Qt.KeyboardModifier
    kind: str = "mouse"


class Viewport(QWidget):
    """Shows a document's surface, and moves the camera by what no tool takes.

    `steering` says which drags are the camera's. Under light, Ctrl and left drag, or left drag
    while L is held or `set_light_drag` is on, moves the main lamp. The interactor is held as a
    member and sees no key: VTK would bind w, s, p, e, q and r. moved() : another frame is asked
    for, perhaps from another side.
    """

    moved = pyqtSignal()

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Draw `document` from now on."""
        super().__init__(parent)
        self._document = document
        self._hand: CameraDrag | LightDrag | None = None  # who has the drag
        self._button = Qt.MouseButton.NoButton  # that began it
        self._lively = False
        self._resting = False  # light is being refined, or was
        self._framed = True  # the user has not moved the camera since it was framed
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        self._plotter: Any = QtInteractor(
            self, auto_update=False, multi_samples=0, lighting="none", border=False
        )
        self._plotter.iren.interactor.SetInteractorStyle(vtkInteractorStyleUser())
        self._plotter.setAcceptDrops(False)  # drops belong to the window
        self._plotter.setMinimumSize(240, 180)
        self._plotter.setAccessibleName(self.tr("View of the decorated mesh"))
        self._plotter.installEventFilter(self)
        self._rest = QTimer(self)
        self._rest.setSingleShot(True)
        self._rest.timeout.connect(self._refine)
        layout.addWidget(self._plotter)
        self.scene = Scene(self._plotter)
        self.scene.camera = FRONT
        self.steering = Steering(document, lambda: self.scene.camera, self.place, self._size)
        self.lit = Lit(
            document, self.scene, self._plotter.update, self, window=self._plotter.render_window
        )
        self.lit.rested.connect(self._lit_rested)
        self._plotter.frameSwapped.connect(self._painted)
        self._known = False  # what draws here
        document.lighting_changed.connect(self._new_light)
        document.mesh_changed.connect(self._new_mesh)
        document.picture_changed.connect(self._new_picture)
        self._shown: object = None

    @property
    def surface(self) -> QWidget:
        """The widget that is drawn on and gets the pointer's events."""
        return cast(QWidget, self._plotter)

    def view(self) -> View:
        """Camera and size in logical pixels."""
        return View(self.scene.camera, self._size())

    def place(self, camera: Turntable) -> None:
        """Look through another camera."""
        self._framed = False
        self.scene.camera = camera
        self.redraw()

    def _size(self) -> tuple[int, int]:
        return self._plotter.width(), self._plotter.height()

    def frame(self) -> None:
        """Bring the whole surface into view."""
        self._framed = True
        self.scene.frame(aspect=self._plotter.width() / max(self._plotter.height(), 1))
        self.redraw()

    def look(self, *, azimuth: float, elevation: float = 18.0) -> None:
        """Look from another side, at the whole surface."""
        self.scene.camera = replace(self.scene.camera, azimuth=azimuth, elevation=elevation)
        self.frame()

    def redraw(self) -> None:
        """Ask for a frame; many requests between two frames cost one."""
        self.scene.place_camera()
        self.scene.smooth_edges(False)
        self.lit.moved()
        if self.lit.software:  # where averaging would take the better part of a frame
            self.scene.filter_reduced(False)
        self._resting = False
        self._plotter.update()
        self.moved.emit()
        if self.lit.active:
            self._rest.start(LIT_REST_MS)
        elif not self._lively:
            self._rest.start(REST_MS)

    def set_light_drag(self, wanted: bool) -> None:
        """Let plain left drags move the main lamp, while light is shown."""
        self.steering.light_drag = wanted

    def set_lively(self, lively: bool) -> None:
        """While frames come by themselves none is worth the time for smooth edges."""
        self._lively = lively
        if lively:
            self._rest.stop()
        else:
            self._rest.start(REST_MS)

    def _refine(self) -> None:
        """Draw a picture at rest with smooth edges, which is too slow for one in motion."""
        if self.lit.active and not self._resting:
            self._resting = True
            self.lit.rest()
            return
        if not self.lit.active:
            self.scene.filter_reduced(True)
        self.scene.smooth_edges(True)
        self._plotter.update()

    def _painted(self) -> None:
        if not self._known or self.lit.uploaded:
            self._plotter.makeCurrent()
        self.lit.painted(self._plotter.context())
        if not self._known:
            self._known = True
            self.lit.find_backend(self._plotter.render_window)

    def _lit_rested(self) -> None:
        """Full quality is there; smooth edges follow, if nothing moves until then."""
        if self._resting and not self._lively:
            self._rest.start(REST_MS - LIT_REST_MS)

    def picture(self) -> QImage:
        """Return what the view shows at rest, drawn anew."""
        self.scene.place_camera()
        if self.lit.active:
            self.lit.settle()
        else:
            self.scene.filter_reduced(True)
        self.scene.smooth_edges(True)
        drawn = self._plotter.grabFramebuffer()
        if self.lit.broken():  # then the processor takes over
            self.lit.settle()
            drawn = self._plotter.grabFramebuffer()
        return cast(QImage, drawn)

    def close_view(self) -> None:
        """Let go of the graphics card; the view draws nothing afterwards."""
        self._rest.stop()
        self.lit.stop()
        self._plotter.removeEventFilter(self)
        self._plotter.close()

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Take mouse and keys before VTK does."""
        if event is None:
            return False
        kind = event.type()
        if kind == QEvent.Type.Paint:
            self.lit.before_paint(self._plotter.height())
            return False
        if kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
            return self._key(cast(QKeyEvent, event))
        if kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
            self._press(cast(QMouseEvent, event))
            return True
        if kind == QEvent.Type.MouseButtonRelease:
            self._release(cast(QMouseEvent, event))
            return True
        if kind == QEvent.Type.MouseMove:
            self._drag(cast(QMouseEvent, event))
            return True
        if kind == QEvent.Type.Wheel:
            self._roll(cast(QWheelEvent, event))
            return True
        if kind == QEvent.Type.NativeGesture:
            self._gesture(cast(QNativeGestureEvent, event))
            return True
        if kind == QEvent.Type.FocusOut:
            self.steering.held.clear()
        if kind == QEvent.Type.Resize and self._framed:
            self.frame()
        return False

    def _key(self, event: QKeyEvent) -> bool:
        if not event.isAutoRepeat():
            self.steering.press_key(event.key(), event.type() == QEvent.Type.KeyPress)
        event.ignore()  # shortcuts and the window may still want it; VTK never gets it
        return True

    def _press(self, event: QMouseEvent) -> None:
        """Begin a drag: of the view, or of the main lamp."""
        self._plotter.setFocus(Qt.FocusReason.MouseFocusReason)
        if event.button() == self._button or not event.buttons() & self._button:
            self._hand = None  # its release went elsewhere
        if self._hand is None:
            point = _point(event)
            self._hand = self.steering.hand(point, tool=False)
            if self._hand is not None:
                self._button = point.button
                self._hand.press(point)

    def _drag(self, event: QMouseEvent) -> None:
        if not event.buttons() & self._button:
            self._hand = None
        if self._hand is not None:
            self._hand.drag(_point(event))

    def _release(self, event: QMouseEvent) -> None:
        if self._hand is not None and (
            event.button() == self._button or not event.buttons() & self._button
        ):
            self._hand.release(_point(event))
            self._hand = None

    def _roll(self, event: QWheelEvent) -> None:
        angle, pixels = event.angleDelta(), event.pixelDelta()
        way = (angle.x(), angle.y()), (pixels.x(), pixels.y())
        device = event.pointingDevice()
        self.steering.roll(
            (event.position().x(), event.position().y()),
            wheel_way(*way, event.modifiers()),
            event.modifiers(),
            device_of(device.type()) if device is not None else Device.MOUSE,
        )

    def _gesture(self, event: QNativeGestureEvent) -> None:
        pixel = event.position().x(), event.position().y()
        verb = gesture_verb(event.gestureType())
        if verb is Verb.ZOOM:
            self.steering.pinch(pixel, event.value())
        elif verb is Verb.PAN:
            self.steering.drag(verb, (event.delta().x(), event.delta().y()), pixel)
        elif verb is Verb.FRAME_SELECTED:
            self.frame()

    def _new_light(self) -> None:
        if self._document.mode is Mode.LIT:
            self.redraw()

    def _new_mesh(self) -> None:
        self._shown = None
        self._new_picture()
        self.scene.camera = FRONT
        self.frame()

    def _new_picture(self) -> None:
        if self._document.mode is Mode.LIT and not self.steering.aimed:
            self.steering.aim()  # from where it is seen now, at first
        surface = self._document.surface
        if surface is not self._shown:
            self._shown = surface
            self.scene.show(surface)
        self.lit.follow()
        if not self.lit.active:  # else the frame's own evaluation puts it there
            self.scene.set_texture(self._document.texture)
        canvas = self._document.canvas
        show = self._document.mode is Mode.FIELD and canvas is not None
        self.scene.set_markers(canvas.prepared.field.singularities if show and canvas else None)
        self.redraw()


def _point(event: QMouseEvent) -> _Point:
    place = event.position()
    return _Point((place.x(), place.y()), event.button(), event.modifiers())
