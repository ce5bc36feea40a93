"""An unexpected error as a sentence, with a report to copy or save; work goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PyQt6.QtCore import Qt
from PyQt6.QtGui import QFontDatabase, QGuiApplication
from PyQt6.QtWidgets import (
    QDialog,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QStyle,
    QVBoxLayout,
    QWidget,
)

from app.reports import Problem
from app.theme import named
from btfcore.errors import OutputFailed
from btfcore.files.atomic import write_bytes

SUFFIX = ".txt"


class ErrorDialog(QDialog):
    """Shows problems one after the other; a further one joins while the dialog is open."""

    def __init__(
        self,
        problem: Problem,
        parent: QWidget | None = None,
        *,
        named_job: Callable[[str], str] = str,
    ) -> None:
        """Show `problem`; open it with `open`, which blocks nothing but the window.

        named_job : what the user knows a job of `Tasks` as.
        """
        super().__init__(parent)
        self._named_job = named_job
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(self.tr("Something went wrong"))
        self.problems = [problem]
        mark = QLabel()
        style = self.style()
        assert style is not None
        warning = style.standardIcon(QStyle.StandardPixmap.SP_MessageBoxWarning)
        mark.setPixmap(warning.pixmap(40, 40))
        self.title = named(QLabel(), "title")
        self.title.setWordWrap(True)
        self.sentence = QLabel()
        self.sentence.setTextFormat(Qt.TextFormat.PlainText)  # a file's name may hold "<"
        self.sentence.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.sentence.setWordWrap(True)
        self.advice = named(
            QLabel(
                self.tr(
                    "This is a fault in Patina; you can go on working. The report helps to mend "
                    "it. It holds nothing out of your files."
                )
            ),
            "faint",
        )
        self.advice.setWordWrap(True)
        self.report = QPlainTextEdit()
        self.report.setReadOnly(True)
        self.report.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.report.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.report.setAccessibleName(self.tr("Report"))
        self.report.setToolTip(self.tr("What is copied or saved"))
        self.told = named(QLabel(), "faint")
        self.told.setWordWrap(True)
        self.told.setAccessibleName(self.tr("What was done with the report"))
        self.copy = self._button(
            self.tr("&Copy report"), self.tr("Put the whole report on the clipboard")
        )
        self.save = self._button(self.tr("&Save report…"), self.tr("Write the report to a file"))
        self.go_on = self._button(self.tr("&Go on"), self.tr("Close this and go on working"))
        self.go_on.setDefault(True)
        self.copy.clicked.connect(self._copy)
        self.save.clicked.connect(self._ask_file)
        self.go_on.clicked.connect(self.accept)
        self._arrange(mark)
        self._refresh()
        self.resize(640, 440)

    def _button(self, text: str, tip: str) -> QPushButton:
        button = QPushButton(text)
        button.setToolTip(tip)
        button.setAccessibleName(text.replace("&", "").rstrip("…"))
        button.setAutoDefault(False)
        return button

    def _arrange(self, mark: QLabel) -> None:
        words = QVBoxLayout()
        for label in (self.title, self.sentence, self.advice):
            words.addWidget(label)
        top = QHBoxLayout()
        top.setSpacing(16)
        top.addWidget(mark, 0, Qt.AlignmentFlag.AlignTop)
        top.addLayout(words, 1)
        row = QHBoxLayout()
        row.addWidget(self.copy)
        row.addWidget(self.save)
        row.addWidget(self.told, 1)
        row.addWidget(self.go_on)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(18, 16, 18, 14)
        layout.setSpacing(12)
        layout.addLayout(top)
        layout.addWidget(self.report, 1)
        layout.addLayout(row)

    def add(self, problem: Problem) -> None:
        """Show one more problem below those that are shown."""
        self.problems.append(problem)
        self.told.clear()
        self._refresh()

    @property
    def text(self) -> str:
        """The whole report."""
        return "\n\n".join(problem.report.strip() for problem in self.problems) + "\n"

    def write(self, path: Path) -> bool:
        """Save the report; whether that went well, which is also told."""
        try:
            write_bytes(path, self.text.encode())
        except OutputFailed as error:
            self.told.setText(str(error))
            return False
        self.told.setText(self.tr("Saved as {0}").format(path.name))
        return True

    def _refresh(self) -> None:
        last, count = self.problems[-1], len(self.problems)
        name = self._named_job(last.running) if last.running else ""
        if count > 1:
            self.title.setText(self.tr("{0} things went wrong").format(count))
        elif name:
            self.title.setText(self.tr("“{0}” could not be finished").format(name))
        else:
            self.title.setText(self.tr("Something went wrong"))
        sentence = last.sentence
        self.sentence.setText(sentence[:1].upper() + sentence[1:])
        self.report.setPlainText(self.text)

    def _copy(self) -> None:
        clipboard = QGuiApplication.clipboard()
        if clipboard is not None:
            clipboard.setText(self.text)
            self.told.setText(self.tr("Copied"))

    def _ask_file(self) -> None:
        name, _ = QFileDialog.getSaveFileName(
            self, self.tr("Save the report"), "patina-report.txt", self.tr("Text (*.txt)")
        )
        if name:
            self.write(Path(name) if Path(name).suffix else Path(name + SUFFIX))


class ErrorTeller:
    """Opens the dialog over a window; while it is open, further problems join it."""

    def __init__(self, parent: QWidget, *, named_job: Callable[[str], str] = str) -> None:
        """Dialogs belong to `parent`; named_job : what the user knows a job of `Tasks` as."""
        self._parent, self._named_job = parent, named_job
        self.dialog: ErrorDialog | None = None

    def tell(self, problem: Problem) -> None:
        """Slot for `app.reports.Reporter.happened`."""
        if self.dialog is not None:
            self.dialog.add(problem)
            return
        self.dialog = ErrorDialog(problem, self._parent, named_job=self._named_job)
        self.dialog.finished.connect(self._closed)
        self.dialog.open()

    def _closed(self) -> None:
        self.dialog = None
