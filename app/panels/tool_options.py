"""What the present tool is set to; only what it uses is shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PyQt6.QtCore import QSignalBlocker, Qt
from PyQt6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.document import Document
from app.panels.feature_box import FeatureBox
from app.panels.length_field import LengthField
from app.panels.slide import Slide
from app.panels.symmetry_row import SymmetryRow
from app.settings import Settings
from app.theme import named
from btfcore.errors import InvalidParameter

SEEDS = 2**31 - 1  # of a spin box; an option may be larger
PARTS = 1000  # of a mask that can be named
_BRUSH = ("radius", "hardness")
# what each tool uses, in the order of `ToolOptionsPanel.fields`
USED = {
    "paint": ("sample", *_BRUSH, "weight", "transition", "orientation", "protect", "symmetry",
              "seed"),
    "stamp": ("sample", "feature", "turn", "scale", "weight", "protect", "symmetry"),
    "erase": (*_BRUSH, "symmetry", "seed"),
    "repair": (*_BRUSH, "protect", "symmetry", "seed"),
    "requilt": (*_BRUSH, "tries", "symmetry", "seed"),
    "protect": (*_BRUSH, "erase_protection"),
}  # fmt: skip


class ToolOptionsPanel(QWidget):
    """Options of the present tool, bound both ways to `document.options`.

    `fields` holds the control of each option; `refused(text)` says why a value was not taken.
    """

    def __init__(
        self, document: Document, settings: Settings, parent: QWidget | None = None
    ) -> None:
        """Follow tool and options of `document`; lengths are in the unit of `settings`."""
        super().__init__(parent)
        self._document = document
        self.title = named(QLabel(), "heading")
        self.hint = named(QLabel(), "faint")
        self.hint.setWordWrap(True)
        self.error = named(QLabel(), "warning")
        self.error.setWordWrap(True)
        self.error.setTextFormat(Qt.TextFormat.PlainText)
        self.error.hide()
        self.fields: dict[str, QWidget] = {}
        self._showers: dict[str, Callable[[Any], None]] = {}
        self._body = QWidget()
        self.form = QFormLayout(self._body)
        self.form.setContentsMargins(0, 0, 0, 0)
        self.form.setVerticalSpacing(7)
        self._build(settings)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.addWidget(self.title)
        layout.addWidget(self.hint)
        layout.addWidget(self._body)
        layout.addWidget(self.error)
        layout.addStretch(1)
        document.tool_changed.connect(self._show_tool)
        document.options_changed.connect(self._show)
        document.mesh_changed.connect(self._show)
        self._show_tool()
        self._show()

    # --- the controls

    def _build(self, settings: Settings) -> None:
        self._add("sample", self.tr("Sample"), FeatureBox(self._document),
                  self.tr("Which feature is painted: samples whose feature is marked"))  # fmt: skip
        part = QSpinBox()
        part.setRange(0, PARTS)
        part.setSpecialValueText(self.tr("all of it"))
        part.setPrefix(self.tr("part "))
        part.valueChanged.connect(lambda n: self._set("feature", n - 1 if n else None))
        self._add("feature", self.tr("Part"), part,
                  self.tr("Which part of the mask is stamped, the largest being 1"),
                  lambda value: part.setValue(0 if value is None else value + 1))  # fmt: skip
        radius = LengthField(settings, self.tr("automatic"))
        radius.edited.connect(lambda length: self._set("radius", length or 0.0))
        self._add("radius", self.tr("Si&ze"), radius,
                  self.tr("Radius of the brush at full pressure ([ and ]); clear it for a"
                          " twentieth of the mesh"), self._show_radius)  # fmt: skip
        self._slide("hardness", self.tr("&Hardness"),
                    self.tr("How sharp the edge of the brush is"), 0.0, 100.0,
                    decimals=0, suffix=" %", unit=0.01)  # fmt: skip
        self._slide("turn", self.tr("T&urn"), self.tr("Turns the stamp, counter-clockwise"),
                    -180.0, 180.0, decimals=1, suffix="°")  # fmt: skip
        self._slide("scale", self.tr("S&cale"),
                    self.tr("Size of the stamp, times its natural size"), 0.05, 4.0, most=20.0,
                    bend=2.0, suffix=" ×")  # fmt: skip
        self._slide("weight", self.tr("&Opacity λ"),
                    self.tr("How strongly the feature is wanted against invisible seams"),
                    0.0, 4.0, most=1000.0, bend=2.0)  # fmt: skip
        width = LengthField(settings, self.tr("automatic"), zero=self.tr("abrupt"))
        width.edited.connect(lambda length: self._set("transition", length))
        self._add("transition", self.tr("Tra&nsition"), width,
                  self.tr("Width over which the feature fades out; automatic takes half the"
                          " feature's own width"), self._show_transition)  # fmt: skip
        self._add_orientation()
        self._check("protect", self.tr("&Keep features that are there"),
                    self.tr("Features painted before are not painted over"))  # fmt: skip
        self._check("erase_protection", self.tr("&Take protection away"),
                    self.tr("The brush lets edits in again, not keeping them out"))  # fmt: skip
        tries = QSpinBox()
        tries.setRange(1, 10_000)
        tries.setKeyboardTracking(False)
        tries.valueChanged.connect(lambda count: self._set("tries", count))
        self._add("tries", self.tr("T&ries"), tries,
                  self.tr("How often the seams are cut again at most"), tries.setValue)  # fmt: skip
        self._add("symmetry", self.tr("Symmetry"), SymmetryRow(self._document), "")
        self._add_seed()

    def _add(
        self, name: str, text: str, field: QWidget, tip: str,
        show: Callable[[Any], None] | None = None,
    ) -> None:  # fmt: skip
        label = QLabel(text)
        label.setBuddy(field)
        if name != "symmetry":  # else the form puts it above the middle of its control
            label.setMinimumHeight(field.sizeHint().height())
        if tip:
            label.setToolTip(tip)
            field.setToolTip(tip)
        if not field.accessibleName():
            field.setAccessibleName(text.replace("&", ""))
        self.fields[name] = field
        if show is not None:
            self._showers[name] = show
        self.form.addRow(label, field)

    def _slide(
        self, name: str, text: str, tip: str, low: float, high: float, *, unit: float = 1.0,
        **details: Any,
    ) -> None:  # fmt: skip
        slide = Slide(text.replace("&", ""), tip, low, high, **details)
        slide.moved.connect(lambda value: self._set(name, value * unit))
        slide.chosen.connect(lambda value: self._show())  # what came while a hand was on it

        def show(value: float) -> None:
            if name == "turn" and not -180 <= value <= 180:
                value = (value + 180) % 360 - 180
            slide.show_value(value / unit)

        self._add(name, text, slide, tip, show)

    def _check(self, name: str, text: str, tip: str) -> None:
        box = QCheckBox(text)
        box.setToolTip(tip)
        box.setAccessibleName(text.replace("&", ""))
        box.toggled.connect(lambda on: self._set(name, on))
        self.fields[name] = box
        self._showers[name] = box.setChecked
        self.form.addRow(box)

    def _add_orientation(self) -> None:
        box = QComboBox()
        for value, text in (
            ("auto", self.tr("automatic")), ("field", self.tr("as the pattern runs")),
            ("search", self.tr("best of 24 turns")), ("stroke", self.tr("along the stroke")),
        ):  # fmt: skip
            box.addItem(text, value)
        box.activated.connect(lambda row: self._set("orientation", box.itemData(row)))
        self._add("orientation", self.tr("&Direction"), box,
                  self.tr("How the feature is turned on the surface"),
                  lambda value: box.setCurrentIndex(box.findData(value)))  # fmt: skip

    def _add_seed(self) -> None:
        row = QWidget()
        number, following = QSpinBox(), QPushButton(self.tr("Ne&xt"))
        number.setRange(0, SEEDS)
        number.setKeyboardTracking(False)
        tip = self.tr("The same seed gives the same result, another one another arrangement")
        number.setToolTip(tip)
        number.setAccessibleName(self.tr("Seed"))
        number.valueChanged.connect(lambda seed: self._set("seed", seed))
        following.setToolTip(self.tr("Take the next seed"))
        following.setAccessibleName(self.tr("Next seed"))
        following.clicked.connect(
            lambda: self._set("seed", (self._document.options.seed + 1) % SEEDS)
        )
        self.seed, self.next_seed = number, following
        line = QHBoxLayout(row)
        line.setContentsMargins(0, 0, 0, 0)
        line.addWidget(number, 1)
        line.addWidget(following)
        row.setFocusProxy(number)
        self._add("seed", self.tr("S&eed"), row, tip, lambda seed: number.setValue(seed))

    # --- both ways

    def _set(self, name: str, value: object) -> None:
        try:
            self._document.set_options(**{name: value})
        except InvalidParameter as error:
            self.error.setText(str(error))
            self.error.show()
            self._show()
        else:
            self.error.hide()

    def _show(self) -> None:
        for name, show in self._showers.items():
            field = self.fields[name]
            within = field.findChildren(QWidget)
            blockers = [QSignalBlocker(each) for each in (field, *within)]
            try:
                show(getattr(self._document.options, name))
            finally:
                for each in blockers:
                    each.unblock()

    def _show_radius(self, radius: float) -> None:
        field = self.fields["radius"]
        assert isinstance(field, LengthField)
        field.natural = self._document.radius
        field.show_length(radius or None)

    def _show_transition(self, width: float | None) -> None:
        field = self.fields["transition"]
        assert isinstance(field, LengthField)
        field.natural = self._document.radius
        field.show_length(width)

    def _show_tool(self) -> None:
        tool = self._document.tool
        used = USED.get(tool, ())
        names, hint = self._words()
        self.title.setText(names.get(tool, tool))
        self.hint.setText(hint.get(tool, ""))
        self.hint.setVisible(tool in hint)
        for name, field in self.fields.items():
            self.form.setRowVisible(field, name in used)
        self._body.setVisible(bool(used))
        self.error.hide()

    def _words(self) -> tuple[dict[str, str], dict[str, str]]:
        """Names of the tools, and what to say about those without options."""
        names = {
            "view": self.tr("NAVIGATE"), "orient": self.tr("ORIENT"),
            "synthesize": self.tr("SYNTHESIZE"), "paint": self.tr("PAINT FEATURE"),
            "stamp": self.tr("STAMP"), "erase": self.tr("ERASE"), "repair": self.tr("REPAIR"),
            "requilt": self.tr("REQUILT"), "protect": self.tr("PROTECT"),
            "light": self.tr("LIGHT"), "pick": self.tr("PICK SAMPLE"),
            "measure": self.tr("MEASURE"),
        }  # fmt: skip
        hints = {
            "view": self.tr("Drag to turn the object. Choose a tool to work on it."),
            "orient": self.tr("Draw on the surface where the pattern shall run."),
            "synthesize": self.tr("Covers the mesh with the sample chosen in the library."),
            "light": self.tr("Drag on the object to move the lamp."),
            "pick": self.tr("Click the surface to paint with the sample that is there."),
            "measure": self.tr("Click two places to measure along the surface between them."),
        }
        return names, hints
