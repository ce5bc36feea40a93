"""What can be set beside the sample: the tools' options, the whole mask, the view, the light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PyQt6.QtCore import QSignalBlocker, Qt, pyqtSignal
from PyQt6.QtGui import QColor
from PyQt6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QGridLayout,
    QLabel,
    QPushButton,
    QSlider,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.panels.mask_model import MaskModel
from app.panels.mask_picture import TINTS
from app.panels.mask_work import LARGEST_RADIUS, MaskTool
from app.theme import named
from btfcore.btf.appearance import OBLIQUE
from btfcore.btf.directions import from_angles, to_angles
from btfcore.btf.mask_select import MOST_EVENING, MOST_SMOOTHING

_STEEPEST = 80  # degrees off the normal that the light can be moved to
_LARGEST_TOLERANCE, _LARGEST_MOVE = 60.0, 64.0


class MaskOptions(QWidget):
    """Shows the settings of a model and asks it to change; the view's are signals.

    opacity_changed(0–1), tint_changed(colour).
    """

    opacity_changed = pyqtSignal(float)
    tint_changed = pyqtSignal(QColor)

    def __init__(self, model: MaskModel, parent: QWidget | None = None) -> None:
        """Show the settings of `model`."""
        super().__init__(parent)
        self._model = model
        self._spins: dict[str, QDoubleSpinBox] = {}
        self._checks: dict[str, QCheckBox] = {}
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(8)
        layout.addWidget(named(QLabel(self.tr("TOOL")), "heading"))
        self.pages = QStackedWidget()
        for page in (self._brush_page(), self._lasso_page(), self._flood_page()):
            self.pages.addWidget(page)
        layout.addWidget(self.pages)
        layout.addWidget(named(QLabel(self.tr("WHOLE MASK")), "heading"))
        layout.addWidget(self._whole())
        layout.addWidget(named(QLabel(self.tr("VIEW")), "heading"))
        layout.addWidget(self._view())
        if model.lamp is not None:
            layout.addWidget(named(QLabel(self.tr("LIGHT")), "heading"))
            layout.addWidget(self._light())
        layout.addStretch()
        model.settings_changed.connect(self._refresh)
        self._refresh()

    def spin(self, name: str) -> QDoubleSpinBox:
        """Field of a setting by its name."""
        return self._spins[name]

    def check(self, name: str) -> QCheckBox:
        """Box of a setting by its name."""
        return self._checks[name]

    def _brush_page(self) -> QWidget:
        page, grid = _form()
        self._add_spin(
            grid, "radius", self.tr("Radius"), (0.5, LARGEST_RADIUS), 1, self.tr(" texels"),
            self.tr("Radius of the brush; keys [ and ]"),
        )  # fmt: skip
        self._add_spin(
            grid, "hardness", self.tr("Hardness"), (0.0, 1.0), 0.1, "",
            self.tr("1 has a sharp edge, 0 fades from the middle; keys Shift+[ and Shift+]"),
        )  # fmt: skip
        self._add_check(
            grid, "pressure", self.tr("Pen pressure scales it"),
            self.tr("A pen that is pressed less draws a thinner line"),
        )  # fmt: skip
        return page

    def _lasso_page(self) -> QWidget:
        page, grid = _form()
        text = QLabel(
            self.tr(
                "Drag around the feature, or click its corners and close with Enter or a double"
                " click. Backspace takes a corner back."
            )
        )
        text.setWordWrap(True)
        grid.addWidget(named(text, "hint"), 0, 0, 1, 2)
        return page

    def _flood_page(self) -> QWidget:
        page, grid = _form()
        self._add_spin(
            grid, "tolerance", self.tr("Tolerance"), (0.0, _LARGEST_TOLERANCE), 1, self.tr(" ΔE"),
            self.tr(
                "Difference in colour up to which texels are taken; 2.3 can just be seen."
                " The last flood follows"
            ),
        )  # fmt: skip
        self._add_spin(
            grid, "smoothing", self.tr("Ignore grain"), (0.0, MOST_SMOOTHING), 0.5,
            self.tr(" texels"),
            self.tr("Colours are compared after smoothing them over that many texels"),
        )  # fmt: skip
        self._add_spin(
            grid, "evening", self.tr("Even out light"), (0.0, MOST_EVENING), 4, self.tr(" texels"),
            self.tr(
                "Leave out how light and colour change over more than that many texels; 0 is off."
                " For thin features, take a little more than their width"
            ),
        )  # fmt: skip
        self.spin("evening").setSpecialValueText(self.tr("off"))
        self._add_check(
            grid, "contiguous", self.tr("Only what is connected"),
            self.tr("Off: take texels of that colour everywhere"),
        )  # fmt: skip
        self._add_check(
            grid, "within", self.tr("Only within the marked part"),
            self.tr("Mark roughly, then flood the feature: what is not like it is unmarked"),
        )  # fmt: skip
        return page

    def _whole(self) -> QWidget:
        page, grid = _form()
        model = self._model
        self.amount = QDoubleSpinBox()
        self.amount.setRange(0.5, _LARGEST_MOVE)
        self.amount.setSingleStep(1)
        self.amount.setDecimals(1)
        self.amount.setValue(2)
        self.amount.setSuffix(self.tr(" texels"))
        _tell(self.amount, self.tr("Amount"), self.tr("How far Grow, Shrink and Feather reach"))
        label = QLabel(self.tr("Amount"))
        label.setBuddy(self.amount)
        grid.addWidget(label, 0, 0)
        grid.addWidget(self.amount, 0, 1)
        self.buttons: dict[str, QPushButton] = {}
        pairs = QGridLayout()
        pairs.setColumnStretch(0, 1)
        pairs.setColumnStretch(1, 1)
        grid.addLayout(pairs, 1, 0, 1, 2)
        for place, (name, text, tip, call) in enumerate(
            (
                ("grow", self.tr("Grow"), self.tr("Move the edge outward"),
                 lambda: model.grow(self.amount.value())),
                ("shrink", self.tr("Shrink"), self.tr("Move the edge inward"),
                 lambda: model.grow(-self.amount.value())),
                ("feather", self.tr("Feather"), self.tr("Soften the edge"),
                 lambda: model.feather(self.amount.value())),
                ("invert", self.tr("Invert"), self.tr("Exchange feature and background"),
                 model.invert),
                ("similar", self.tr("Similar"),
                 self.tr("Mark everything that looks like something marked"), model.mark_similar),
                ("clear", self.tr("Clear"), self.tr("Mark nothing"), model.clear),
            )
        ):  # fmt: skip
            self.buttons[name] = button = _button(text, tip, call)
            pairs.addWidget(button, place // 2, place % 2)
        self._add_spin(
            grid, "likeness", self.tr("Likeness"), (0.0, _LARGEST_TOLERANCE), 0.5, self.tr(" ΔE"),
            self.tr("Difference in colour up to which Similar marks a texel"),
        )  # fmt: skip
        return page

    def _view(self) -> QWidget:
        page, grid = _form()
        self.opacity = QSlider(Qt.Orientation.Horizontal)
        self.opacity.setRange(0, 100)
        self.opacity.setValue(55)
        _tell(self.opacity, self.tr("Opacity"), self.tr("How strongly the mask covers the sample"))
        self.opacity.valueChanged.connect(lambda value: self.opacity_changed.emit(value / 100))
        self.tint = QComboBox()
        names = (self.tr("Red"), self.tr("Green"), self.tr("Blue"), self.tr("Magenta"))
        for name, tint in zip(names, TINTS, strict=True):
            self.tint.addItem(name, tint)
        _tell(self.tint, self.tr("Tint"), self.tr("Colour in which the mask is shown"))
        self.tint.currentIndexChanged.connect(
            lambda: self.tint_changed.emit(QColor(self.tint.currentData()))
        )
        for row, (text, field) in enumerate(
            ((self.tr("Opacity"), self.opacity), (self.tr("Tint"), self.tint))
        ):
            label = QLabel(text)
            label.setBuddy(field)
            grid.addWidget(label, row, 0)
            grid.addWidget(field, row, 1)
        return page

    def _light(self) -> QWidget:
        page, grid = _form()
        theta, phi = (float(np.degrees(each[0])) for each in to_angles(OBLIQUE[None]))
        self.azimuth, self.elevation = QSlider(Qt.Orientation.Horizontal), QSlider()
        self.elevation.setOrientation(Qt.Orientation.Horizontal)
        self.azimuth.setRange(0, 359)
        self.elevation.setRange(90 - _STEEPEST, 90)
        for row, (slider, value, text, tip) in enumerate(
            (
                (self.azimuth, phi, self.tr("Direction"),
                 self.tr("Where the light comes from; floods compare what is shown")),
                (self.elevation, 90 - theta, self.tr("Height"),
                 self.tr("How high the light stands; low light shows scratches")),
            )
        ):  # fmt: skip
            slider.setValue(round(value) % 360)
            _tell(slider, text, tip)
            slider.valueChanged.connect(self._moved)
            label = QLabel(text)
            label.setBuddy(slider)
            grid.addWidget(label, row, 0)
            grid.addWidget(slider, row, 1)
        return page

    def _moved(self) -> None:
        if self._model.lamp is not None:
            theta = np.radians(90.0 - self.elevation.value())
            phi = np.radians(float(self.azimuth.value()))
            self._model.lamp.move(from_angles(np.array([theta]), np.array([phi]))[0])

    def _add_spin(
        self,
        grid: QGridLayout,
        name: str,
        text: str,
        limits: tuple[float, float],
        step: float,
        suffix: str,
        tip: str,
    ) -> None:
        field = QDoubleSpinBox()
        field.setRange(*limits)
        field.setSingleStep(step)
        field.setDecimals(2 if limits[1] <= 1 else 1)
        field.setSuffix(suffix)
        _tell(field, text, tip)
        field.valueChanged.connect(lambda value: self._model.set(**{name: value}))
        label = QLabel(text)
        label.setToolTip(tip)
        label.setBuddy(field)
        row = grid.rowCount()
        grid.addWidget(label, row, 0)
        grid.addWidget(field, row, 1)
        self._spins[name] = field

    def _add_check(self, grid: QGridLayout, name: str, text: str, tip: str) -> None:
        box = QCheckBox(text)
        _tell(box, text, tip)
        box.toggled.connect(lambda on: self._model.set(**{name: on}))
        grid.addWidget(box, grid.rowCount(), 0, 1, 2)
        self._checks[name] = box

    def _refresh(self) -> None:
        settings = self._model.settings
        self.pages.setCurrentIndex(list(MaskTool).index(settings.tool))
        for name, field in self._spins.items():
            with QSignalBlocker(field):
                field.setValue(getattr(settings, name))
        for name, box in self._checks.items():
            with QSignalBlocker(box):
                box.setChecked(getattr(settings, name))


def _form() -> tuple[QWidget, QGridLayout]:
    page = QWidget()
    grid = QGridLayout(page)
    grid.setContentsMargins(0, 0, 0, 0)
    grid.setColumnStretch(1, 1)
    grid.setAlignment(Qt.AlignmentFlag.AlignTop)
    return page, grid


def _tell(field: QWidget, name: str, tip: str) -> None:
    field.setAccessibleName(name)
    field.setToolTip(tip)


def _button(text: str, tip: str, call: Callable[[], object]) -> QPushButton:
    button = QPushButton(text)
    button.setAutoDefault(False)
    _tell(button, text, tip)
    button.clicked.connect(lambda: call())
    return button
