"""What an empty window says: how to begin."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PyQt6.QtCore import Qt, pyqtSignal
from PyQt6.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.theme import emblem, named

COLUMNS = 4


class WelcomePanel(QWidget):
    """Place to drop a mesh, a button to open one, and the shipped examples."""

    open_wanted = pyqtSignal()
    example_wanted = pyqtSignal(object)

    def __init__(self, examples: Sequence[Path], parent: QWidget | None = None) -> None:
        """Offer `examples`, mesh files."""
        super().__init__(parent)
        self.setAutoFillBackground(True)
        frame = named(QFrame(), "drop")
        frame.setMaximumSize(620, 470)
        picture = QLabel()
        picture.setPixmap(emblem(96, self.devicePixelRatioF()))
        title = named(QLabel(self.tr("Drop a mesh here")), "title")
        kinds = named(QLabel(self.tr("OBJ, PLY, STL, OFF, GLB or glTF")), "hint")
        steps = named(
            QLabel(
                self.tr(
                    "1  Open a mesh      2  Choose a sample on the left      3  Press Synthesize"
                )
            ),
            "hint",
        )
        steps.setWordWrap(True)
        steps.setAlignment(Qt.AlignmentFlag.AlignCenter)
        button = QPushButton(self.tr("Open mesh…"))
        button.clicked.connect(self.open_wanted)
        row = QHBoxLayout()
        row.addStretch()
        row.addWidget(button)
        row.addStretch()
        grid = QGridLayout()
        for place, path in enumerate(examples):
            each = QPushButton(path.stem.replace("_", " "))
            each.setToolTip(self.tr("Open the example {0}").format(path.name))
            each.clicked.connect(lambda checked, path=path: self.example_wanted.emit(path))
            grid.addWidget(each, place // COLUMNS, place % COLUMNS)
        inner = QVBoxLayout(frame)
        inner.setContentsMargins(40, 32, 40, 32)
        inner.setSpacing(10)
        inner.addStretch()
        for widget in (picture, title, kinds):
            inner.addWidget(widget, 0, Qt.AlignmentFlag.AlignHCenter)
        inner.addSpacing(6)
        inner.addLayout(row)
        inner.addSpacing(14)
        if examples:
            or_label = named(QLabel(self.tr("or begin with an example")), "hint")
            inner.addWidget(or_label, 0, Qt.AlignmentFlag.AlignHCenter)
            inner.addLayout(grid)
            inner.addSpacing(14)
        inner.addWidget(steps)
        inner.addStretch()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(24, 24, 24, 24)
        layout.addStretch()
        middle = QHBoxLayout()
        middle.addStretch()
        middle.addWidget(frame, 4)
        middle.addStretch()
        layout.addLayout(middle, 8)
        layout.addStretch()
