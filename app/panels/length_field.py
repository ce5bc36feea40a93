"""A field for a length in the user's unit, which may also be left to the program."""

from __future__ import annotations

import math

from PyQt6.QtCore import pyqtSignal
from PyQt6.QtGui import QValidator
from PyQt6.QtWidgets import QDoubleSpinBox, QWidget

from app.settings import Settings
from app.units import length_text, parse_length
from btfcore.errors import InvalidParameter

STEP = 1.1  # a step makes it so many times longer
LONGEST = 1e30
_AUTOMATIC = -1.0  # of the spin box, which knows numbers only


class LengthField(QDoubleSpinBox):
    """Shows and takes "12 mm", "1,2cm", "0.3"; `edited` tells the length in the mesh's units.

    edited(float | None) comes after a step, a typed text or a turn of the wheel, never when the
    program sets it. None: automatic, which `automatic` words and `natural` measures.
    """

    edited = pyqtSignal(object)

    def __init__(
        self, settings: Settings, automatic: str, *, zero: str = "", parent: QWidget | None = None
    ) -> None:
        """`automatic` : shown for None. zero : shown for 0; "" does not let 0 in."""
        super().__init__(parent)
        self._settings, self._automatic, self._zero = settings, automatic, zero
        self._showing = False
        self.natural = 1.0  # what None amounts to: steps begin there
        self.setDecimals(40)
        self.setRange(_AUTOMATIC, LONGEST)
        self.setSpecialValueText(automatic)
        self.setKeyboardTracking(False)
        self.setAccelerated(True)
        self.valueChanged.connect(self._tell)
        settings.changed.connect(lambda names: self._reword())

    @property
    def length(self) -> float | None:
        """In the mesh's units; None: automatic."""
        return None if self.value() < 0 else self.value()

    def show_length(self, length: float | None) -> None:
        """Show another length, without telling."""
        value = _AUTOMATIC if length is None else length
        if value != self.value():  # else text that is being typed would go
            self._showing = True
            self.setValue(value)
            self._showing = False

    # --- what the spin box asks for

    def textFromValue(self, value: float) -> str:  # noqa: N802
        """Four digits and the unit."""
        if value < 0:
            return self._automatic
        if value == 0 and self._zero:
            return self._zero
        values = self._settings.values
        return length_text(value, values.unit, values.metres_per_unit)

    def valueFromText(self, text: str | None) -> float:  # noqa: N802
        """The length of a text; automatic where it is empty or none."""
        found = self._read(text or "")
        return self.value() if found is None else found

    def validate(self, text: str | None, at: int) -> tuple[QValidator.State, str, int]:
        """Take what can be read, and let anything be typed on the way there."""
        good = self._read(text or "") is not None
        state = QValidator.State.Acceptable if good else QValidator.State.Intermediate
        return state, text or "", at

    def fixup(self, text: str | None) -> str:
        """Go back to the last length where what was typed is none."""
        return self.textFromValue(self.value())

    def stepBy(self, steps: int) -> None:  # noqa: N802
        """Make it longer or shorter by a tenth; from automatic, begin at the natural length."""
        base = self.value() if self.value() > 0 else self.natural
        if base > 0 and math.isfinite(base):
            self.setValue(base * STEP**steps)

    def stepEnabled(self) -> QDoubleSpinBox.StepEnabledFlag:  # noqa: N802
        """It can always be longer or shorter."""
        flag = QDoubleSpinBox.StepEnabledFlag
        return flag.StepUpEnabled | flag.StepDownEnabled

    def _read(self, text: str) -> float | None:
        plain = text.strip()
        if plain in ("", self._automatic):
            return _AUTOMATIC
        if self._zero and plain == self._zero:
            return 0.0
        values = self._settings.values
        try:
            found = parse_length(plain, values.unit, values.metres_per_unit)
        except InvalidParameter:
            return None
        if found == 0 and not self._zero:
            return None
        return found if 0 <= found <= LONGEST else None

    def _tell(self, value: float) -> None:
        if not self._showing:
            self.edited.emit(self.length)

    def _reword(self) -> None:
        edit = self.lineEdit()
        if edit is not None:
            edit.setText(self.textFromValue(self.value()))
