"""A slider and a field for one number, which is told when the hand lets go."""

from __future__ import annotations

from PyQt6.QtCore import QEvent, QObject, Qt, QTimer, pyqtSignal
from PyQt6.QtWidgets import QAbstractSpinBox, QDoubleSpinBox, QHBoxLayout, QSlider, QWidget

STEPS = 1000
REST_MS = 350  # after the last turn of the wheel or press of an arrow


class Slide(QWidget):
    """Sets a number in `low` … `high` by hand, in `low` … `most` by typing.

    chosen(value) comes once when a drag ends, a typed number is entered, or a moment after the
    last step; `moved(value)` at every movement. `bend` > 1 gives small numbers more room.
    """

    moved = pyqtSignal(float)
    chosen = pyqtSignal(float)

    def __init__(
        self,
        name: str,
        tip: str,
        low: float,
        high: float,
        *,
        most: float | None = None,
        bend: float = 1.0,
        decimals: int = 2,
        suffix: str = "",
        parent: QWidget | None = None,
    ) -> None:
        """`name` is read out, `tip` shown."""
        super().__init__(parent)
        self._low, self._high, self._bend = low, high, bend
        self._showing = False
        self._told: float | None = None
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 10)
        self.field = QDoubleSpinBox()
        self.field.setDecimals(decimals)
        self.field.setRange(low, high if most is None else most)
        self.field.setSingleStep((high - low) / 100 if decimals else 1)
        self.field.setSuffix(suffix)
        self.field.setKeyboardTracking(False)
        self.field.setButtonSymbols(QAbstractSpinBox.ButtonSymbols.NoButtons)
        self.field.setFixedWidth(self.field.fontMetrics().horizontalAdvance("0000.00") + 34)
        for widget in (self, self.slider, self.field):
            widget.setToolTip(tip)
            widget.setAccessibleName(name)
            widget.installEventFilter(self)
        self._rest = QTimer(self)
        self._rest.setSingleShot(True)
        self._rest.setInterval(REST_MS)
        self._rest.timeout.connect(self._tell)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.slider, 1)
        layout.addWidget(self.field)
        self.setFocusProxy(self.field)
        self.slider.valueChanged.connect(self._slid)
        self.slider.sliderReleased.connect(self._tell)
        self.field.valueChanged.connect(self._typed)
        self.field.editingFinished.connect(self._tell)

    @property
    def value(self) -> float:
        """The number as it stands."""
        return self.field.value()

    def show_value(self, value: float) -> None:
        """Show another number, without telling; not while a hand is on it."""
        if self.slider.isSliderDown() or self._rest.isActive():
            return
        self._showing = True
        if round(value, self.field.decimals()) != self.field.value():  # else typed text would go
            self.field.setValue(value)
        self.slider.setValue(self._step_of(value))
        self._showing = False
        self._told = self.field.value()

    def eventFilter(self, watched: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Leave the wheel to what scrolls, unless it was clicked before."""
        if event is not None and event.type() == QEvent.Type.Wheel:
            if isinstance(watched, QWidget) and not watched.hasFocus():
                event.ignore()
                return True
        return super().eventFilter(watched, event)

    def _slid(self, step: int) -> None:
        if self._showing:
            return
        share = (step / STEPS) ** self._bend
        self._showing = True
        self.field.setValue(self._low + share * (self._high - self._low))
        self._showing = False
        self._changed(waiting=not self.slider.isSliderDown())

    def _typed(self, value: float) -> None:
        if self._showing:
            return
        self._showing = True
        self.slider.setValue(self._step_of(value))
        self._showing = False
        self._changed(waiting=True)

    def _changed(self, *, waiting: bool) -> None:
        self.moved.emit(self.field.value())
        if waiting:
            self._rest.start()

    def _tell(self) -> None:
        self._rest.stop()
        value = self.field.value()
        if value != self._told:
            self._told = value
            self.chosen.emit(value)

    def _step_of(self, value: float) -> int:
        share = (min(max(value, self._low), self._high) - self._low) / (self._high - self._low)
        return int(round(STEPS * share ** (1 / self._bend)))
