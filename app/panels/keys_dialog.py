"""The editor of the keys: all commands, a search, and a field that takes a key."""

from __future__ import annotations

from collections.abc import Collection

from PyQt6.QtCore import QCoreApplication, QSignalBlocker, QSize, Qt
from PyQt6.QtGui import QIcon
from PyQt6.QtWidgets import (
    QApplication,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLineEdit,
    QPushButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.key_sheet import TITLES, cheat_sheet
from app.key_table import COMMANDS, GROUPS, KEY_PRESETS
from app.keys import Keymap, KeyTaken, name
from app.panels.key_field import KeyField
from app.panels.question import ask
from app.theme import named
from btfcore.errors import InvalidParameter

COMMAND = Qt.ItemDataRole.UserRole


class KeysDialog(QDialog):
    """Shows a `Keymap` and asks it to change."""

    def __init__(
        self,
        keymap: Keymap,
        *,
        navigation: str = "patina",
        only: Collection[str] | None = None,
        parent: QWidget | None = None,
    ) -> None:
        """Show `keymap`.

        navigation : preset of the drags for the copied sheet. only : ids of the commands that
        are listed, None for all.
        """
        super().__init__(parent)
        self._keymap, self._navigation = keymap, navigation
        self._wanted = ""  # a key that another command has
        self.setWindowTitle(self.tr("Keyboard shortcuts"))
        self.search = QLineEdit()
        self.search.setPlaceholderText(self.tr("Search by name or key"))
        self.search.setClearButtonEnabled(True)
        self.search.setToolTip(self.tr("Show only commands whose name or key holds this"))
        self.search.setAccessibleName(self.tr("Search the commands"))
        self.preset = QComboBox()
        for each in KEY_PRESETS:
            self.preset.addItem(TITLES[each], each)
        self.preset.setToolTip(self.tr("Keys like those of another program; your changes stay"))
        self.preset.setAccessibleName(self.tr("Preset"))
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels([self.tr("Command"), self.tr("Keys")])
        self.tree.setRootIsDecorated(False)
        self.tree.setUniformRowHeights(True)
        self.tree.setToolTip(self.tr("Double-click a command to add a key"))
        self.tree.setAccessibleName(self.tr("Commands"))
        header = self.tree.header()
        assert header is not None
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        header.setStretchLastSection(False)
        self.items: dict[str, QTreeWidgetItem] = {}
        self._list(only)
        self.field = KeyField()
        self.clear = self._button(self.tr("No key"), self.tr("Take all keys from this command"))
        self.reset = self._button(
            self.tr("Reset"), self.tr("Give this command the keys of the preset")
        )
        self.told = named(QLabel(), "hint")
        self.told.setWordWrap(True)
        self.take = self._button(
            self.tr("Take it"), self.tr("Give the key to this command and take it from the other")
        )
        self._arrange()
        self.search.textChanged.connect(self._filter)
        self.preset.activated.connect(lambda: keymap.set_preset(self.preset.currentData()))
        self.tree.currentItemChanged.connect(lambda: self._refresh())
        self.tree.itemActivated.connect(self._listen)
        self.field.captured.connect(self._add)
        self.clear.clicked.connect(lambda: keymap.assign(self.command, ()))
        self.reset.clicked.connect(lambda: keymap.reset(self.command))
        self.take.clicked.connect(self._take)
        keymap.changed.connect(self._refresh)
        self.tree.setCurrentItem(next(iter(self.items.values()), None))
        self._refresh()
        self.tell("\n".join(keymap.notes))
        self.resize(640, 620)

    @property
    def command(self) -> str:
        """Id of the marked command, or ""."""
        item = self.tree.currentItem()
        return str(item.data(0, COMMAND) or "") if item is not None else ""

    def mark(self, command: str) -> None:
        """Mark a command."""
        self.tree.setCurrentItem(self.items[command])

    def tell(self, text: str) -> None:
        """Say something below the list, or nothing."""
        self.told.setText(text)

    # --- making

    def _list(self, only: Collection[str] | None) -> None:
        for group, title in GROUPS.items():
            head = QTreeWidgetItem([QCoreApplication.translate("Keys", title)])
            font = head.font(0)
            font.setBold(True)
            head.setFont(0, font)
            head.setSizeHint(0, QSize(0, self.fontMetrics().height() + 8))
            head.setFlags(Qt.ItemFlag.ItemIsEnabled)
            for each in COMMANDS:
                if each.group == group and (only is None or each.id in only):
                    item = QTreeWidgetItem(head, [name(each.id), ""])
                    item.setData(0, COMMAND, each.id)
                    item.setSizeHint(0, QSize(0, self.fontMetrics().height() + 8))
                    self.items[each.id] = item
            if head.childCount():
                self.tree.addTopLevelItem(head)
                head.setExpanded(True)

    def _button(self, text: str, tip: str) -> QPushButton:
        button = QPushButton(text)
        button.setAutoDefault(False)
        button.setToolTip(tip)
        return button

    def _arrange(self) -> None:
        top = QHBoxLayout()
        top.addWidget(self.search, 1)
        label = QLabel(self.tr("Preset"))
        label.setBuddy(self.preset)
        top.addWidget(label)
        top.addWidget(self.preset)
        middle = QHBoxLayout()
        middle.addWidget(self.field, 1)
        middle.addWidget(self.clear)
        middle.addWidget(self.reset)
        line = QHBoxLayout()
        line.addWidget(self.told, 1)
        line.addWidget(self.take)
        box = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        close = box.button(QDialogButtonBox.StandardButton.Close)
        assert close is not None
        close.setAutoDefault(False)  # Return ends a field, not the dialog
        close.setIcon(QIcon())  # of the style, black on dark
        close.setToolTip(self.tr("Close; everything is stored already"))
        self.reset_all = self._button(
            self.tr("Reset all"), self.tr("Forget all your changes to this preset")
        )
        self.copy = self._button(
            self.tr("Copy as a sheet"), self.tr("Copy all keys as a Markdown table")
        )
        box.addButton(self.reset_all, QDialogButtonBox.ButtonRole.ResetRole)
        box.addButton(self.copy, QDialogButtonBox.ButtonRole.ActionRole)
        self.reset_all.clicked.connect(self._ask_reset)
        self.copy.clicked.connect(self._copy)
        box.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addLayout(top)
        layout.addWidget(self.tree, 1)
        layout.addLayout(middle)
        layout.addLayout(line)
        layout.addWidget(box)

    # --- doing

    def _listen(self) -> None:
        if self.command:
            self.field.listen()

    def _add(self, key: str) -> None:
        """Give the marked command one more key, if no other has it."""
        command = self.command
        try:
            self._keymap.assign(command, (*self._keymap.keys(command), key))
        except KeyTaken as error:
            self.tell(str(error))
            self._offer(key)
        except InvalidParameter as error:
            self.tell(str(error))

    def _take(self) -> None:
        keys = (*self._keymap.keys(self.command), self._wanted)
        try:
            self._keymap.assign(self.command, keys, take=True)
        except InvalidParameter as error:
            self.tell(str(error))

    def _offer(self, key: str) -> None:
        self._wanted = key
        self.take.setVisible(bool(key))

    def _ask_reset(self) -> None:
        text = self.tr("All your changes to the keys of the preset {0} will be forgotten.").format(
            TITLES[self._keymap.preset]
        )
        ask(self, self.tr("Reset all keys?"), text, self._keymap.reset_all)

    def _copy(self) -> None:
        clipboard = QApplication.clipboard()
        assert clipboard is not None
        clipboard.setText(cheat_sheet(self._keymap, self._navigation))

    def _filter(self, text: str) -> None:
        words = text.casefold().split()
        for command, item in self.items.items():
            said = f"{name(command)} {self._keymap.shown(command)}".casefold()
            item.setHidden(not all(word in said for word in words))
        for number in range(self.tree.topLevelItemCount()):
            head = self.tree.topLevelItem(number)
            assert head is not None
            children = [head.child(i) for i in range(head.childCount())]
            head.setHidden(all(each is None or each.isHidden() for each in children))
        current = self.tree.currentItem()
        if current is None or current.isHidden():  # no key for what is not seen
            seen = (item for item in self.items.values() if not item.isHidden())
            self.tree.setCurrentItem(next(seen, None))

    def _refresh(self) -> None:
        keymap = self._keymap
        with QSignalBlocker(self.preset):
            self.preset.setCurrentIndex(self.preset.findData(keymap.preset))
        changed = False
        for command, item in self.items.items():
            item.setText(1, keymap.shown(command))
            mine = keymap.is_changed(command)
            changed |= mine
            font = item.font(1)
            font.setBold(mine)
            item.setFont(1, font)
            item.setToolTip(1, self.tr("You changed this one") if mine else "")
        self.tell("")
        self._offer("")
        command = self.command
        self.field.setEnabled(bool(command))
        self.field.set_rest(
            self.tr("Add a key to “{0}”…").format(name(command))
            if command
            else self.tr("No command is marked")
        )
        self.clear.setEnabled(bool(command and keymap.keys(command)))
        self.reset.setEnabled(bool(command and keymap.is_changed(command)))
        self.reset_all.setEnabled(changed)
        self._filter(self.search.text())
