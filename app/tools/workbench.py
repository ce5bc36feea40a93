"""All tools of a view: which one is in use, what they see, and the commands for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, cast

from PyQt6.QtCore import QEvent, QObject, Qt, pyqtSignal
from PyQt6.QtGui import QAction, QKeyEvent

from app.document import Document
from app.navigation import VIEWS, looking
from app.picking import Picker, View
from app.settings import Settings
from app.tasks import Tasks
from app.tools.adjust import (
    HARDER,
    LARGER,
    Adjust,
    GiveUp,
    hardened,
    mirrored,
    resized,
    turned,
)
from app.tools.base import Hand, PointerEvent, Tool
from app.tools.brush import PaintBrush
from app.tools.desk import Desk
from app.tools.erase import EraseBrush
from app.tools.light import LightTool
from app.tools.marks import Marks
from app.tools.measure import Measure, Place, ruler_of
from app.tools.orient import Orient
from app.tools.overlay import Overlay
from app.tools.pick import Pick
from app.tools.pointer import Pointer
from app.tools.protect import ProtectBrush
from app.tools.repair import RepairBrush, RequiltBrush
from app.tools.stamp import NOTCH, Stamp
from app.units import length_text
from app.viewport import Viewport
from btfcore.files.surface import ExportSurface
from btfcore.progress import Progress
from btfcore.types import F8

if TYPE_CHECKING:
    from app.edits import Edits
    from app.keys import Keymap
    from btfcore.paint.ruler import Ruler, Way

COMMANDS = {  # tools by the command that takes them
    "tool.navigate": "view", "tool.orient": "orient", "tool.brush": "paint",
    "tool.stamp": "stamp", "tool.erase": "erase", "tool.repair": "repair",
    "tool.mask": "protect", "tool.light": "light", "tool.pick": "pick",
    "tool.measure": "measure",
}  # fmt: skip
_PRESSES = (QEvent.Type.MouseButtonPress, QEvent.Type.TabletPress)


class Workbench(QObject):
    """The stage of all tools of `viewport`; the document says which one is in use.

    told(text) : a sentence for the user. synthesize_wanted() : along the drawn directions.
    """

    told = pyqtSignal(str)
    synthesize_wanted = pyqtSignal()

    def __init__(
        self,
        viewport: Viewport,
        document: Document,
        edits: Edits,
        settings: Settings | None = None,
        parent: QObject | None = None,
    ) -> None:
        """Put tools over `viewport`; without settings there are those of a new user."""
        super().__init__(parent if parent is not None else viewport)
        self.viewport, self.document, self.settings = viewport, document, settings
        self._picker: Picker | None = None
        self._surface: ExportSurface | None = None  # that the picker is for, or is being made for
        self._picking, self._measuring = Tasks(self), Tasks(self)
        self._ruler: tuple[ExportSurface, Ruler] | None = None
        self._question: tuple[Place, Place, Callable[[Way], None]] | None = None
        self.overlay = Overlay(self, viewport)
        self.overlay.show()
        self.pointer = Pointer(self._claim, parent=self)
        self.last: F8 | None = None  # place that was touched last, in world units
        desk = self.desk = Desk(document, edits, self.told.emit, self._touched)
        orient = self._orient = Orient(self, desk, self)
        orient.synthesize_wanted.connect(self.synthesize_wanted)
        brushes = (PaintBrush, EraseBrush, RepairBrush, RequiltBrush, ProtectBrush)
        self.tools: dict[str, Tool] = {
            "orient": orient,
            **{each.name: each(self, desk, self) for each in brushes},
            "stamp": Stamp(self, desk, self),
            "light": LightTool(self, document, viewport.steering.light_hand, desk.tell, self),
            "pick": Pick(self, desk, self),
            "measure": Measure(self, self._length, self._ask, self),
        }
        self.adjust = Adjust(self, document, self._length, self._take_tool, self)
        self._actions: dict[str, QAction] = {}
        self.pointer.attach(viewport.surface)
        self.pointer.set_eraser(self.tools["erase"])
        self._watched = viewport.surface
        self._watched.installEventFilter(self)
        viewport.moved.connect(self.overlay.follow)
        document.mesh_changed.connect(self._follow_surface)
        document.picture_changed.connect(self._follow_surface)
        document.tool_changed.connect(self._take_tool)
        for changed in (document.options_changed, document.painting_changed):
            changed.connect(self._show_again)
        self._picking.finished.connect(lambda name, value: self._take_picker(*value))
        self._picking.failed.connect(lambda name, text: self.told.emit(text))
        self._picking.idle.connect(self._follow_surface)
        self._measuring.finished.connect(lambda name, value: self._answer(*value))
        self._measuring.idle.connect(self._measure)
        if settings is not None:
            settings.changed.connect(lambda names: self._take_settings())
        self._take_settings()
        self._take_tool()
        self._follow_surface()

    # --- the stage

    @property
    def picker(self) -> Picker | None:
        """Finds places on the surface that is shown."""
        return self._picker

    def view(self) -> View:
        """Camera and size of the view."""
        return self.viewport.view()

    def draw(self, marks: Marks) -> None:
        """Show marks over the view."""
        self.overlay.draw(marks)

    def _follow_surface(self) -> None:
        """Have a picker made for the surface that is shown."""
        surface, canvas = self.document.surface, self.document.canvas
        if surface is self._surface or self._picking.busy:
            return
        self._surface, self._picker = surface, None
        self.pointer.cancel()
        self.draw(())
        if surface is None:
            return
        dense = canvas.prepared.dense if canvas and canvas.surface is surface else None

        def job(progress: Progress, report: object) -> tuple[ExportSurface, Picker]:
            return surface, Picker(surface, dense=dense)

        self._picking.start("pick", job)

    def _take_picker(self, surface: ExportSurface, picker: Picker) -> None:
        if surface is self._surface:
            self._picker = picker
            self._show_again()

    # --- tools

    def _take_tool(self) -> None:
        """Put the document's tool into the user's hand."""
        self.pointer.set_tool(self.tools.get(self.document.tool))
        for command, action in self._actions.items():
            if command in COMMANDS:
                action.setChecked(COMMANDS[command] == self.document.tool)
        self._show_again()

    def _show_again(self) -> None:
        """Show what the pointer would do where it is; options or tool have changed."""
        tool, place = self.pointer.tool, self.pointer.place
        if tool is None or self.pointer.dragging or self.adjust.active:
            return
        if self.viewport.surface.underMouse() or self.overlay.marks:
            tool.hover(place)
        else:
            tool.leave()  # what is shown wherever the pointer is

    def _claim(self, event: PointerEvent) -> Hand | None:
        """Give a press to camera or lamp, where it is theirs."""
        if self.pointer.tool is self.adjust:
            right = event.button == Qt.MouseButton.RightButton
            return GiveUp(self.adjust) if right else None
        return cast(
            "Hand | None", self.viewport.steering.hand(event, tool=self.pointer.tool is not None)
        )

    def eventFilter(self, target: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Take the keyboard with a press; while a value is set Escape is for that."""
        if event is None or target is not self._watched:
            return False
        kind = event.type()
        if kind in _PRESSES:
            self.viewport.surface.setFocus(Qt.FocusReason.MouseFocusReason)
        elif kind == QEvent.Type.ShortcutOverride and self.adjust.active:
            if cast(QKeyEvent, event).key() == Qt.Key.Key_Escape:
                event.accept()
                return True
        elif kind in (QEvent.Type.FocusOut, QEvent.Type.Hide) and self.adjust.active:
            self.adjust.cancel()
        return False

    def set_by_pointer(self, option: str) -> bool:
        """Set "radius" or "hardness" by moving the pointer; False where it is off the surface."""
        if self.pointer.dragging or self.adjust.active:
            return False
        if not self.adjust.begin(option, self.pointer.place):
            return False
        self.pointer.set_tool(self.adjust)
        return True

    def cancel(self) -> bool:
        """Cancel the drag, or the value that is being set; False where there is neither."""
        if self.adjust.active:
            self.adjust.cancel()
            return True
        dragging = self.pointer.dragging
        self.pointer.cancel()
        return dragging

    def undo(self) -> bool:
        """Take back a step: of the directions while they are drawn, else of the painting."""
        drawn = self.document.tool == "orient" and self._orient.undo()
        return drawn or self.desk.edits.undo()

    def redo(self) -> bool:
        """Do a step again."""
        drawn = self.document.tool == "orient" and self._orient.redo()
        return drawn or self.desk.edits.redo()

    def close(self) -> None:
        """Let nothing run any more, and hear no events."""
        self.pointer.set_tool(None)
        for each in (self, self.pointer):
            self._watched.removeEventFilter(each)
        for tasks in (self._picking, self._measuring, self._orient.tasks):
            tasks.close()

    def _touched(self, place: F8) -> None:
        self.last = place
        if self.settings is not None and self.settings.values.pivot == "stroke":
            self.viewport.steering.pivot = self.viewport.scene.place.to_scene(place)

    def pivot_stroke(self) -> None:
        """Orbit round the last stroke from now on, or as before where that is so already."""
        steering = self.viewport.steering
        if steering.pivot is None and self.last is not None:
            steering.pivot = self.viewport.scene.place.to_scene(self.last)
            self.told.emit(self.tr("Orbiting round the last stroke."))
        else:
            steering.pivot = None
            self.told.emit(self.tr("Orbiting round the middle of the view."))

    def _take_settings(self) -> None:
        if self.settings is None:
            return
        values = self.settings.values
        self.pointer.curve = values.pressure
        self.viewport.steering.preset = values.navigation
        if values.pivot == "view":
            self.viewport.steering.pivot = None

    def _length(self, length: float) -> str:
        if self.settings is None:
            return length_text(length, "model")
        values = self.settings.values
        return length_text(length, values.unit, values.metres_per_unit)

    # --- commands

    def verbs(self) -> dict[str, Callable[[], object]]:
        """What each command of the table does here."""
        document = self.document
        found: dict[str, Callable[[], object]] = {
            command: partial(document.set_tool, tool) for command, tool in COMMANDS.items()
        }
        found |= {
            "brush.smaller": lambda: resized(document, 1 / LARGER),
            "brush.larger": lambda: resized(document, LARGER),
            "brush.softer": lambda: hardened(document, -HARDER),
            "brush.harder": lambda: hardened(document, HARDER),
            "brush.size": lambda: self.set_by_pointer("radius"),
            "brush.hardness": lambda: self.set_by_pointer("hardness"),
            "brush.turn_left": lambda: turned(document, NOTCH),
            "brush.turn_right": lambda: turned(document, -NOTCH),
            "brush.switch": self.switch,
            "view.pivot_stroke": self.pivot_stroke,
        }
        for axis in "xyz":
            found[f"brush.symmetry_{axis}"] = partial(mirrored, document, axis)
        for command in VIEWS:
            found[command] = partial(self._look, command)
        return found

    def actions(self, keymap: Keymap) -> dict[str, QAction]:
        """Actions of all commands of `verbs`, bound to their keys; add them to the window."""
        if not self._actions:
            for command, verb in self.verbs().items():
                action = QAction(self)
                action.setCheckable(command in COMMANDS)
                action.triggered.connect(lambda checked, verb=verb: verb())
                self._actions[command] = keymap.bind(action, command)
                if command in COMMANDS:
                    action.triggered.connect(self._take_tool)  # a second press unchecks nothing
            self._take_tool()
        return dict(self._actions)

    def switch(self) -> None:
        """Exchange adding and removing: of the brush, or of protection."""
        document = self.document
        if document.tool == "protect":
            document.set_options(erase_protection=not document.options.erase_protection)
            self.told.emit(
                self.tr("The brush takes protection away.")
                if document.options.erase_protection
                else self.tr("The brush protects.")
            )
        elif document.tool in ("paint", "erase"):
            document.set_tool("erase" if document.tool == "paint" else "paint")

    def _look(self, command: str) -> None:
        self.viewport.place(looking(self.viewport.scene.camera, command))

    # --- measuring

    def _ask(self, start: Place, end: Place, answer: Callable[[Way], None]) -> None:
        self._question = (start, end, answer)
        if self._measuring.busy:
            self._measuring.cancel()
        else:
            self._measure()

    def _measure(self) -> None:
        """Find the way over the surface for the newest question."""
        question, self._question = self._question, None
        picker = self._picker
        if question is None or picker is None:
            return
        start, end, answer = question
        surface = picker.surface
        known = self._ruler[1] if self._ruler and self._ruler[0] is surface else None

        def job(progress: Progress, report: object) -> tuple[object, ...]:
            ruler = known if known is not None else ruler_of(surface)
            return surface, ruler, ruler.between(start, end), answer

        self._measuring.start("measure", job)

    def _answer(
        self, surface: ExportSurface, ruler: Ruler, way: Way, answer: Callable[[Way], None]
    ) -> None:
        self._ruler = (surface, ruler)
        answer(way)
