"""Which feature to paint with: the background's own, one of the painting's, or a file's."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import QSignalBlocker, QSize, Qt, QTimer
from PyQt6.QtGui import QIcon
from PyQt6.QtWidgets import QComboBox, QWidget

from app.document import Document, SampleEntry
from app.panels.pictures import pixmap, readable, square

SIDE = 36  # logical pixels


class FeatureBox(QComboBox):
    """Shows `document.options.sample`; what is chosen is set there."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Offer the samples of `document` that have a mask."""
        super().__init__(parent)
        self._document = document
        self._shown: list[tuple[object, object]] = []  # each choice and its picture
        self.setIconSize(QSize(SIDE, SIDE))
        self.setMaxVisibleItems(12)
        self.setSizeAdjustPolicy(self.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(8)
        self.activated.connect(self._choose)
        self._later = QTimer(self)  # thumbnails come one by one
        self._later.setSingleShot(True)
        self._later.timeout.connect(self._fill)
        for changed in (
            document.samples_changed, document.painting_changed, document.layers_changed
        ):  # fmt: skip
            changed.connect(self._later.start)
        document.options_changed.connect(self._mark)
        self._fill()

    def _choices(self) -> list[tuple[object, SampleEntry | None]]:
        """What can be painted with, and the library's entry of it."""
        entries = {entry.path: entry for entry in self._document.samples}
        marked = [
            entry
            for path, entry in entries.items()
            if (entry.feature or path in self._document.masks) and not entry.error
        ]
        files = {entry.path.stem for entry in marked}
        found: list[tuple[object, SampleEntry | None]] = [(None, None)]
        found += [(name, None) for name in self._document.sample_names[1:] if name not in files]
        found += [(entry.path, entry) for entry in marked]
        present = self._document.options.sample
        if present not in [choice for choice, _ in found]:  # without a mask, or taken off
            known = entries.get(present) if isinstance(present, Path) else None
            found.append((present, known))
        return found

    def _fill(self) -> None:
        choices = self._choices()
        fresh: list[tuple[object, object]] = [
            (choice, None if e is None else e.thumbnail) for choice, e in choices
        ]
        same = len(fresh) == len(self._shown) and all(
            one[0] == two[0] and one[1] is two[1]
            for one, two in zip(fresh, self._shown, strict=True)
        )
        if not same:
            self._shown = fresh
            with QSignalBlocker(self):
                self.clear()
                for choice, entry in choices:
                    self._add(choice, entry)
        self._mark()

    def _add(self, choice: object, entry: SampleEntry | None) -> None:
        icon, tip = QIcon(), ""
        if entry is not None and entry.thumbnail is not None:
            icon = QIcon(square(pixmap(entry.thumbnail), SIDE, self.devicePixelRatioF()))
        if choice is None:
            text = self.tr("The background's own")
            tip = self.tr("The feature of the sample that covers the mesh")
        elif isinstance(choice, Path):
            text, tip = readable(choice), str(choice)
        else:
            text, tip = str(choice), self.tr("In this painting already")
        self.addItem(icon, text)
        self.setItemData(self.count() - 1, tip, Qt.ItemDataRole.ToolTipRole)

    def _mark(self) -> None:
        wanted = self._document.options.sample
        row = next((at for at, (each, _) in enumerate(self._shown) if each == wanted), -1)
        if row < 0 and self._shown:
            self._later.start()
        with QSignalBlocker(self):
            self.setCurrentIndex(row)

    def _choose(self, row: int) -> None:
        if 0 <= row < len(self._shown):
            self._document.set_options(sample=self._shown[row][0])
