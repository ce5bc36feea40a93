"""All steps that were made, and which of them are done; a click goes there."""

from __future__ import annotations

from typing import Any

from PyQt6.QtCore import QAbstractListModel, QModelIndex, QObject, QSize, Qt
from PyQt6.QtGui import QColor, QFont, QFontMetrics, QPalette
from PyQt6.QtWidgets import QAbstractItemView, QLabel, QListView, QVBoxLayout, QWidget

from app.document import Document
from app.panels.layer_model import LayerVerbs
from app.theme import named

Role = Qt.ItemDataRole


class HistoryModel(QAbstractListModel):
    """Row n is the state after n steps; row 0 the one before all of them."""

    def __init__(self, document: Document, palette: QPalette, parent: QObject) -> None:
        """Follow the history of `document`."""
        super().__init__(parent)
        self._document, self.palette = document, palette
        self._count = self._wanted()
        document.history_changed.connect(self._follow)

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008, N802
        """One more than there are steps; none where nothing was done."""
        return 0 if parent.isValid() else self._count

    def data(self, index: QModelIndex, role: int = Role.DisplayRole) -> Any:
        """Label of a step; bold where the painting is, grey what was undone."""
        if not index.isValid() or index.row() > len(self._document.history):
            return None
        step, at = index.row(), self._document.history_at
        if role == Role.DisplayRole:
            mark = "▸ " if step == at else "   "
            return mark + self._label(step)
        if role == Role.AccessibleTextRole:
            state = self.tr("present") if step == at else self.tr("undone") if step > at else ""
            return ", ".join(each for each in (self._label(step), state) if each)
        if role == Role.FontRole:
            font = QFont()
            font.setBold(step == at)
            return font
        if role == Role.ForegroundRole and step > at:
            faint = QColor(self.palette.color(QPalette.ColorRole.Text))
            faint.setAlphaF(0.5)
            return faint
        if role == Role.SizeHintRole:
            return QSize(0, QFontMetrics(QFont()).height() + 10)
        if role == Role.ToolTipRole:
            if step == at:
                return self.tr("The painting is here")
            way = self.tr("Undo back to here") if step < at else self.tr("Redo up to here")
            return f"{self._label(step)}\n{way}"
        return None

    def _label(self, step: int) -> str:
        return self._document.history[step - 1] if step else self.tr("Beginning")

    def _wanted(self) -> int:
        steps = len(self._document.history)
        return steps + 1 if steps else 0

    def _follow(self) -> None:
        wanted = self._wanted()
        if wanted > self._count:
            self.beginInsertRows(QModelIndex(), self._count, wanted - 1)
            self._count = wanted
            self.endInsertRows()
        elif wanted < self._count:
            self.beginRemoveRows(QModelIndex(), wanted, self._count - 1)
            self._count = wanted
            self.endRemoveRows()
        if wanted:
            self.dataChanged.emit(self.index(0), self.index(wanted - 1))


class HistoryPanel(QWidget):
    """The list of steps."""

    def __init__(
        self, document: Document, verbs: LayerVerbs, parent: QWidget | None = None
    ) -> None:
        """Show the history of `document`; `verbs` undo and redo (`app.edits.Edits`)."""
        super().__init__(parent)
        self._document, self._verbs = document, verbs
        self.view = named(QListView(), "history")
        self.model = HistoryModel(document, self.view.palette(), self)
        self.view.setModel(self.model)
        self.view.setAccessibleName(self.tr("History"))
        self.view.setAccessibleDescription(self.tr("Enter goes to the marked step"))
        self.view.setUniformItemSizes(True)
        self.view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.view.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.hint = named(QLabel(self.tr("Every step that can be undone appears here.")), "hint")
        self.hint.setWordWrap(True)
        self.hint.setAlignment(Qt.AlignmentFlag.AlignCenter)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.addWidget(self.hint)
        layout.addWidget(self.view, 1)
        self.view.clicked.connect(self._go)
        self.view.activated.connect(self._go)
        document.history_changed.connect(self._refresh)
        self._refresh()

    def _go(self, index: QModelIndex) -> None:
        if index.isValid() and index.row() != self._document.history_at:
            self._verbs.undo_to(index.row())

    def _refresh(self) -> None:
        some = self.model.rowCount() > 0
        self.view.setVisible(some)
        self.hint.setVisible(not some)
        if some:
            self.model.palette = self.view.palette()
            present = self.model.index(self._document.history_at)
            self.view.setCurrentIndex(present)
            self.view.scrollTo(present)
