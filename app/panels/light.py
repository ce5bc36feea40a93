"""What the surface is lit by, how its radiance is shown, and how good the picture is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PyQt6.QtCore import QSignalBlocker, Qt, pyqtSignal
from PyQt6.QtGui import QColor, QResizeEvent
from PyQt6.QtWidgets import (
    QCheckBox,
    QColorDialog,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QSlider,
    QVBoxLayout,
    QWidget,
)

from app.document import Document, Lamp, Lighting, Mode
from app.theme import named
from btfcore.btf.colour import linear_to_srgb, srgb_to_linear
from btfcore.render.relight import Quality

MOST_LAMPS = 8
STOPS, STEPS = 8, 10  # the exposure's slider goes so far each way, in so many steps a stop
_ELSEWHERE = Lamp((-0.6, 0.35, 0.72), strength=0.6)


class LightPanel(QWidget):
    """Shown in the mode of light; environment_wanted() asks for a file, drag_wanted(on)."""

    environment_wanted = pyqtSignal()
    drag_wanted = pyqtSignal(bool)

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Show and change the lighting of `document`."""
        super().__init__(parent)
        self._document = document
        self.drag = named(QPushButton(self.tr("Move light")), "mode")
        self.drag.setCheckable(True)
        self.drag.setToolTip(
            self.tr("Drag the light over the surface; also with Ctrl, or while L is held")
        )
        self.drag.toggled.connect(self.drag_wanted)
        self.lamps = QComboBox()
        self.lamps.setAccessibleName(self.tr("Light that is moved"))
        self.lamps.activated.connect(lambda index: document.set_lighting(main=index))
        self.add, self.remove = QPushButton("+"), QPushButton("−")
        self.add.setToolTip(self.tr("Add a light"))
        self.remove.setToolTip(self.tr("Remove this light"))
        for button, name in ((self.add, "Add a light"), (self.remove, "Remove this light")):
            button.setAccessibleName(self.tr(name))
            button.setMaximumWidth(34)
        self.add.clicked.connect(self._add)
        self.remove.clicked.connect(self._remove)
        self.strength = QDoubleSpinBox()
        self.strength.setRange(0.0, 1000.0)
        self.strength.setSingleStep(0.1)
        self.strength.setPrefix(self.tr("strength "))
        self.strength.valueChanged.connect(lambda value: self._change(strength=value))
        self.colour = QPushButton()
        self.colour.setMaximumWidth(34)
        self.colour.setAccessibleName(self.tr("Colour of the light"))
        self.colour.setToolTip(self.tr("Colour of the light"))
        self.colour.clicked.connect(self._ask_colour)
        self.environment = QPushButton(self.tr("Environment…"))
        self.environment.setToolTip(
            self.tr("Light from all around, from an HDR or EXR picture twice as wide as high")
        )
        self.environment.clicked.connect(self.environment_wanted)
        self.turn = QSlider(Qt.Orientation.Horizontal)
        self.turn.setRange(0, 359)
        self.turn.setAccessibleName(self.tr("Turn the environment"))
        self.turn.setToolTip(self.tr("Turn the environment"))
        self.turn.valueChanged.connect(lambda value: document.set_lighting(turn=float(value)))
        self.bare = QPushButton("✕")
        self.bare.setMaximumWidth(34)
        self.bare.setToolTip(self.tr("No environment"))
        self.bare.setAccessibleName(self.tr("No environment"))
        self.bare.clicked.connect(lambda: document.set_lighting(environment=None, source=""))
        self.shadows = QCheckBox(self.tr("Cast shadows"))
        self.shadows.setToolTip(self.tr("Parts of the mesh shade each other; seen at rest"))
        self.shadows.toggled.connect(lambda on: document.set_lighting(shadows=on))
        self.exposure = QSlider(Qt.Orientation.Horizontal)
        self.exposure.setRange(-STOPS * STEPS, STOPS * STEPS)
        self.exposure.setPageStep(STEPS)
        self.exposure.setAccessibleName(self.tr("Exposure"))
        self.exposure.valueChanged.connect(
            lambda value: document.set_lighting(exposure=value / STEPS)
        )
        self.stops = named(QLabel(), "faint")
        self.stops.setMinimumWidth(52)
        self.curve = QComboBox()
        for name, curve in (
            (self.tr("As is"), "clip"), (self.tr("Soft (Reinhard)"), "reinhard"),
            (self.tr("Filmic"), "filmic"),
        ):  # fmt: skip
            self.curve.addItem(name, curve)
        self.curve.setAccessibleName(self.tr("Tone curve"))
        self.curve.activated.connect(
            lambda index: document.set_lighting(curve=self.curve.itemData(index))
        )
        self.readout = named(QLabel(), "faint")
        self.readout.setMinimumWidth(200)
        self.readout.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._reading = self._backend = ""
        self._arrange()
        for changed in (document.lighting_changed, document.mode_changed):
            changed.connect(self._refresh)
        self._refresh()

    def _arrange(self) -> None:
        rows = QVBoxLayout(self)
        rows.setContentsMargins(12, 0, 12, 8)
        rows.setSpacing(6)
        above = (
            self.drag, self.lamps, self.add, self.remove, self.strength, self.colour,
            self.environment, self.turn, self.bare, self.shadows,
        )  # fmt: skip
        below = (QLabel(self.tr("Exposure")), self.exposure, self.stops, self.curve, self.readout)
        for widgets in (above, below):
            row = QHBoxLayout()
            row.setSpacing(8)
            for each in widgets:
                row.addWidget(each)
            row.setStretchFactor(widgets[-1], 1)
            rows.addLayout(row)
        self.turn.setMaximumWidth(90)
        self.exposure.setFixedWidth(180)
        self.readout.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)

    def tell(self, quality: Quality, moving: bool) -> None:
        """Say how good the picture is."""
        words = {
            "full": self.tr("full quality"), "midpoints": self.tr("control points and midpoints"),
            "control": self.tr("control points"), "half": self.tr("half resolution"),
        }  # fmt: skip
        if quality.mode == "full" and quality.error == 0 and quality.done == 1:
            text = self.tr("Full quality")
        elif moving:
            text = self.tr("Moving: {0}, error {1:.3f}").format(words[quality.mode], quality.error)
        else:
            text = self.tr("Refining: {0:.0%}").format(quality.done)
        self._reading = text
        self._elide()

    def tell_backend(self, kind: str, reason: str) -> None:
        """Say what computes the light: the shader on `reason`, or the processor because of it."""
        words = self.tr("shader on {0}") if kind == "shader" else self.tr("processor: {0}")
        self._backend = words.format(reason)
        self.readout.setToolTip(self._backend)
        self._elide()

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: N802
        """Show as much of the reading as there is room for."""
        super().resizeEvent(event)
        self._elide()

    def _elide(self) -> None:
        """Shorten the reading to the label, which never makes the window wider."""
        parts = [each for each in (self._reading, self._backend) if each]
        text = " · ".join(parts)
        room = self.readout.width()
        fit = self.readout.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, room)
        if fit != self.readout.text():
            self.readout.setText(fit)

    def _refresh(self) -> None:
        lighting = self._document.lighting
        self.setVisible(self._document.mode is Mode.LIT)
        lamp = _main(lighting)
        blocked = [
            QSignalBlocker(each)
            for each in (self.lamps, self.strength, self.exposure, self.curve, self.shadows,
                         self.turn)
        ]  # fmt: skip
        if self.lamps.count() != len(lighting.lamps):
            self.lamps.clear()
            for number in range(len(lighting.lamps)):
                self.lamps.addItem(self.tr("Light {0}").format(number + 1))
        self.lamps.setCurrentIndex(lighting.main if lamp else -1)
        self.add.setEnabled(len(lighting.lamps) < MOST_LAMPS)
        for widget in (self.remove, self.strength, self.colour, self.drag, self.lamps):
            widget.setEnabled(lamp is not None)
        if lamp is not None:
            self.strength.setValue(lamp.strength)
            sheet = f"background: {_coded(lamp.colour).name()};"
            if sheet != self.colour.styleSheet():  # else every step of a drag paints it anew
                self.colour.setStyleSheet(sheet)
        self.environment.setText(lighting.source or self.tr("Environment…"))
        self.turn.setVisible(lighting.environment is not None)
        self.bare.setVisible(lighting.environment is not None)
        self.turn.setValue(round(lighting.turn))
        self.shadows.setChecked(lighting.shadows)
        self.exposure.setValue(round(lighting.exposure * STEPS))
        self.stops.setText(self.tr("{0:+.1f} EV").format(lighting.exposure))
        self.curve.setCurrentIndex(self.curve.findData(lighting.curve))
        for each in blocked:
            each.unblock()

    def _change(self, **changes: object) -> None:
        lighting = self._document.lighting
        if _main(lighting) is not None:
            lamps = list(lighting.lamps)
            lamps[lighting.main] = replace(lamps[lighting.main], **changes)  # type: ignore[arg-type]
            self._document.set_lighting(lamps=tuple(lamps))

    def _add(self) -> None:
        lamps = self._document.lighting.lamps
        fresh = _ELSEWHERE if lamps else Lamp()
        self._document.set_lighting(lamps=(*lamps, fresh), main=len(lamps))

    def _remove(self) -> None:
        lighting = self._document.lighting
        left = tuple(x for k, x in enumerate(lighting.lamps) if k != lighting.main)
        self._document.set_lighting(lamps=left, main=max(min(lighting.main, len(left) - 1), 0))

    def _ask_colour(self) -> None:
        lamp = _main(self._document.lighting)
        if lamp is None:
            return
        chosen = QColorDialog.getColor(_coded(lamp.colour), self, self.tr("Colour of the light"))
        if chosen.isValid():
            code = np.array([chosen.red(), chosen.green(), chosen.blue()], np.uint8)
            red, green, blue = srgb_to_linear(code).tolist()
            self._change(colour=(red, green, blue))


def _main(lighting: Lighting) -> Lamp | None:
    return lighting.lamps[lighting.main] if lighting.main < len(lighting.lamps) else None


def _coded(linear: tuple[float, float, float]) -> QColor:
    red, green, blue = (linear_to_srgb(np.array(linear)) * 255 + 0.5).astype(int).tolist()
    return QColor(red, green, blue)
