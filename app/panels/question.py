"""A question before something that cannot be undone."""

from __future__ import annotations

from collections.abc import Callable

from PyQt6.QtCore import QCoreApplication, Qt
from PyQt6.QtWidgets import QMessageBox, QWidget

translate = QCoreApplication.translate


def ask(parent: QWidget, title: str, text: str, verb: Callable[[], None]) -> QMessageBox:
    """Ask over `parent`, and call `verb` if the user wants it; returns at once."""
    box = QMessageBox(QMessageBox.Icon.Question, title, title, parent=parent)
    box.setInformativeText(text)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    go = box.addButton(translate("Question", "Reset"), QMessageBox.ButtonRole.AcceptRole)
    keep = box.addButton(translate("Question", "Leave as it is"), QMessageBox.ButtonRole.RejectRole)
    assert go is not None and keep is not None
    go.setToolTip(text)
    keep.setToolTip(translate("Question", "Change nothing"))
    box.setDefaultButton(keep)
    box.setEscapeButton(keep)
    go.clicked.connect(lambda: verb())
    box.open()
    return box
