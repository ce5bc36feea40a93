"""The settings, on pages; every change works at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PyQt6.QtCore import QLocale, QSize, Qt, pyqtSignal
from PyQt6.QtGui import QIcon
from PyQt6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.panels.question import ask
from app.panels.settings_fields import Fields
from app.settings import AT_START, Settings, Values
from app.theme import named


@dataclass(frozen=True)
class Row:
    """One line of a page: the settings that it shows and what the search looks at."""

    names: tuple[str, ...]
    label: QLabel
    field: QWidget
    words: str


class SettingsDialog(QDialog):
    """Shows `Settings` and asks them to change; keys_wanted asks for the keys' own dialog."""

    keys_wanted = pyqtSignal()

    def __init__(
        self,
        settings: Settings,
        *,
        detected: Callable[[], str],
        languages: Sequence[str] = ("en",),
        parent: QWidget | None = None,
    ) -> None:
        """Show `settings`.

        detected : what draws on this machine and why, a sentence or more, asked each time the
        dialog opens or the settings change. languages : codes of the translations that there
        are.
        """
        super().__init__(parent)
        self._settings, self._detected = settings, detected
        self.setWindowTitle(self.tr("Settings"))
        self.fields = Fields(settings, [(code, _language(code)) for code in languages], self)
        self.search = QLineEdit()
        self.search.setPlaceholderText(self.tr("Search"))
        self.search.setClearButtonEnabled(True)
        self.search.setToolTip(self.tr("Show only the settings whose names or help hold this"))
        self.search.setAccessibleName(self.tr("Search the settings"))
        self.pages, self.stack = QListWidget(), QStackedWidget()
        self.pages.setAccessibleName(self.tr("Pages of settings"))
        self.pages.setToolTip(self.tr("Pages of settings"))
        self.pages.setFixedWidth(150)
        self.rows: dict[str, Row] = {}
        self._page_rows: list[list[Row]] = []
        self.machine = named(QLabel(), "faint")
        self.machine.setWordWrap(True)
        self.machine.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._fill()
        self.nothing = named(QLabel(self.tr("No setting has these words.")), "faint")
        self.nothing.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.stack.addWidget(self.nothing)
        self._arrange()
        self.search.textChanged.connect(self._filter)
        self.pages.currentRowChanged.connect(self._turn)
        settings.changed.connect(self._refresh)
        self.pages.setCurrentRow(0)
        self._refresh()
        self.resize(720, 480)

    def _fill(self) -> None:
        fields, tr = self.fields, self.tr
        start = tr("Takes effect when Patina starts next.")
        self._page(
            tr("General"),
            (("theme",), tr("Theme"), fields.theme, tr("Light, dark, or as the system has it")),
            (("language",), tr("Language"), fields.language, tr("Language of all texts")),
            (
                ("unit",), tr("Lengths in"), fields.unit,
                tr("How lengths are shown, as in Measure"),
            ),
            (
                ("metres_per_unit",), tr("One unit of a mesh is"), fields.metres,
                tr("How long one unit of a mesh is; files do not tell"),
            ),
        )  # fmt: skip
        self._page(
            tr("Work"),
            (
                ("rate",), tr("Sampling rate"), fields.rate,
                tr("Side of the texture of a new mesh in texels"),
            ),
            (
                ("autosave_seconds",), tr("Save automatically every"), fields.autosave,
                tr("After a crash no more than this is lost"),
            ),
            (
                ("undo_megabytes",), tr("Memory for undo"), fields.undo,
                tr("When it is full the oldest steps are forgotten"),
            ),
            (
                ("threads",), tr("Threads"), fields.threads,
                tr("Processor cores that may compute at a time; results do not depend on it"),
            ),
        )  # fmt: skip
        keys = QPushButton(tr("Keyboard shortcuts…"))
        keys.setAutoDefault(False)
        keys.clicked.connect(self.keys_wanted)
        self._page(
            tr("View"),
            (
                ("navigation",), tr("Navigation"), fields.navigation,
                tr("Which drags orbit, pan and zoom"),
            ),
            (
                ("pivot",), tr("Orbit round"), fields.pivot,
                tr("What stays in its place while the view turns"),
            ),
            (("backend",), tr("Light drawn by"), fields.backend, tr("What evaluates the light")),
            ((), tr("Found"), self.machine, tr("What draws on this machine, and why")),
            ((), tr("Keys"), keys, tr("Choose and change the keyboard shortcuts")),
        )  # fmt: skip
        self._page(
            tr("Pen"),
            (("pressure",), tr("Pressure"), fields.pressure_box, tr("How hard one must press")),
        )
        for name in AT_START:
            row = self.rows[name]
            row.label.setToolTip(f"{row.label.toolTip()}\n{start}")
            row.field.setToolTip(f"{row.field.toolTip()}\n{start}")

    def _page(self, title: str, *rows: tuple[tuple[str, ...], str, QWidget, str]) -> None:
        page = QWidget()
        form = QFormLayout(page)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        form.setVerticalSpacing(12)
        form.setHorizontalSpacing(16)
        form.setContentsMargins(16, 4, 4, 4)
        kept = []
        for names, text, field, tip in rows:
            mark = " *" if AT_START & set(names) else ""
            label = QLabel(text + mark)
            label.setBuddy(field)
            label.setToolTip(tip)
            field.setToolTip(tip)
            if not isinstance(field, QLabel):
                field.setAccessibleName(text)
            form.addRow(label, field)
            row = Row(names, label, field, f"{title} {text} {tip}".casefold())
            kept.append(row)
            self.rows.update(dict.fromkeys(names, row))
        if any(AT_START & set(row.names) for row in kept):
            note = named(QLabel(self.tr("* takes effect when Patina starts next")), "faint")
            form.addRow(note)
        self._page_rows.append(kept)
        item = QListWidgetItem(title)
        item.setSizeHint(QSize(0, self.fontMetrics().height() + 12))
        self.pages.addItem(item)
        self.stack.addWidget(page)

    def _arrange(self) -> None:
        left = QVBoxLayout()
        left.addWidget(self.search)
        left.addWidget(self.pages, 1)
        self.search.setFixedWidth(150)
        middle = QHBoxLayout()
        middle.addLayout(left)
        middle.addWidget(self.stack, 1)
        box = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close = box.button(QDialogButtonBox.StandardButton.Close)
        assert close is not None
        close.setAutoDefault(False)  # Return ends a field, not the dialog
        close.setIcon(QIcon())  # of the style, black on dark
        close.setToolTip(self.tr("Close; everything is stored already"))
        self.reset_page = QPushButton(self.tr("Reset this page"))
        self.reset_page.setToolTip(self.tr("Set what this page shows as it was at first"))
        self.reset_all = QPushButton(self.tr("Reset all"))
        self.reset_all.setToolTip(self.tr("Set every setting as it was at first"))
        for button in (self.reset_page, self.reset_all):
            button.setAutoDefault(False)
            box.addButton(button, QDialogButtonBox.ButtonRole.ResetRole)
        box.rejected.connect(self.reject)
        self.reset_page.clicked.connect(self._reset_page)
        self.reset_all.clicked.connect(self._ask_reset)
        self.notes = named(QLabel("\n".join(self._settings.notes)), "hint")
        self.notes.setWordWrap(True)
        self.notes.setVisible(bool(self._settings.notes))
        layout = QVBoxLayout(self)
        layout.addWidget(self.notes)
        layout.addLayout(middle, 1)
        layout.addWidget(box)

    # --- what is seen

    def _turn(self, row: int) -> None:
        self.stack.setCurrentIndex(row if row >= 0 else self.stack.count() - 1)
        self._refresh()

    def _filter(self, text: str) -> None:
        words = text.casefold().split()
        first = -1
        for number, rows in enumerate(self._page_rows):
            shown = [all(word in row.words for word in words) for row in rows]
            for row, visible in zip(rows, shown, strict=True):
                row.label.setVisible(visible)
                row.field.setVisible(visible)
            item = self.pages.item(number)
            assert item is not None
            item.setHidden(not any(shown))
            if any(shown) and first < 0:
                first = number
        current = self.pages.currentItem()
        if current is None or current.isHidden():
            self.pages.setCurrentRow(first)

    def _reset_page(self) -> None:
        row = self.pages.currentRow()
        if row >= 0:
            self._settings.reset(name for each in self._page_rows[row] for name in each.names)

    def _ask_reset(self) -> None:
        text = self.tr("All settings will be as they were at first. Your keys stay.")
        ask(self, self.tr("Reset all settings?"), text, self._settings.reset)

    def _refresh(self) -> None:
        self.fields.refresh()
        self.machine.setText(self._detected())
        values, fresh = self._settings.values, Values()
        row = self.pages.currentRow()
        names = {name for each in self._page_rows[row] for name in each.names} if row >= 0 else ()
        self.reset_page.setEnabled(any(getattr(values, n) != getattr(fresh, n) for n in names))
        self.reset_all.setEnabled(values != fresh)


def _language(code: str) -> str:
    """Name of a language in itself."""
    found = QLocale(code).nativeLanguageName()
    return found[:1].upper() + found[1:] if found else code
