"""What a crash left, offered at the start: restore, discard, or decide later."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PyQt6.QtCore import QBuffer, QByteArray, QDateTime, QIODevice, QLocale, QSize, Qt, pyqtSignal
from PyQt6.QtGui import QGuiApplication, QIcon, QImage, QImageReader, QPixmap
from PyQt6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QMessageBox,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.sessions import Left
from app.theme import named
from btfcore.errors import InvalidProject
from btfcore.files.project.read import project_preview

SIDE = 72
LARGEST_SIDE = 1024  # of a picture that is decoded


class RecoveryDialog(QDialog):
    """Lists sessions; restore_wanted(left) asks to give one back and closes the dialog."""

    restore_wanted = pyqtSignal(object)

    def __init__(
        self,
        found: Sequence[Left],
        discard: Callable[[Left], bool],
        parent: QWidget | None = None,
    ) -> None:
        """Offer `found`; discard : removes one for good and says whether that was possible."""
        super().__init__(parent)
        self._discard = discard
        self.question: QMessageBox | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(self.tr("Recover your work"))
        title = named(QLabel(self.tr("Patina did not end well last time")), "title")
        hint = named(
            QLabel(
                self.tr(
                    "This work was saved automatically. Restoring changes none of your own files."
                )
            ),
            "faint",
        )
        hint.setWordWrap(True)
        self.list = QListWidget()
        self.list.setIconSize(QSize(SIDE, SIDE))
        self.list.setSpacing(3)
        self.list.setAccessibleName(self.tr("Work that can be restored"))
        self.list.setToolTip(self.tr("Choose what to restore; double-click restores it"))
        for left in found:
            self.list.addItem(self._item(left))
        self.told = named(QLabel(), "faint")
        self.told.setWordWrap(True)
        self.told.setAccessibleName(self.tr("What happened"))
        self.told.hide()
        self.restore = self._button(
            self.tr("&Restore"), self.tr("Open the chosen work as it was saved")
        )
        self.restore.setDefault(True)
        self.drop = self._button(self.tr("&Discard…"), self.tr("Remove the chosen work for good"))
        self.words = self._button(
            self.tr("&Copy crash report"),
            self.tr("Put on the clipboard what Patina wrote when it crashed"),
        )
        self.later = self._button(
            self.tr("Decide &later"), self.tr("Keep everything and ask again at the next start")
        )
        row = QHBoxLayout()
        for button in (self.drop, self.words):
            row.addWidget(button)
        row.addStretch()
        for button in (self.later, self.restore):
            row.addWidget(button)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(18, 16, 18, 14)
        layout.setSpacing(10)
        for widget in (title, hint, self.list, self.told):
            layout.addWidget(widget)
        layout.addLayout(row)
        self.list.currentRowChanged.connect(self._refresh)
        self.list.itemDoubleClicked.connect(lambda item: self._restore())
        self.restore.clicked.connect(self._restore)
        self.drop.clicked.connect(self._ask)
        self.words.clicked.connect(self._copy)
        self.later.clicked.connect(self.reject)
        self.list.setCurrentRow(0)
        self._refresh()
        self.resize(600, 400)

    @property
    def chosen(self) -> Left | None:
        """The session that is marked."""
        item = self.list.currentItem()
        return None if item is None else item.data(Qt.ItemDataRole.UserRole)

    def _button(self, text: str, tip: str) -> QPushButton:
        button = QPushButton(text)
        button.setToolTip(tip)
        button.setAccessibleName(text.replace("&", "").rstrip("…"))
        button.setAutoDefault(False)
        return button

    def _item(self, left: Left) -> QListWidgetItem:
        save = left.saves[0]
        name = save.about.name or self.tr("Without a name")
        locale = QLocale()
        facts = [
            self._when(save.about.saved),
            self.tr("1 edit")
            if save.about.edits == 1
            else self.tr("{0} edits").format(locale.toString(save.about.edits)),
            locale.formattedDataSize(save.size),
        ]
        lines = [name, "  ·  ".join(facts)]
        if left.crash:
            lines.append(self.tr("Ended by a crash, of which there is a report"))
        picture = _picture(left, self.devicePixelRatioF())
        icon = QIcon(picture)
        icon.addPixmap(picture, QIcon.Mode.Selected)  # else it would be tinted
        item = QListWidgetItem(icon, "\n".join(lines))
        item.setData(Qt.ItemDataRole.UserRole, left)
        item.setToolTip(save.about.path or self.tr("It was never saved under a name."))
        item.setSizeHint(QSize(0, SIDE + 12))
        return item

    def _when(self, saved: float) -> str:
        """How long ago, where that says more than a date. saved : seconds since 1970."""
        then, now = QDateTime.fromSecsSinceEpoch(int(saved)), QDateTime.currentDateTime()
        minutes = then.secsTo(now) // 60
        if 0 <= minutes < 2:
            return self.tr("a moment ago")
        if 0 <= minutes < 100:
            return self.tr("{0} minutes ago").format(minutes)
        locale, short = QLocale(), QLocale.FormatType.ShortFormat
        if then.date() == now.date():
            return self.tr("today, {0}").format(locale.toString(then.time(), short))
        return locale.toString(then, short)

    def _refresh(self) -> None:
        left = self.chosen
        self.restore.setEnabled(left is not None)
        self.drop.setEnabled(left is not None)
        self.words.setVisible(left is not None and bool(left.crash))

    def _restore(self) -> None:
        left = self.chosen
        if left is not None:
            self.accept()
            self.restore_wanted.emit(left)

    def _copy(self) -> None:
        left, clipboard = self.chosen, QGuiApplication.clipboard()
        if left is not None and clipboard is not None:
            clipboard.setText(left.crash)
            self._tell(self.tr("Copied"))

    def _ask(self) -> None:
        item, left = self.list.currentItem(), self.chosen
        if item is None or left is None:
            return
        title = self.tr("Discard this work?")
        box = QMessageBox(QMessageBox.Icon.Warning, title, title, parent=self)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.setInformativeText(self.tr("It cannot be brought back."))
        go = box.addButton(self.tr("&Discard"), QMessageBox.ButtonRole.DestructiveRole)
        keep = box.addButton(self.tr("&Keep it"), QMessageBox.ButtonRole.RejectRole)
        assert go is not None and keep is not None
        go.setToolTip(self.tr("Remove it for good"))
        keep.setToolTip(self.tr("Change nothing"))
        box.setDefaultButton(keep)
        box.setEscapeButton(keep)
        box.finished.connect(lambda: self._answered(box.clickedButton() is go, item, left))
        self.question = box
        box.open()

    def _answered(self, go: bool, item: QListWidgetItem, left: Left) -> None:
        self.question = None
        if not go:
            return
        if not self._discard(left):
            self._tell(self.tr("Another Patina has taken up this work; it was left alone."))
        self.list.takeItem(self.list.row(item))
        if not self.list.count():
            self.reject()

    def _tell(self, text: str) -> None:
        self.told.setText(text)
        self.told.show()


def _picture(left: Left, ratio: float) -> QPixmap:
    """Thumbnail of the newest save that has one; else nothing."""
    side = round(SIDE * ratio)
    pixmap = QPixmap(side, side)
    pixmap.fill(Qt.GlobalColor.transparent)
    for save in left.saves:
        try:
            data = project_preview(save.file)
        except InvalidProject:
            continue
        image = _decoded(data or b"")
        if not image.isNull():
            pixmap = QPixmap.fromImage(
                image.scaled(
                    side, side, Qt.AspectRatioMode.KeepAspectRatio,
                    Qt.TransformationMode.SmoothTransformation,
                )
            )  # fmt: skip
            pixmap.setDevicePixelRatio(ratio)
            return pixmap
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


def _decoded(png: bytes) -> QImage:
    """Decode a small PNG; a null image for anything else."""
    buffer = QBuffer()
    buffer.setData(QByteArray(png))
    buffer.open(QIODevice.OpenModeFlag.ReadOnly)
    reader = QImageReader(buffer, b"png")
    size = reader.size()
    if not size.isValid() or max(size.width(), size.height()) > LARGEST_SIDE:
        return QImage()
    return reader.read()
