"""The fields of the settings dialog: each shows one value of the settings and asks for another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from PyQt6.QtCore import QObject, QSignalBlocker, Qt
from PyQt6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.document import RATES
from app.panels.pressure import PressureEditor
from app.pressure import FIRM, LINEAR, SOFT, Curve
from app.settings import RULES, Settings
from btfcore.render.pool import threads


class Fields(QObject):
    """All fields, each named after what it sets."""

    def __init__(
        self, settings: Settings, languages: Sequence[tuple[str, str]], parent: QObject
    ) -> None:
        """Make them for `settings`; languages : codes and names."""
        super().__init__(parent)
        self._settings = settings
        tr = self.tr
        self.theme = self._combo(
            "theme", ("system", tr("As the system")), ("light", tr("Light")), ("dark", tr("Dark"))
        )
        self.language = self._combo("language", ("system", tr("As the system")), *languages)
        self.unit = self._combo(
            "unit",
            ("model", tr("Units of the mesh")),
            ("mm", tr("Millimetres")),
            ("cm", tr("Centimetres")),
            ("m", tr("Metres")),
        )
        self.metres = _Metres()
        self.metres.setSuffix(" m")
        self.metres.valueChanged.connect(lambda value: settings.change(metres_per_unit=value))
        self.rate = self._combo("rate", *((rate, tr("{0} × {0}").format(rate)) for rate in RATES))
        self.autosave = self._spin("autosave_seconds", 5, tr(" s"))
        self.undo = self._spin("undo_megabytes", 256, tr(" MiB"))
        self.threads = self._spin("threads", 1, "")
        self.threads.setRange(0, threads())
        self.threads.setSpecialValueText(tr("All cores ({0})").format(threads()))
        self.navigation = self._combo(
            "navigation",
            ("patina", tr("Patina")),
            ("blender", tr("Blender")),
            ("maya", tr("Maya")),
            ("pen", tr("Pen without a mouse")),
            ("trackpad", tr("Trackpad")),
        )
        self.pivot = self._combo(
            "pivot", ("view", tr("The middle of the view")), ("stroke", tr("The last stroke"))
        )
        self.backend = self._combo(
            "backend",
            ("auto", tr("What is faster here")),
            ("shader", tr("The graphics card")),
            ("software", tr("The processor")),
        )
        self.pressure = PressureEditor()
        self.pressure.edited.connect(lambda curve: settings.change(pressure=curve))
        self.pressure_box = self._pressure_box()

    def refresh(self) -> None:
        """Show the settings as they are."""
        values = self._settings.values
        for field, name in (
            (self.theme, "theme"), (self.language, "language"), (self.unit, "unit"),
            (self.rate, "rate"), (self.navigation, "navigation"), (self.pivot, "pivot"),
            (self.backend, "backend"),
        ):  # fmt: skip
            _choose(field, getattr(values, name))
        for number, name in (
            (self.autosave, "autosave_seconds"), (self.undo, "undo_megabytes"),
            (self.threads, "threads"), (self.metres, "metres_per_unit"),
        ):  # fmt: skip
            with QSignalBlocker(number):
                number.setValue(getattr(values, name))
        self.metres.setEnabled(values.unit != "model")
        self.pressure.show_curve(values.pressure)

    def _combo(self, name: str, *choices: tuple[Any, str]) -> QComboBox:
        field = QComboBox()
        for value, text in choices:
            field.addItem(text, value)
        field.activated.connect(lambda: self._settings.change(**{name: field.currentData()}))
        return field

    def _spin(self, name: str, step: int, suffix: str) -> QSpinBox:
        field = QSpinBox()
        field.setRange(int(RULES[name].low), int(RULES[name].high))
        field.setSingleStep(step)
        field.setSuffix(suffix)
        field.setKeyboardTracking(False)  # half a number is none
        field.valueChanged.connect(lambda value: self._settings.change(**{name: value}))
        return field

    def _pressure_box(self) -> QWidget:
        box = QWidget()
        column = QVBoxLayout()
        for text, tip, curve in (
            (self.tr("Soft"), self.tr("A light hand reaches everything"), SOFT),
            (self.tr("Straight"), self.tr("The tool gets what the pen reports"), LINEAR),
            (self.tr("Firm"), self.tr("Only a strong hand reaches everything"), FIRM),
        ):
            button = QPushButton(text)
            button.setToolTip(tip)
            button.setAccessibleName(self.tr("{0} pressure curve").format(text))
            button.setAutoDefault(False)
            button.clicked.connect(lambda checked, curve=curve: self._take(curve))
            column.addWidget(button)
        column.addStretch()
        layout = QHBoxLayout(box)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.pressure, 0, Qt.AlignmentFlag.AlignTop)
        layout.addLayout(column)
        layout.addStretch()
        return box

    def _take(self, curve: Curve) -> None:
        self._settings.change(pressure=curve)


class _Metres(QDoubleSpinBox):
    """A length from micrometres to megametres, with as many digits as it has."""

    def __init__(self) -> None:
        super().__init__()
        rule = RULES["metres_per_unit"]
        self.setDecimals(9)
        self.setRange(rule.low, rule.high)
        self.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.setKeyboardTracking(False)

    def textFromValue(self, value: float) -> str:  # noqa: N802
        """Without zeros at the end."""
        text = super().textFromValue(value)
        point = self.locale().decimalPoint()
        return text.rstrip("0").removesuffix(point) if point in text else text


def _choose(field: QComboBox, value: object) -> None:
    """Show a value, also one that the list did not hold."""
    at = field.findData(value)
    if at < 0:
        field.addItem(str(value), value)
        at = field.count() - 1
    field.setCurrentIndex(at)
