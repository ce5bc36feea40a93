"""The dialog in which the feature of a sample is marked by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PyQt6.QtCore import QSize, Qt
from PyQt6.QtGui import QCloseEvent, QKeySequence, QShortcut
from PyQt6.QtWidgets import (
    QButtonGroup,
    QDialog,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QMessageBox,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.panels.mask_model import MaskModel
from app.panels.mask_options import MaskOptions
from app.panels.mask_view import MaskView
from app.panels.mask_work import MaskTool
from app.panels.messages import MessageBar
from app.theme import named
from btfcore.btf.feature import check_mask
from btfcore.btf.sample import BtfSample
from btfcore.errors import PatinaError
from btfcore.files.atomic import write_bytes
from btfcore.files.png import encode_png
from btfcore.types import F4

SIZE_STEP = 1.15  # of the radius for a press of [ or ]
HARDNESS_STEP = 0.1
_PANEL = 300  # units that the options are wide


class MaskEditor(QDialog):
    """Marks the feature on one sample; `drawn_mask()` is the result once it was accepted.

    Closing it with changes asks; an empty or a full mask is not accepted.
    """

    def __init__(
        self,
        name: str,
        colour: F4,
        mask: F4 | None = None,
        *,
        tiles: bool = False,
        btf: BtfSample | None = None,
        folder: Path | None = None,
        curve: Callable[[float], float] | None = None,
        parent: QWidget | None = None,
    ) -> None:
        """Edit a copy of `mask` (H, W) f4 in 0–1 on colours (H, W, 3) f4, sRGB-coded.

        tiles : opposite borders fit, and tools go over them. btf : the same sample, to be shown
        under other lights. folder : where "Save mask…" begins. curve : the brush's share of its
        radius at a pen's pressure, both 0–1.
        """
        super().__init__(parent)
        self._folder = folder
        self.model = MaskModel(name, colour, mask, tiles=tiles, btf=btf, curve=curve, parent=self)
        self.view = MaskView(self.model)
        self.options = MaskOptions(self.model)
        self.errors = MessageBar("errors")
        self.readout = QLabel()
        self.readout.setWordWrap(True)
        self.readout.setTextFormat(Qt.TextFormat.PlainText)
        self.readout.setAccessibleName(self.tr("What is marked"))
        self.busy = QProgressBar()
        self.busy.setRange(0, 0)
        self.busy.setMaximumWidth(90)
        self.busy.setAccessibleName(self.tr("Working"))
        self.busy.setToolTip(self.tr("The whole sample is being looked at; Esc stops it"))
        self.setWindowTitle(self.tr("Mark the feature: {0}").format(name))
        self.setWindowFlag(Qt.WindowType.WindowMaximizeButtonHint)
        self.setModal(True)
        screen = self.screen()
        if screen is not None:  # by itself a dialog takes no more than two thirds of it
            self.resize(self.sizeHint().boundedTo(screen.availableSize() * 0.9))
        self._build()
        self._keys()
        self.options.opacity_changed.connect(self.view.set_opacity)
        self.options.tint_changed.connect(self.view.set_tint)
        self.view.zoom_changed.connect(self._show_zoom)
        self.model.settings_changed.connect(self._refresh)
        self.model.state_changed.connect(self._refresh)
        self.model.mask_changed.connect(lambda box: self._say())
        self.model.failed.connect(self.errors.tell)
        self._refresh()
        self.view.setFocus()

    @staticmethod
    def edited(name: str, colour: F4, mask: F4 | None = None, **details: Any) -> F4 | None:
        """Let the user edit a mask (`details` as above); None where it was left as it is."""
        dialog = MaskEditor(name, colour, mask, **details)
        try:
            return dialog.drawn_mask() if dialog.exec() == QDialog.DialogCode.Accepted else None
        finally:
            dialog.deleteLater()

    def drawn_mask(self) -> F4:
        """The mask (H, W) f4 in 0–1 as it stands."""
        return self.model.mask.copy()

    def sizeHint(self) -> QSize:  # noqa: N802
        """Large enough to draw in."""
        return QSize(1120, 740)

    def save(self, path: Path) -> bool:
        """Write the mask as a grey PNG of 8 bits; False, and a message, where that fails."""
        try:
            write_bytes(path, encode_png(np.rint(self.model.mask * 255).astype(np.uint8)))
        except (PatinaError, OSError) as error:
            self.errors.tell(str(error))
            return False
        return True

    def accept(self) -> None:
        """Take the mask, unless it marks nothing or everything or work still runs."""
        self.model.finish_stroke()
        if self.model.busy:
            self.errors.tell(self.tr("The last step is still being worked on"))
            return
        try:
            check_mask(self.model.name, self.model.mask, self.model.mask.shape)
        except PatinaError as error:
            self.errors.tell(str(error))
            return
        super().accept()

    def reject(self) -> None:
        """Leave off what is being drawn or worked on; else close, asking where it changed."""
        if self.view.cancel():
            return
        if self.model.busy:
            self.model.cancel_work()
            return
        self._leave()

    def closeEvent(self, event: QCloseEvent | None) -> None:  # noqa: N802
        """Ask before anything is lost."""
        if event is not None:
            event.ignore()
        self._leave()

    def done(self, result: int) -> None:
        """Close, and stop what runs."""
        self.model.close()
        super().done(result)

    def _leave(self) -> None:
        if self.model.changed or self.model.stroking:
            kind = QMessageBox.StandardButton
            box = QMessageBox(self)
            box.setIcon(QMessageBox.Icon.Question)
            box.setWindowTitle(self.tr("Changed mask"))
            box.setText(self.tr("The mask was changed. Keep the changes?"))
            box.setStandardButtons(kind.Save | kind.Discard | kind.Cancel)
            box.setDefaultButton(kind.Save)
            for each, text in (
                (kind.Save, self.tr("Keep")), (kind.Discard, self.tr("Discard")),
                (kind.Cancel, self.tr("Go on editing")),
            ):  # fmt: skip
                button = box.button(each)
                if button is not None:
                    button.setText(text)
            answer = box.exec()
            if answer == kind.Save:
                self.accept()
            if answer != kind.Discard:
                return
        super().reject()

    def _build(self) -> None:
        panel = named(QWidget(), "panel")
        side = QVBoxLayout(panel)
        side.setContentsMargins(12, 12, 12, 12)
        scroll = QScrollArea()
        scroll.setWidget(self.options)
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QScrollArea.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        side.addWidget(scroll, 1)
        side.addWidget(self.readout)
        panel.setFixedWidth(_PANEL)
        middle = QHBoxLayout()
        middle.setSpacing(0)
        middle.addWidget(self.view, 1)
        middle.addWidget(panel)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.errors)
        layout.addLayout(self._top())
        layout.addLayout(middle, 1)
        layout.addLayout(self._bottom())

    def _top(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setContentsMargins(12, 8, 12, 8)
        row.setSpacing(0)
        self.tools: dict[MaskTool, QPushButton] = {}
        group = QButtonGroup(self)
        for tool, text, tip in (
            (MaskTool.BRUSH, self.tr("Brush"), self.tr("Paint the mask (B)")),
            (MaskTool.LASSO, self.tr("Lasso"), self.tr("Draw around the feature (L)")),
            (MaskTool.FLOOD, self.tr("Flood"), self.tr("Mark texels of like colour (W)")),
        ):
            button = self._button(text, tip, lambda _=False, t=tool: self.model.set(tool=t))
            button.setCheckable(True)
            group.addButton(named(button, "mode"))
            row.addWidget(button)
            self.tools[tool] = button
        row.addSpacing(14)
        self.remove = self._button(
            self.tr("Remove"),
            self.tr("Take away instead of adding (X); also while Alt is held, or with the right"
                    " button"),
            lambda on: self.model.set(remove=on),
        )  # fmt: skip
        self.remove.setCheckable(True)
        row.addWidget(named(self.remove, "mode"))
        row.addStretch()
        row.addWidget(self.busy)
        row.addSpacing(8)
        row.setSpacing(4)
        self.undo = self._button(self.tr("Undo"), "", lambda: self.model.undo())
        self.redo = self._button(self.tr("Redo"), "", lambda: self.model.redo())
        fit = self._button(
            self.tr("Fit"), self.tr("Show all of the sample (F)"), lambda: self.view.fit()
        )
        self.zoom = self._button(
            "100 %", self.tr("One texel for each pixel of the screen (1)"),
            lambda: self.view.actual_size(),
        )  # fmt: skip
        self.zoom.setAccessibleName(self.tr("Zoom"))
        self.zoom.setMinimumWidth(74)
        for each in (self.undo, self.redo, fit, self.zoom):
            row.addWidget(each)
        return row

    def _bottom(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setContentsMargins(12, 8, 12, 8)
        self.store = self._button(
            self.tr("Save mask…"), self.tr("Write the mask as a grey PNG file (Ctrl+S)"), self._ask
        )
        cancel = self._button(
            self.tr("Cancel"), self.tr("Leave the mask as it was"), lambda: self._leave()
        )
        self.ok = named(QPushButton(self.tr("OK")), "ok")
        self.ok.setAutoDefault(False)
        self.ok.setAccessibleName(self.tr("OK"))
        self.ok.clicked.connect(self.accept)
        row.addWidget(self.store)
        row.addStretch()
        row.addWidget(cancel)
        row.addSpacing(6)
        row.addWidget(self.ok)
        return row

    def _button(self, text: str, tip: str, call: object) -> QPushButton:
        button = QPushButton(text)
        button.setAutoDefault(False)  # Enter is the lasso's
        button.setAccessibleName(text)
        button.setToolTip(tip)
        button.clicked.connect(call)  # type: ignore[arg-type]
        return button

    def _keys(self) -> None:
        model, view = self.model, self.view
        for keys, call in (
            (("[",), lambda: model.set(radius=model.settings.radius / SIZE_STEP)),
            (("]",), lambda: model.set(radius=model.settings.radius * SIZE_STEP)),
            (("Shift+[", "{"),
             lambda: model.set(hardness=model.settings.hardness - HARDNESS_STEP)),
            (("Shift+]", "}"),
             lambda: model.set(hardness=model.settings.hardness + HARDNESS_STEP)),
            (("X",), lambda: model.set(remove=not model.settings.remove)),
            (("B",), lambda: model.set(tool=MaskTool.BRUSH)),
            (("L",), lambda: model.set(tool=MaskTool.LASSO)),
            (("W",), lambda: model.set(tool=MaskTool.FLOOD)),
            (("F",), view.fit),
            (("1",), view.actual_size),
            (("Ctrl++", "Ctrl+="), lambda: view.zoom_by(1.25)),
            (("Ctrl+-",), lambda: view.zoom_by(0.8)),
            (("Ctrl+I",), model.invert),
            (("Ctrl+Z",), model.undo),
            (("Ctrl+Shift+Z", "Ctrl+Y"), model.redo),
            (("Ctrl+S",), self._ask),
        ):  # fmt: skip
            for each in keys:
                shortcut = QShortcut(QKeySequence(each), self)
                shortcut.activated.connect(call)
                shortcut.activatedAmbiguously.connect(call)  # "{" is Shift+[ on some keyboards

    def _ask(self) -> None:
        start = (self._folder or Path.home()) / f"{self.model.name}_mask.png"
        chosen, _ = QFileDialog.getSaveFileName(
            self, self.tr("Save mask"), str(start), self.tr("PNG image (*.png)")
        )
        if chosen:
            path = Path(chosen)
            self.save(path if path.suffix else path.with_suffix(".png"))

    def _refresh(self) -> None:
        settings, history = self.model.settings, self.model.history
        for tool, button in self.tools.items():
            button.setChecked(tool is settings.tool)
        self.remove.setChecked(settings.remove)
        for button, word, label, keys in (
            (self.undo, self.tr("Undo"), history.undo_label, "Ctrl+Z"),
            (self.redo, self.tr("Redo"), history.redo_label, "Ctrl+Shift+Z"),
        ):
            button.setEnabled(label is not None)
            what = word if label is None else self.tr("{0}: {1}").format(word, label)
            button.setToolTip(self.tr("{0} ({1})").format(what, keys))
        self.busy.setVisible(self.model.busy)
        self._say()

    def _show_zoom(self, zoom: float) -> None:
        self.zoom.setText(self.tr("{0} %").format(round(100 * zoom * self.devicePixelRatioF())))

    def _say(self) -> None:
        share, found = self.model.share, self.model.report
        lines = [self.tr("Marked: {0:.2f} % of the sample").format(100 * share)]
        if share == 0:
            lines.append(self.tr("⚠ Nothing is marked yet."))
        elif share == 1:
            lines.append(self.tr("⚠ All of it is marked: some background has to be left."))
        elif found is not None:
            if found.half_width == found.half_width:  # not NaN
                width = self.tr("Typical width: {0:.1f} texels").format(2 * found.half_width)
                lines.append(width)
            lines += ["⚠ " + _sentence(note) for note in found.notes]
        self.readout.setText("\n".join(lines))
        self.ok.setEnabled(0 < share < 1)
        self.ok.setToolTip(
            self.tr("Take this mask") if 0 < share < 1 else self.tr("Mark a part of the sample")
        )


def _sentence(note: str) -> str:
    return note[:1].upper() + note[1:] + "."
