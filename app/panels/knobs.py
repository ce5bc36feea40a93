"""The knobs of a synthesis."""

from __future__ import annotations

from PyQt6.QtCore import QSignalBlocker
from PyQt6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.document import RATES, Document
from app.theme import named

SMALLEST_PATCH, LARGEST_PATCH = 4, 200


class KnobsPanel(QWidget):
    """Sampling rate, pattern scale, work patch and seed of a document."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Show the knobs of `document`."""
        super().__init__(parent)
        self._document = document
        self.rate = QComboBox()
        for rate in RATES:
            self.rate.addItem(self.tr("{0} × {0}").format(rate), rate)
        self.scale = QDoubleSpinBox()
        self.scale.setRange(0.1, 10.0)
        self.scale.setSingleStep(0.25)
        self.scale.setDecimals(2)
        self.scale.setSuffix(" ×")
        self.patch = QSpinBox()
        self.patch.setRange(SMALLEST_PATCH - 1, LARGEST_PATCH)
        self.patch.setSpecialValueText(self.tr("automatic"))
        self.seed = QSpinBox()
        self.seed.setRange(0, 999_999)
        dice = QPushButton(self.tr("Next"))
        dice.setToolTip(self.tr("Take the next seed: another arrangement of the same material"))
        dice.setAccessibleName(self.tr("Next seed"))
        dice.clicked.connect(lambda: self.seed.setValue((self.seed.value() + 1) % 1_000_000))
        seed = QHBoxLayout()
        seed.setContentsMargins(0, 0, 0, 0)
        seed.addWidget(self.seed, 1)
        seed.addWidget(dice)
        form = QGridLayout()
        form.setContentsMargins(0, 0, 0, 0)
        form.setVerticalSpacing(8)
        form.setHorizontalSpacing(14)
        form.setColumnStretch(1, 1)
        for name, field, tip in (
            (
                self.tr("Sampling rate"), self.rate,
                self.tr("Side of the texture in texels; more shows finer detail and takes longer"),
            ),
            (
                self.tr("Pattern scale"), self.scale,
                self.tr("2 makes the pattern twice as large on the surface"),
            ),
            (
                self.tr("Work patch"), self.patch,
                self.tr("Radius of one patch in texels; larger keeps more of the pattern whole"),
            ),
            (
                self.tr("Seed"), self.seed,
                self.tr("The same seed gives the same result, another one another arrangement"),
            ),
        ):  # fmt: skip
            label = QLabel(name)
            label.setToolTip(tip)
            label.setBuddy(field)
            field.setToolTip(tip)
            field.setAccessibleName(name)
            row = form.rowCount()
            form.addWidget(label, row, 0)
            if field is self.seed:
                form.addLayout(seed, row, 1)
            else:
                form.addWidget(field, row, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(named(QLabel(self.tr("SYNTHESIS")), "heading"))
        layout.addLayout(form)
        self.rate.currentIndexChanged.connect(
            lambda: document.set_knobs(rate=self.rate.currentData())
        )
        self.scale.valueChanged.connect(lambda value: document.set_knobs(scale=value))
        self.seed.valueChanged.connect(lambda value: document.set_knobs(seed=value))
        self.patch.valueChanged.connect(
            lambda value: document.set_knobs(work_patch=value if value >= SMALLEST_PATCH else None)
        )
        document.knobs_changed.connect(self._refresh)
        self._refresh()

    def _refresh(self) -> None:
        knobs = self._document.knobs
        with (
            QSignalBlocker(self.rate),
            QSignalBlocker(self.scale),
            QSignalBlocker(self.seed),
            QSignalBlocker(self.patch),
        ):
            if self.rate.findData(knobs.rate) < 0:  # a rate set by a script
                self.rate.addItem(self.tr("{0} × {0}").format(knobs.rate), knobs.rate)
            self.rate.setCurrentIndex(self.rate.findData(knobs.rate))
            self.scale.setValue(knobs.scale)
            self.seed.setValue(knobs.seed)
            self.patch.setValue(knobs.work_patch or SMALLEST_PATCH - 1)
