"""Buttons that choose what is drawn on the surface."""

from __future__ import annotations

from PyQt6.QtWidgets import QButtonGroup, QHBoxLayout, QPushButton, QWidget

from app.document import Document, Mode
from app.theme import named


class ModesPanel(QWidget):
    """One button per mode; those without anything to show are disabled."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Follow the mode of `document`."""
        super().__init__(parent)
        self._document = document
        self.buttons: dict[Mode, QPushButton] = {}
        group = QButtonGroup(self)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 6, 0, 6)
        layout.setSpacing(0)
        layout.addStretch()
        for mode, name, tip in (
            (Mode.COLOUR, self.tr("Colour"), self.tr("The decorated surface (1)")),
            (Mode.SEAMS, self.tr("Seams"), self.tr("Where patches meet, in yellow (2)")),
            (Mode.CHARTS, self.tr("Charts"), self.tr("Pieces of the texture atlas (3)")),
            (Mode.FIELD, self.tr("Field"), self.tr("Directions the pattern follows (4)")),
            (Mode.LIT, self.tr("Light"), self.tr("The material under light that moves (5)")),
        ):
            button = named(QPushButton(name), "mode")
            button.setCheckable(True)
            button.setToolTip(tip)
            button.clicked.connect(lambda checked, mode=mode: document.set_mode(mode))
            group.addButton(button)
            layout.addWidget(button)
            self.buttons[mode] = button
        layout.addStretch()
        for changed in (
            document.mode_changed, document.picture_changed, document.mesh_changed,
            document.result_changed,
        ):  # fmt: skip
            changed.connect(self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        for mode, button in self.buttons.items():
            button.setEnabled(self._document.offers(mode))
            button.setChecked(mode is self._document.mode)
