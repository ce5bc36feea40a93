"""Tools, layers and history around a window's view, and the files that hold them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PyQt6.QtCore import QObject, QSettings, Qt
from PyQt6.QtGui import QAction, QActionGroup
from PyQt6.QtWidgets import QDockWidget, QFileDialog, QMenu, QMenuBar, QToolBar, QWidget

from app.keys import Keymap
from app.panels.history import HistoryPanel
from app.panels.layers import LayersPanel
from app.panels.library import SampleLibrary
from app.panels.tool_options import ToolOptionsPanel
from app.settings import Settings
from app.tools.workbench import Workbench

PROJECT = ".patina"
SHOWN_BY = ("paint", "stamp", "erase", "repair", "requilt", "protect", "orient")


class Workspace(QObject):
    """Puts the tool bar, the panels on the right and their menus into a window.

    The panels come with the first tool that paints; the menu "Edit" shows and hides them.
    """

    def __init__(self, window: Any, store: QSettings) -> None:
        """Extend an `app.window.Window` whose view, menus and operations are there.

        `store` remembers settings, keys and folders of samples.
        """
        super().__init__(window)
        self._window, self._document = window, window.document
        edits = window.operations.edits
        self.settings, self.keymap = Settings(store, self), Keymap(store, self)
        self.bench = Workbench(window.viewport, self._document, edits, self.settings, self)
        self.library = SampleLibrary(self._document, window.operations, window.samples, store)
        self.layers = LayersPanel(self._document, edits, self.settings)
        self.history = HistoryPanel(self._document, edits)
        self.options = ToolOptionsPanel(self._document, self.settings)
        self.docks = [
            self._dock("tool", self.tr("Tool"), self.options),
            self._dock("layers", self.tr("Layers"), self.layers),
            self._dock("history", self.tr("History"), self.history),
        ]
        self._bar = self._tool_bar()
        self._file_menu()
        self.undo, self.redo = self._edit_menu()
        self._connect()
        self._follow_history()

    def restore(self) -> None:
        """Show the remembered folders of samples."""
        self.library.restore()

    def close(self) -> None:
        """Let nothing run any more."""
        self.library.close()
        self.bench.close()

    # --- projects

    def ask_project(self) -> None:
        """Let the user choose a project to open."""
        name, _ = QFileDialog.getOpenFileName(
            self._window, self.tr("Open project"), "", self.tr("Patina projects (*.patina)")
        )
        if name:
            self.open_project(Path(name))

    def open_project(self, path: Path) -> None:
        """Open a project, asking first where work would be lost."""
        if self._window.may_lose(self.tr("Open another project?")):
            self._window.operations.open_project(path)

    def save(self) -> None:
        """Save to the file of the last time, or ask for one."""
        if self._document.project_path is None:
            self.ask_save()
        else:
            self._window.operations.save_project()

    def ask_save(self) -> None:
        """Let the user choose where the project goes."""
        if self._document.painting is None:
            self._window.notes.tell(self.tr("There is nothing to save yet: synthesise first."))
            return
        opened = self._document.opened
        start = "" if opened is None else f"{opened.path.stem}{PROJECT}"
        name, _ = QFileDialog.getSaveFileName(
            self._window, self.tr("Save project"), start, self.tr("Patina projects (*.patina)")
        )
        if name:
            path = Path(name)
            suffixed = path if path.suffix.lower() == PROJECT else Path(name + PROJECT)
            self._window.operations.save_as(suffixed)

    # --- inside

    def _connect(self) -> None:
        window, document = self._window, self._document
        self.bench.told.connect(window.notes.tell)
        self.bench.synthesize_wanted.connect(window.synthesize)
        self.library.failed.connect(window.errors.tell)
        self.library.noted.connect(window.notes.tell)
        self.library.meshes_dropped.connect(window.take)
        window.operations.saved.connect(
            lambda path: window.notes.tell(self.tr("Saved {0}").format(path))
        )
        document.tool_changed.connect(self._follow_tool)
        document.history_changed.connect(self._follow_history)
        document.painting_changed.connect(self._follow_history)
        for note in (*self.settings.notes, *self.keymap.notes):
            window.notes.tell(note)

    def _dock(self, name: str, title: str, panel: QWidget) -> QDockWidget:
        dock = QDockWidget(title, self._window)
        dock.setObjectName(name)
        dock.setWidget(panel)
        self._window.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, dock)
        dock.hide()
        return dock

    def _tool_bar(self) -> QToolBar:
        """One button a tool; that of the lamp is beside its other controls, and holding L."""
        bar = QToolBar(self.tr("Tools"), self._window)
        bar.setObjectName("tools")
        bar.setMovable(False)
        actions = self.bench.actions(self.keymap)
        group = QActionGroup(bar)
        for command, short in (
            ("tool.navigate", self.tr("View")),
            ("tool.orient", self.tr("Orient")),
            ("tool.brush", self.tr("Paint")),
            ("tool.stamp", self.tr("Stamp")),
            ("tool.erase", self.tr("Erase")),
            ("tool.repair", self.tr("Repair")),
            ("tool.mask", self.tr("Protect")),
            ("tool.pick", self.tr("Pick")),
            ("tool.measure", self.tr("Measure")),
        ):
            action = actions.pop(command)
            action.setIconText(short)
            group.addAction(action)
            bar.addAction(action)
        actions.pop("tool.light", None)
        self._window.addActions(list(actions.values()))
        self._window.addToolBar(Qt.ToolBarArea.LeftToolBarArea, bar)
        return bar

    def _file_menu(self) -> None:
        file = self._window.menuBar().actions()[0].menu()
        before = self._window.menus.export
        for command, text, verb in (
            (None, self.tr("Open &project…"), self.ask_project),
            ("file.save", self.tr("&Save project"), self.save),
            ("file.save_as", self.tr("Save project &as…"), self.ask_save),
        ):
            file.insertAction(before, self._action(command, text, verb))
        file.insertSeparator(before)

    def _edit_menu(self) -> tuple[QAction, QAction]:
        bar: QMenuBar = self._window.menuBar()
        menu = QMenu(self.tr("&Edit"), bar)
        bar.insertMenu(bar.actions()[1], menu)
        undo = self._action("edit.undo", self.tr("&Undo"), self.bench.undo)
        redo = self._action("edit.redo", self.tr("&Redo"), self.bench.redo)
        menu.addActions([undo, redo])
        menu.addSeparator()
        for command, text, verb in (
            ("edit.duplicate", self.tr("&Duplicate layer"), self.layers.duplicate),
            ("edit.rename", self.tr("Re&name layer"), self.layers.rename),
            ("edit.delete", self.tr("De&lete layer"), self.layers.remove),
        ):
            menu.addAction(self._action(command, text, verb))
        menu.addSeparator()
        menu.addActions([dock.toggleViewAction() for dock in self.docks])  # type: ignore[misc]
        return undo, redo

    def _action(self, command: str | None, text: str, verb: Callable[[], object]) -> QAction:
        action = QAction(text, self)
        action.triggered.connect(lambda checked: verb())
        if command is not None:
            self.keymap.bind(action, command)
            action.setText(text)
        return action

    def _follow_tool(self) -> None:
        if self._document.tool in SHOWN_BY and not any(dock.isVisible() for dock in self.docks):
            for dock in self.docks:
                dock.show()

    def _follow_history(self) -> None:
        for action, label, plain in (
            (self.undo, self._document.undo_label, self.tr("&Undo")),
            (self.redo, self._document.redo_label, self.tr("&Redo")),
        ):
            action.setEnabled(bool(label) or self._document.tool == "orient")
            action.setText(f"{plain} {label}".strip().replace("  ", " "))


def is_project(path: Path) -> bool:
    """Say whether a path looks like a project file."""
    return path.suffix.lower() == PROJECT
