"""All that is known about a sample, as `patina sample info` tells it."""

from __future__ import annotations

from typing import Any

from PyQt6.QtCore import Qt, QTimer
from PyQt6.QtGui import QGuiApplication, QResizeEvent
from PyQt6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)


class SampleInfo(QDialog):
    """A table of figures, which can be copied."""

    def __init__(self, figures: dict[str, Any], parent: QWidget | None = None) -> None:
        """Show figures as of `btfcore.samples.description`."""
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(self.tr("Sample: {0}").format(figures.get("name", "")))
        self.rows = _rows(figures)
        self.table = QTableWidget(len(self.rows), 2)
        self.table.setAccessibleName(self.tr("What is known about the sample"))
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setWordWrap(True)
        for part in (self.table.horizontalHeader(), self.table.verticalHeader()):
            if part is not None:
                part.hide()
        for row, pair in enumerate(self.rows):
            for column, text in enumerate(pair):
                self.table.setItem(row, column, QTableWidgetItem(text))
        header = self.table.horizontalHeader()
        if header is not None:
            header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
            header.setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        self.copy = buttons.addButton(self.tr("Copy"), QDialogButtonBox.ButtonRole.ActionRole)
        assert self.copy is not None
        self.copy.setToolTip(self.tr("Copy everything as text"))
        self.copy.clicked.connect(self._copy)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addWidget(self.table)
        layout.addWidget(buttons)
        self.resize(560, 620)

    def text(self) -> str:
        """Everything, a line for each figure."""
        return "\n".join(f"{name}\t{value}" for name, value in self.rows)

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: N802
        """Make rows as high as their text needs at this width."""
        super().resizeEvent(event)
        QTimer.singleShot(0, self.table.resizeRowsToContents)

    def _copy(self) -> None:
        board = QGuiApplication.clipboard()
        if board is not None:
            board.setText(self.text())


def _rows(figures: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, value in figures.items():
        lines = value if isinstance(value, list) else [value]
        if value is None or value == "" or value == []:
            lines = ["–"]
        for place, line in enumerate(lines):
            rows.append((name.replace("_", " ") if place == 0 else "", str(line)))
    return rows
