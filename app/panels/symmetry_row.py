"""Along which planes and around which axis edits are repeated."""

from __future__ import annotations

from PyQt6.QtCore import QSignalBlocker
from PyQt6.QtWidgets import QComboBox, QHBoxLayout, QSpinBox, QToolButton, QVBoxLayout, QWidget

from app.document import Document

AXES = "xyz"
MOST_COPIES = 64


class SymmetryRow(QWidget):
    """Buttons X, Y, Z for mirrors, and copies around an axis."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Show and set mirror, radial and axis of `document.options`."""
        super().__init__(parent)
        self._document = document
        self.setAccessibleName(self.tr("Symmetry"))
        self.mirrors: dict[str, QToolButton] = {}
        mirrors = QHBoxLayout()
        for axis in AXES:
            button = QToolButton()
            button.setText(axis.upper())
            button.setCheckable(True)
            button.setToolTip(
                self.tr("Mirror across the plane at the middle of {0} (Shift+{0})").format(
                    axis.upper()
                )
            )
            button.setAccessibleName(self.tr("Mirror {0}").format(axis.upper()))
            button.clicked.connect(self._mirror)
            self.mirrors[axis] = button
            mirrors.addWidget(button)
        mirrors.addStretch()
        self.copies = QSpinBox()
        self.copies.setRange(1, MOST_COPIES)
        self.copies.setSuffix(" ×")
        self.copies.setSpecialValueText(self.tr("once"))
        self.copies.setKeyboardTracking(False)
        self.copies.setToolTip(self.tr("How many copies stand around the axis"))
        self.copies.setAccessibleName(self.tr("Radial copies"))
        self.copies.valueChanged.connect(lambda count: document.set_options(radial=count))
        self.axis = QComboBox()
        for axis in AXES:
            self.axis.addItem(self.tr("around {0}").format(axis.upper()), axis)
        self.axis.setToolTip(self.tr("The axis through the middle, for radial copies"))
        self.axis.setAccessibleName(self.tr("Radial axis"))
        self.axis.activated.connect(lambda row: document.set_options(axis=self.axis.itemData(row)))
        radial = QHBoxLayout()
        radial.addWidget(self.copies, 1)
        radial.addWidget(self.axis, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(mirrors)
        layout.addLayout(radial)
        document.options_changed.connect(self._show)
        self._show()

    def _mirror(self) -> None:
        wanted = "".join(axis for axis, button in self.mirrors.items() if button.isChecked())
        self._document.set_options(mirror=wanted)

    def _show(self) -> None:
        options = self._document.options
        for axis, button in self.mirrors.items():
            button.setChecked(axis in options.mirror)
        with QSignalBlocker(self.copies):
            self.copies.setValue(options.radial)
        self.axis.setCurrentIndex(self.axis.findData(options.axis))
        self.axis.setEnabled(options.radial > 1)
