"""The menu bar: every verb of the window, with its key."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Protocol

from PyQt6.QtCore import QCoreApplication, QSettings, QSignalBlocker
from PyQt6.QtGui import QAction, QActionGroup, QKeySequence
from PyQt6.QtWidgets import QMainWindow, QMenu

from app.document import Document, Mode
from app.tasks import Tasks

MOST_RECENT = 8


class Verbs(Protocol):
    """What the menus call; the window has them all."""

    def ask_mesh(self) -> None: ...  # noqa: D102
    def ask_folder(self) -> None: ...  # noqa: D102
    def ask_image(self) -> None: ...  # noqa: D102
    def ask_export(self) -> None: ...  # noqa: D102
    def open_mesh(self, path: Path) -> None: ...  # noqa: D102
    def synthesize(self) -> None: ...  # noqa: D102
    def cancel(self) -> None: ...  # noqa: D102
    def pause(self) -> None: ...  # noqa: D102
    def frame(self) -> None: ...  # noqa: D102
    def about(self) -> None: ...  # noqa: D102
    def close(self) -> bool: ...  # noqa: D102


class Menus:
    """Actions and menus of a window, kept up to date with its document."""

    def __init__(
        self,
        window: QMainWindow,
        verbs: Verbs,
        document: Document,
        tasks: Tasks,
        *,
        examples: list[Path],
        settings: QSettings,
    ) -> None:
        """Fill the menu bar of `window`."""
        self._window, self._verbs, self._settings = window, verbs, settings
        self._document, self._tasks = document, tasks
        bar = window.menuBar()
        assert bar is not None
        file = _menu(bar.addMenu(_tr("&File")))
        self._add(file, _tr("&Open mesh…"), verbs.ask_mesh, QKeySequence("Ctrl+O"))
        self._add(file, _tr("Open sample &image…"), verbs.ask_image, QKeySequence("Ctrl+I"))
        self._add(file, _tr("Open sample &folder…"), verbs.ask_folder, QKeySequence("Ctrl+Shift+O"))
        shown = _menu(file.addMenu(_tr("Open e&xample")))
        for path in examples:
            name = path.stem.replace("_", " ")
            self._add(shown, name, partial(verbs.open_mesh, path))
        shown.setEnabled(bool(examples))
        self._recent = _menu(file.addMenu(_tr("&Recent meshes")))
        file.addSeparator()
        self.export = self._add(file, _tr("&Export…"), verbs.ask_export, QKeySequence("Ctrl+E"))
        file.addSeparator()
        self._add(file, _tr("&Quit"), verbs.close, QKeySequence("Ctrl+Q"))
        view = _menu(bar.addMenu(_tr("&View")))
        self.modes = self._mode_actions(view)
        view.addSeparator()
        self._add(view, _tr("&Frame the mesh"), verbs.frame, QKeySequence("F"))
        run = _menu(bar.addMenu(_tr("&Synthesis")))
        self.start = self._add(run, _tr("&Synthesize"), verbs.synthesize, QKeySequence("Ctrl+R"))
        self.pause = self._add(run, _tr("&Pause"), verbs.pause, QKeySequence("Ctrl+P"))
        self.pause.setCheckable(True)
        self.stop = self._add(run, _tr("&Cancel"), verbs.cancel, QKeySequence("Esc"))
        help_menu = _menu(bar.addMenu(_tr("&Help")))
        self._add(help_menu, _tr("&About Patina"), verbs.about)
        for changed in (
            document.mode_changed, document.picture_changed, document.result_changed,
            document.sample_chosen, document.mesh_changed, tasks.idle, tasks.started, tasks.held,
        ):  # fmt: skip
            changed.connect(self._refresh)
        self._refresh()
        self._list_recent()

    def remember(self, path: Path) -> None:
        """Put a mesh on top of the recent ones."""
        kept = [str(path), *(each for each in self._known() if each != str(path))]
        self._settings.setValue("recent", kept[:MOST_RECENT])
        self._list_recent()

    def _known(self) -> list[str]:
        value = self._settings.value("recent", [])
        return [value] if isinstance(value, str) else [str(each) for each in value or []]

    def _list_recent(self) -> None:
        self._recent.clear()
        for name in self._known():
            path = Path(name)
            action = self._add(self._recent, path.name, partial(self._verbs.open_mesh, path))
            action.setToolTip(name)
        self._recent.setToolTipsVisible(True)
        self._recent.setEnabled(bool(self._known()))

    def _mode_actions(self, view: QMenu) -> dict[Mode, QAction]:
        group = QActionGroup(self._window)
        actions = {}
        names = {
            Mode.COLOUR: _tr("&Colour"), Mode.SEAMS: _tr("&Seams"), Mode.CHARTS: _tr("C&harts"),
            Mode.FIELD: _tr("F&ield"), Mode.LIT: _tr("&Light"),
        }  # fmt: skip
        for number, (mode, name) in enumerate(names.items(), start=1):
            action = self._add(
                view, name, partial(self._document.set_mode, mode),
                QKeySequence(str(number)),
            )  # fmt: skip
            action.setCheckable(True)
            group.addAction(action)
            actions[mode] = action
        return actions

    def _refresh(self) -> None:
        document, busy = self._document, self._tasks.busy
        for mode, action in self.modes.items():
            action.setEnabled(document.offers(mode))
            with QSignalBlocker(action):
                action.setChecked(mode is document.mode)
        ready = document.opened is not None and document.sample_path is not None
        self.start.setEnabled(ready and not busy)
        self.stop.setEnabled(busy)
        self.pause.setEnabled(busy)
        self.pause.setChecked(self._tasks.paused)
        self.export.setEnabled(document.decoration is not None and not busy)

    def _add(
        self,
        menu: QMenu,
        name: str,
        verb: Callable[[], object],
        key: QKeySequence | None = None,
    ) -> QAction:
        action = QAction(name, self._window)
        action.triggered.connect(lambda checked: verb())
        if key is not None:
            action.setShortcut(key)
        menu.addAction(action)
        return action


def _menu(menu: QMenu | None) -> QMenu:
    assert menu is not None
    return menu


def _tr(text: str) -> str:
    return QCoreApplication.translate("Menus", text)
