"""The view of the surface: a scene inside Qt, with a mouse that turns, shifts and zooms it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

from PyQt6.QtCore import QEvent, QObject, QPointF, Qt, QTimer
from PyQt6.QtGui import QImage, QKeyEvent, QMouseEvent, QNativeGestureEvent, QWheelEvent
from PyQt6.QtWidgets import QVBoxLayout, QWidget
from pyvistaqt import QtInteractor
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleUser

from app.document import Document, Mode
from app.scene import FRONT, Scene

DEGREES_PER_PIXEL = 0.4
ZOOM_PER_NOTCH = 1.15
REST_MS = 250


class Viewport(QWidget):
    """Shows a document's surface; left drag turns, middle or space drag shifts, wheel zooms.

    The interactor is held as a member and sees no key: VTK would bind w, s, p, e, q and r.
    """

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Draw `document` from now on."""
        super().__init__(parent)
        self._document = document
        self._grip: QPointF | None = None
        self._space = self._lively = False
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
        self._plotter.update()
        if not self._lively:
            self._rest.start(REST_MS)

    def set_lively(self, lively: bool) -> None:
        """While frames come by themselves none is worth the time for smooth edges."""
        self._lively = lively
        if lively:
            self._rest.stop()
        else:
            self._rest.start(REST_MS)

    def _refine(self) -> None:
        """Draw a picture at rest with smooth edges, which is too slow for one in motion."""
        self.scene.smooth_edges(True)
        self._plotter.update()

    def picture(self) -> QImage:
        """Return what the view shows at rest, drawn anew."""
        self.scene.place_camera()
        self.scene.smooth_edges(True)
        return cast(QImage, self._plotter.grabFramebuffer())

    def close_view(self) -> None:
        """Let go of the graphics card; the view draws nothing afterwards."""
        self._rest.stop()
        self._plotter.removeEventFilter(self)
        self._plotter.close()

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Take mouse and keys before VTK does."""
        if event is None:
            return False
        kind = event.type()
        if kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
            return self._key(cast(QKeyEvent, event))
        if kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonDblClick):
            self._grip = cast(QMouseEvent, event).position()
            self._plotter.setFocus(Qt.FocusReason.MouseFocusReason)
            return True
        if kind == QEvent.Type.MouseButtonRelease:
            self._grip = None
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
            self._space = False
        if kind == QEvent.Type.Resize and self._framed:
            self.frame()
        return False

    def _key(self, event: QKeyEvent) -> bool:
        if event.key() == Qt.Key.Key_Space and not event.isAutoRepeat():
            self._space = event.type() == QEvent.Type.KeyPress
        event.ignore()  # shortcuts and the window may still want it; VTK never gets it
        return True

    def _drag(self, event: QMouseEvent) -> None:
        if self._grip is None:
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

    def _new_mesh(self) -> None:
        self._shown = None
        self._new_picture()
        self.scene.camera = FRONT
        self.frame()

    def _new_picture(self) -> None:
        surface = self._document.surface
        if surface is not self._shown:
            self._shown = surface
            self.scene.show(surface)
        self.scene.set_texture(self._document.texture)
        canvas = self._document.canvas
        show = self._document.mode is Mode.FIELD and canvas is not None
        self.scene.set_markers(canvas.prepared.field.singularities if show and canvas else None)
        self.redraw()
