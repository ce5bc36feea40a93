"""Brings a PBR set, a BTF or an image into the library."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import pyqtSignal
from PyQt6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.panels.import_job import LARGEST, LAYOUTS, SMALLEST, ImportKnobs, Look, bring, look
from app.panels.latest import Latest
from app.panels.messages import MessageBar
from app.tasks import Tasks
from app.theme import named

SUFFIX = ".btfz"
LONGEST = 80  # characters of a name
AS_THEY_ARE = ("image", "package")  # kinds that the library reads without a package of ours


class ImportDialog(QDialog):
    """Looks at what was chosen, bakes and factorises it in the background, and tells.

    imported(path, notes) : a file that the library can show.
    """

    imported = pyqtSignal(object, object)

    def __init__(
        self, folder: Path, source: Path | None = None, parent: QWidget | None = None
    ) -> None:
        """`folder` : where packages are written. `source` : what to bring in, if known."""
        super().__init__(parent)
        self.setWindowTitle(self.tr("Import a sample"))
        self.found: Look | None = None
        self.looking = Latest(self)
        self.work = Tasks(self)
        self._folder = folder
        self.errors = MessageBar("errors")
        self._build()
        self.looking.failed.connect(self._refuse)
        self.work.progressed.connect(self._progressed)
        self.work.finished.connect(lambda name, value: self._done(*value))
        self.work.failed.connect(lambda name, text: self.errors.tell(text))
        self.work.idle.connect(self._refresh)
        self.name.textChanged.connect(self._refresh)
        self.automatic.toggled.connect(lambda on: self.relief.setDisabled(on))
        self._refresh()
        if source is not None:
            self.look_at(source)

    def look_at(self, path: Path) -> None:
        """Find out in the background what a path holds."""
        self.found = None
        self.errors.clear()
        self.source.setText(str(path))
        self.source.setToolTip(str(path))
        self.kind.setText(self.tr("Looking at it …"))
        self.looking.ask("look", look(path), self._take)
        self._refresh()

    def knobs(self) -> ImportKnobs:
        """As they are set."""
        return ImportKnobs(
            self.side.value(), None if self.automatic.isChecked() else self.relief.value(),
            self.directions.currentData(), self.shadows.isChecked(), self.parallax.isChecked(),
            self.rank.value(),
        )  # fmt: skip

    @property
    def target(self) -> Path:
        """The package that would be written."""
        return self._folder / (self.name.text().strip() + SUFFIX)

    def accept(self) -> None:
        """Begin; the dialog closes when it is done."""
        found = self.found
        if found is None or self.work.busy:
            return
        if found.kind in AS_THEY_ARE:
            self._done(found.path, ())
            return
        self.errors.clear()
        self.work.start("import", bring(found, self.knobs(), self.target))
        self._refresh()

    def reject(self) -> None:
        """Stop what runs; else close."""
        if self.work.busy:
            self.work.cancel()
        else:
            super().reject()

    def done(self, result: int) -> None:
        """Leave no thread behind."""
        self.looking.close()
        self.work.close()
        super().done(result)

    def _build(self) -> None:
        self.source, self.kind = QLineEdit(), named(QLabel(), "faint")
        self.source.setReadOnly(True)
        self.source.setAccessibleName(self.tr("What is imported"))
        self.source.setPlaceholderText(self.tr("A file or folder"))
        self.kind.setWordWrap(True)
        self.file, self.set_folder = (
            QPushButton(self.tr("&File…")), QPushButton(self.tr("F&older…")),
        )  # fmt: skip
        self.file.setToolTip(self.tr("A BTF, a zip, an image, or one map of a PBR set"))
        self.set_folder.setToolTip(self.tr("A folder of maps or of images from many sides"))
        self.file.clicked.connect(self._ask_file)
        self.set_folder.clicked.connect(self._ask_folder)
        line = QHBoxLayout()
        for widget in (self.source, self.file, self.set_folder):
            line.addWidget(widget, int(widget is self.source))
        self.name = QLineEdit()
        self.name.setToolTip(self.tr("Name of the sample in the library"))
        self.side = QSpinBox()
        self.side.setRange(SMALLEST, LARGEST)
        self.side.setValue(ImportKnobs.size)
        self.side.setSuffix(self.tr(" texels"))
        self.side.setToolTip(self.tr("Longer edge; twice as many take four times as long"))
        self.relief, self.automatic = QDoubleSpinBox(), QCheckBox(self.tr("from the &maps"))
        self.relief.setRange(0.0, 500.0)
        self.relief.setSuffix(self.tr(" texels"))
        self.relief.setValue(5.0)
        self.relief.setEnabled(False)
        self.relief.setToolTip(self.tr("How deep the relief is, from black to white"))
        self.automatic.setChecked(True)
        self.automatic.setToolTip(self.tr("Fit the depth to the normal map"))
        relief = QHBoxLayout()
        relief.addWidget(self.relief, 1)
        relief.addWidget(self.automatic)
        self.directions = QComboBox()
        for name, count in LAYOUTS.items():
            self.directions.addItem(self.tr("{0} × {0} ({1})").format(count, name), name)
        self.directions.setCurrentIndex(self.directions.findData(ImportKnobs.layout))
        self.directions.setToolTip(self.tr("From how many sides it is seen, and lit"))
        self.shadows, self.parallax = (
            QCheckBox(self.tr("Cast &shadows")), QCheckBox(self.tr("&Parallax")),
        )  # fmt: skip
        self.shadows.setToolTip(self.tr("The relief shadows itself"))
        self.parallax.setToolTip(self.tr("The relief shifts and hides when seen from aside"))
        for box in (self.shadows, self.parallax):
            box.setChecked(True)
        self.rank = QSpinBox()
        self.rank.setRange(1, 200)
        self.rank.setValue(ImportKnobs.rank)
        self.rank.setToolTip(self.tr("How many factors are kept: more are closer, and slower"))
        self.form = QFormLayout()
        for text, field in (
            (self.tr("&Name"), self.name), (self.tr("Si&ze"), self.side),
            (self.tr("&Depth"), relief), (self.tr("D&irections"), self.directions),
            ("", self.shadows), ("", self.parallax), (self.tr("Fac&tors"), self.rank),
        ):  # fmt: skip
            label = QLabel(text)
            label.setBuddy(field if isinstance(field, QWidget) else self.relief)
            self.form.addRow(label, field)
            if isinstance(field, QWidget):
                field.setAccessibleName((text or getattr(field, "text", str)()).replace("&", ""))
        self.relief.setAccessibleName(self.tr("Depth"))
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setAccessibleName(self.tr("Progress"))
        self.phase = named(QLabel(), "faint")
        standard = QDialogButtonBox.StandardButton
        self.buttons = QDialogButtonBox(standard.Ok | standard.Cancel)
        ok, cancel = self.buttons.button(standard.Ok), self.buttons.button(standard.Cancel)
        assert ok is not None and cancel is not None
        self.ok, self.cancel = ok, cancel
        self.ok.setText(self.tr("Import"))
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        self.taken = named(QLabel(), "warning")
        self.fields = QWidget()
        self.fields.setLayout(self.form)
        layout = QVBoxLayout(self)
        layout.addWidget(self.errors)
        layout.addLayout(line)
        layout.addWidget(self.kind)
        layout.addWidget(self.fields)
        layout.addWidget(self.taken)
        layout.addStretch()
        layout.addWidget(self.bar)
        layout.addWidget(self.phase)
        layout.addWidget(self.buttons)
        self.setMinimumWidth(520)

    def _ask_file(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, self.tr("Import a file"))
        if name:
            self.look_at(Path(name))

    def _ask_folder(self) -> None:
        name = QFileDialog.getExistingDirectory(self, self.tr("Import a folder"))
        if name:
            self.look_at(Path(name))

    def _take(self, found: Look) -> None:
        self.found = found
        self.kind.setText("\n".join([found.summary, *found.notes]))
        self.name.setText(self._free(found.path.stem))
        self._refresh()

    def _refuse(self, text: str) -> None:
        self.kind.setText("")
        self.errors.tell(text)
        self._refresh()

    def _refresh(self) -> None:
        found, busy = self.found, self.work.busy
        baked = found is not None and found.kind == "pbr"
        made = found is not None and found.kind not in AS_THEY_ARE
        self.fields.setVisible(made)
        self.fields.setDisabled(busy)
        for field in (self.side, self.directions, self.shadows, self.parallax):
            self.form.setRowVisible(field, baked)
        depth = self.form.itemAt(2, QFormLayout.ItemRole.FieldRole)
        if depth is not None and depth.layout() is not None:
            self.form.setRowVisible(2, baked)
        wrong = self._wrong_name() if made and not busy else ""
        self.taken.setText(wrong)
        self.taken.setVisible(bool(wrong))
        self.ok.setEnabled(found is not None and not wrong and not busy)
        self.bar.setVisible(busy)
        self.phase.setVisible(busy)
        for button in (self.file, self.set_folder):
            button.setDisabled(busy)
        self.cancel.setToolTip(self.tr("Stop the import") if busy else self.tr("Close"))

    def _wrong_name(self) -> str:
        """Why the name cannot be used, or ""."""
        name = self.name.text().strip()
        if not name or name[0] == "." or set(name) & set('/\\:*?"<>|') or len(name) > LONGEST:
            return self.tr("This cannot be the name of a file.")
        if self.target.exists():
            return self.tr("The library has a sample of that name already.")
        return ""

    def _free(self, name: str) -> str:
        """`name`, with a number behind it where it is taken."""
        found, number = name[:LONGEST], 2
        while (self._folder / (found + SUFFIX)).exists():
            found, number = f"{name[:LONGEST]} {number}", number + 1
        return found

    def _progressed(self, fraction: float, label: str, left: float) -> None:
        self.bar.setValue(round(1000 * fraction))
        self.phase.setText(label[:1].upper() + label[1:])

    def _done(self, path: Path, notes: tuple[str, ...]) -> None:
        self.imported.emit(path, notes)
        super().accept()
