"""The one place that asks before work would be lost; it never decides by itself.

Nothing is remembered: there is no "do not ask again". Questions are asked without waiting, so
the window stays alive while work is saved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from PyQt6.QtCore import QCoreApplication, QObject, Qt
from PyQt6.QtWidgets import QMessageBox, QPushButton, QWidget


class Step(Enum):
    """What would lose work."""

    QUIT = "quit"
    OPEN = "open"
    BACKGROUND = "background"
    RESTORE = "restore"


@dataclass(frozen=True)
class Work:
    """What the guard asks the window.

    unsaved : whether there is work that no file of the user's has. save : begin to save, and call
    what it is given with whether it went well; the user may be asked for a name. scripted : the
    window is driven by a script, which answers no question. running : what runs and would be
    stopped, as "Synthesise", or "".
    """

    unsaved: Callable[[], bool]
    save: Callable[[Callable[[bool], None]], None]
    scripted: Callable[[], bool] = lambda: False
    running: Callable[[], str] = lambda: ""


class CloseGuard(QObject):
    """Asks Save / Discard / Keep working before a step that would lose work."""

    def __init__(self, window: QWidget, work: Work) -> None:
        """Ask over `window` about `work`."""
        super().__init__(window)
        self._window, self._work = window, work
        self.box: QMessageBox | None = None
        self._saving = self._leaving = False

    @property
    def asking(self) -> bool:
        """A question is open, or its answer is being carried out."""
        return self.box is not None or self._saving

    def ask(self, step: Step, go: Callable[[], None]) -> None:
        """Call `go` at once where nothing would be lost, else when the user wants it.

        While a question is open, another one only brings it to the front.
        """
        if self._saving:
            return
        if self.box is not None:
            self.box.raise_()
            self.box.activateWindow()
            return
        unsaved, running = self._work.unsaved(), self._work.running()
        if self._work.scripted() or not (unsaved or (running and step is Step.QUIT)):
            go()
            return
        self._open(step, unsaved, running, go)

    def may_close(self) -> bool:
        """For a closeEvent: whether the window may go now.

        Where it may not, the event is to be ignored; a question is open then, and the window is
        closed once it is answered so.
        """
        asking = True

        def leave() -> None:
            self._leaving = True
            if not asking:
                self._window.close()

        if not self._leaving:
            self.ask(Step.QUIT, leave)
            asking = False
        return self._leaving

    def _open(self, step: Step, unsaved: bool, running: str, go: Callable[[], None]) -> None:
        title, verb = _words(step)
        box = QMessageBox(QMessageBox.Icon.Warning, title, title, parent=self._window)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.setWindowModality(Qt.WindowModality.WindowModal)
        lines = []
        if unsaved:
            lines.append(_tr("Your work since the last save will be lost if you discard it."))
        if running:
            lines.append(_tr("“{0}” is running and will be stopped.").format(running))
        box.setInformativeText("\n".join(lines))
        role = QMessageBox.ButtonRole
        save = None
        if unsaved:
            save = _button(box, _tr("&Save"), role.AcceptRole, _tr("Save, and then {0}"), verb)
        drop = _button(
            box, _tr("&Discard") if unsaved else _tr("S&top it"), role.DestructiveRole,
            _tr("{0} without saving") if unsaved else _tr("Stop it and {0}"), verb,
        )  # fmt: skip
        keep = _button(box, _tr("&Keep working"), role.RejectRole, _tr("Change nothing"), verb)
        box.setDefaultButton(save if save is not None else keep)
        box.setEscapeButton(keep)

        def closed() -> None:
            self.box = None  # first: the step may close the window, or ask again
            if save is not None and box.clickedButton() is save:
                self._save(step, go)
            elif box.clickedButton() is drop:
                go()

        box.finished.connect(closed)
        self.box = box
        box.open()

    def _save(self, step: Step, go: Callable[[], None]) -> None:
        self._saving = True

        def then(well: bool) -> None:
            if not self._saving:
                return  # told twice
            self._saving = False
            if well:
                self.ask(step, go)  # asks again where work went on while it was saved

        try:
            self._work.save(then)
        except BaseException:
            self._saving = False
            raise


def _button(
    box: QMessageBox, text: str, role: QMessageBox.ButtonRole, tip: str, verb: str
) -> QPushButton:
    button = box.addButton(text, role)
    assert button is not None
    told = tip.format(verb)
    button.setToolTip(told[:1].upper() + told[1:])
    button.setAccessibleName(text.replace("&", ""))
    return button


def _words(step: Step) -> tuple[str, str]:
    """The question, and the step as a verb for tooltips."""
    return {
        Step.QUIT: (_tr("Quit?"), _tr("quit")),
        Step.OPEN: (_tr("Open something else?"), _tr("open something else")),
        Step.BACKGROUND: (_tr("Replace the background?"), _tr("replace the background")),
        Step.RESTORE: (_tr("Restore the other work?"), _tr("restore the other work")),
    }[step]


def _tr(text: str) -> str:
    return QCoreApplication.translate("CloseGuard", text)
