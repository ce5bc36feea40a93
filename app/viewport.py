"""The view of the surface: a scene inside Qt, with a mouse that turns, shifts and zooms it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
from PyQt6.QtCore import QEvent, QObject, QPointF, Qt, QTimer
from PyQt6.QtGui import QImage, QKeyEvent, QMouseEvent, QNativeGestureEvent, QWheelEvent
from PyQt6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleUser

from app.document import Document, Mode
from app.lit import Lit
from app.scene import FRONT, Scene
from btfcore.types import F8

DEGREES_PER_PIXEL = 0.4
ZOOM_PER_NOTCH = 1.15
REST_MS = 250
LIT_REST_MS = 80  # of stillness after which light is refined
LIGHT_REACH = 0.9  # of the way to the nearer border: a light there shines from the side
FIRST_LIGHT = np.array([-0.45, 0.5, 0.74])  # in the camera's frame
MOST_TURN = 2.9  # radians from the camera's axis, nearly from behind


class Viewport(QWidget):
    """Shows a document's surface; left drag turns, middle or space drag shifts, wheel zooms.

    Under light, Ctrl and left drag, or left drag while L is held or `light_drag` is set, moves
    the main lamp: it shines from where the pointer lies on a ball around the surface. The
    interactor is held as a member and sees no key: VTK would bind w, s, p, e, q and r.
    """

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Draw `document` from now on."""
        super().__init__(parent)
        self._document = document
        self._grip: QPointF | None = None
        self._space = self._lively = self._light_key = self._light_grip = False
        self._resting = False  # light is being refined, or was
        self.light_drag = False
        self._aimed = False  # the main lamp was given a direction
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
        self.lit = Lit(document, self.scene, self._plotter.update, self)
        self.lit.rested.connect(self._lit_rested)
        self._plotter.frameSwapped.connect(self._painted)
        self._known = False  # what draws here
        document.lighting_changed.connect(self._new_light)
        document.mesh_changed.connect(self._new_mesh)
        document.picture_changed.connect(self._new_picture)
        self._shown: object = None

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
        if self.lit.active:
            self._rest.start(LIT_REST_MS)
        elif not self._lively:
            self._rest.start(REST_MS)

    def set_light_drag(self, wanted: bool) -> None:
        """Let plain left drags move the main lamp, while light is shown."""
        self.light_drag = wanted

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
        self.lit.painted()
        if not self._known:
            self._known = True
            self._plotter.makeCurrent()
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
        return cast(QImage, self._plotter.grabFramebuffer())

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
            self._take_grip(cast(QMouseEvent, event))
            self._plotter.setFocus(Qt.FocusReason.MouseFocusReason)
            return True
        if kind == QEvent.Type.MouseButtonRelease:
            self._grip, self._light_grip = None, False
            return True
        if kind == QEvent.Type.MouseMove:
            self._drag(cast(QMouseEvent, event))
            return True
        if kind == QEvent.Type.Wheel:
            notches = cast(QWheelEvent, event).angleDelta().y() / 120
            self._zoom(ZOOM_PER_NOTCH**notches)
            return True
        if kind == QEvent.Type.NativeGesture:
            gesture = cast(QNativeGestureEvent, event)
            if gesture.gestureType() == Qt.NativeGestureType.ZoomNativeGesture:
                self._zoom(1 + gesture.value())
            return True
        if kind == QEvent.Type.FocusOut:
            self._space = self._light_key = False
        if kind == QEvent.Type.Resize and self._framed:
            self.frame()
        return False

    def _key(self, event: QKeyEvent) -> bool:
        if event.key() == Qt.Key.Key_Space and not event.isAutoRepeat():
            self._space = event.type() == QEvent.Type.KeyPress
        if event.key() == Qt.Key.Key_L and not event.isAutoRepeat():
            self._light_key = event.type() == QEvent.Type.KeyPress
        event.ignore()  # shortcuts and the window may still want it; VTK never gets it
        return True

    def _take_grip(self, event: QMouseEvent) -> None:
        """Begin a drag: of the view, or of the main lamp."""
        self._grip = event.position()
        control = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
        wanted = control or self._light_key or self.light_drag
        left = event.button() == Qt.MouseButton.LeftButton
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        self._light_grip = wanted and left and not shift and self._document.mode is Mode.LIT
        if self._light_grip:
            self._drag_light(event.position())

    def _drag_light(self, place: QPointF) -> None:
        """Let the main lamp shine from where the pointer lies on a ball around the surface."""
        width, height = self._plotter.width(), self._plotter.height()
        radius = max(min(width, height) / 2 * LIGHT_REACH, 1.0)
        x, y = (place.x() - width / 2) / radius, (height / 2 - place.y()) / radius
        away = math.hypot(x, y)
        angle = min(away * math.pi / 2, MOST_TURN)
        across = math.sin(angle) / max(away, 1e-9)
        self._aim(np.array([x * across, y * across, math.cos(angle)]))

    def _aim(self, local: F8) -> None:
        """Let the main lamp shine from a direction (3,) in the camera's frame."""
        self._aimed = True
        towards = local @ self.scene.camera.axes()
        towards /= np.linalg.norm(towards)
        self._document.move_light((float(towards[0]), float(towards[1]), float(towards[2])))

    def _drag(self, event: QMouseEvent) -> None:
        if self._grip is None:
            return
        if self._light_grip:
            self._drag_light(event.position())
            return
        moved = event.position() - self._grip
        self._grip = event.position()
        self._framed = False
        middle = bool(event.buttons() & Qt.MouseButton.MiddleButton)
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        if event.buttons() & Qt.MouseButton.RightButton:
            self._zoom(1.01 ** -moved.y())
        elif middle or shift or self._space:
            height = max(self._plotter.height(), 1)
            self.scene.camera = self.scene.camera.panned(moved.x() / height, -moved.y() / height)
            self.redraw()
        else:
            self.scene.camera = self.scene.camera.orbited(
                moved.x() * DEGREES_PER_PIXEL, -moved.y() * DEGREES_PER_PIXEL
            )
            self.redraw()

    def _zoom(self, factor: float) -> None:
        self._framed = False
        self.scene.camera = self.scene.camera.zoomed(factor)
        self.redraw()

    def _new_light(self) -> None:
        if self._document.mode is Mode.LIT:
            self.redraw()

    def _new_mesh(self) -> None:
        self._shown = None
        self._new_picture()
        self.scene.camera = FRONT
        self.frame()

    def _new_picture(self) -> None:
        if self._document.mode is Mode.LIT and not self._aimed:
            self._aim(FIRST_LIGHT)  # from where it is seen now, at first
        surface = self._document.surface
        if surface is not self._shown:
            self._shown = surface
            self.scene.show(surface)
        if not self.lit.active:  # else the frame's own evaluation puts it there
            self.scene.set_texture(self._document.texture)
        canvas = self._document.canvas
        show = self._document.mode is Mode.FIELD and canvas is not None
        self.scene.set_markers(canvas.prepared.field.singularities if show and canvas else None)
        self.redraw()
