"""What the selected layer is made with; another value makes it anew when the hand lets go."""

from __future__ import annotations

from typing import Any

from PyQt6.QtWidgets import QFormLayout, QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from app.document import Document
from app.layer_views import LayerView
from app.panels.layer_model import LayerVerbs
from app.panels.length_field import LengthField
from app.panels.slide import Slide
from app.settings import Settings
from app.theme import named

SEEDS = 2**32
# what each kind of edit can be made with
KNOBS = {
    "paint": ("weight", "transition", "seed"),
    "stamp": ("weight", "rotation", "scale"),
    "erase": ("seed",),
    "repair": ("seed",),
    "requilt": ("seed",),
}


class LayerKnobs(QWidget):
    """Opacity of the constraint, transition width, turn, scale and seed of the selected layer."""

    def __init__(
        self,
        document: Document,
        verbs: LayerVerbs,
        settings: Settings,
        parent: QWidget | None = None,
    ) -> None:
        """Follow the selection of `document`."""
        super().__init__(parent)
        self._document, self._verbs = document, verbs
        self.weight = Slide(
            self.tr("Opacity"),
            self.tr("λ: how strongly the feature is wanted against invisible seams"),
            0.0, 4.0, most=1000.0, bend=2.0,
        )  # fmt: skip
        self.transition = LengthField(settings, self.tr("automatic"), zero=self.tr("abrupt"))
        self.transition.setAccessibleName(self.tr("Transition"))
        self.transition.setToolTip(
            self.tr(
                "Width of the zone over which the feature fades out.\n"
                "Automatic takes half the feature's width; clear the field for it."
            )
        )
        self.rotation = Slide(
            self.tr("Turn"), self.tr("Turns the stamp, counter-clockwise"), -180.0, 180.0,
            decimals=1, suffix="°",
        )  # fmt: skip
        self.scale = Slide(
            self.tr("Scale"), self.tr("Size of the stamp, times its natural size"), 0.05, 4.0,
            most=20.0, bend=2.0, suffix=" ×",
        )  # fmt: skip
        self.seed = QPushButton(self.tr("Another arrangement"))
        self.seed.setToolTip(self.tr("Make this layer anew with the next seed"))
        self.hint = named(QLabel(), "faint")
        self.hint.setWordWrap(True)
        self._fields = QWidget()
        form = QFormLayout(self._fields)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow(self.tr("&Opacity λ"), self.weight)
        form.addRow(self.tr("Tra&nsition"), self.transition)
        form.addRow(self.tr("T&urn"), self.rotation)
        form.addRow(self.tr("&Scale"), self.scale)
        row = QHBoxLayout()
        row.addWidget(self.seed)
        row.addStretch()
        form.addRow(row)
        self._form = form
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.hint)
        layout.addWidget(self._fields)
        self.weight.chosen.connect(lambda value: self._ask(weight=value))
        self.transition.edited.connect(lambda value: self._ask(transition=value))
        self.rotation.chosen.connect(lambda value: self._ask(rotation=value))
        self.scale.chosen.connect(lambda value: self._ask(scale=value))
        self.seed.clicked.connect(self._next_seed)
        for changed in (document.selection_changed, document.layers_changed):
            changed.connect(self._refresh)
        self._refresh()

    def _layer(self) -> LayerView | None:
        uid = self._document.selected
        return next((each for each in self._document.layers if each.uid == uid), None)

    def _refresh(self) -> None:
        layer = self._layer()
        edit = layer.edit if layer is not None else None
        self._fields.setVisible(layer is not None and edit is not None)
        self.hint.setVisible(edit is None)
        if layer is None or edit is None:
            waiting = layer is not None
            self.hint.setText(
                self.tr("Its settings come when it is computed.")
                if waiting
                else self.tr("Select a layer to change how it was made.")
            )
            return
        offered = KNOBS.get(layer.kind, ())
        self._fields.setEnabled(not layer.busy)
        fields: dict[str, QWidget] = {
            "weight": self.weight, "transition": self.transition, "rotation": self.rotation,
            "scale": self.scale,
        }  # fmt: skip
        for name, field in fields.items():
            self._form.setRowVisible(field, name in offered)
        self.seed.setVisible("seed" in offered)
        if "weight" in offered:
            self.weight.show_value(getattr(edit, "weight", 0.0))
        if "transition" in offered:
            self.transition.natural = self._document.radius
            self.transition.show_length(getattr(edit, "transition", None))
        if "rotation" in offered:
            turn = getattr(edit, "rotation", 0.0)
            self.rotation.show_value(turn if -180 <= turn <= 180 else (turn + 180) % 360 - 180)
        if "scale" in offered:
            self.scale.show_value(getattr(edit, "scale", 1.0))

    def _ask(self, **knobs: Any) -> None:
        layer = self._layer()
        if layer is None or layer.busy or layer.edit is None:
            return
        fresh = {name: value for name, value in knobs.items() if getattr(layer.edit, name) != value}
        if fresh and not self._verbs.change_layer(layer.uid, **fresh):
            self._refresh()  # refused: show what it still is

    def _next_seed(self) -> None:
        layer = self._layer()
        if layer is not None and layer.edit is not None:
            self._ask(seed=(layer.edit.seed + 1) % SEEDS)
