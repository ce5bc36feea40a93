"""The edits of the painting: seen, ordered, named, taken away, and made with other settings."""

from __future__ import annotations

from collections.abc import Callable

from PyQt6.QtCore import (
    QEvent,
    QItemSelectionModel,
    QKeyCombination,
    QModelIndex,
    QPoint,
    QSize,
    Qt,
    QTimer,
)
from PyQt6.QtGui import QKeyEvent, QKeySequence, QPalette
from PyQt6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QListView,
    QMenu,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.document import Document
from app.panels.glyphs import glyph_icon
from app.panels.layer_knobs import LayerKnobs
from app.panels.layer_model import LayerModel, LayerVerbs
from app.panels.layer_tile import LayerTile, toggle
from app.settings import Settings
from app.theme import named

SPIN_MS = 120


class LayersPanel(QWidget):
    """List of layers, top first, and below it what the selected one is made with.

    The verbs `rename`, `duplicate` and `remove` act on what is selected, for menus and keys.
    """

    def __init__(
        self,
        document: Document,
        verbs: LayerVerbs,
        settings: Settings,
        parent: QWidget | None = None,
    ) -> None:
        """Show the layers of `document`; changes are asked of `verbs` (`app.edits.Edits`)."""
        super().__init__(parent)
        self._document, self._verbs = document, verbs
        self.model = LayerModel(document, verbs, self)
        self.view = named(LayersView(), "layers")
        self.tile = LayerTile(self.view)
        self.view.setItemDelegate(self.tile)
        self.view.setModel(self.model)
        self.view.setAccessibleName(self.tr("Layers"))
        self.view.setAccessibleDescription(
            self.tr("F2 renames, Ctrl+J duplicates, Del deletes, Space shows or hides")
        )
        self.view.owner = self
        self.hint = named(QLabel(self.tr("What you paint appears here, layer by layer.")), "hint")
        self.hint.setWordWrap(True)
        self.hint.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.buttons: dict[str, QToolButton] = {}
        row = QHBoxLayout()
        row.addStretch()
        for glyph, name, tip, act in (
            ("copy", self.tr("Duplicate"),
             self.tr("Make the selected layers once more (Ctrl+J)"), self.duplicate),
            ("up", self.tr("Move up"),
             self.tr("Put the layer above the next one (Alt+Up)"), lambda: self.shift(-1)),
            ("down", self.tr("Move down"),
             self.tr("Put the layer below the next one (Alt+Down)"), lambda: self.shift(1)),
            ("bin", self.tr("Delete"), self.tr("Delete the selected layers (Del)"), self.remove),
        ):  # fmt: skip
            button = QToolButton()
            button.setAutoRaise(True)
            button.setIconSize(QSize(18, 18))
            button.setToolTip(tip)
            button.setAccessibleName(name)
            button.clicked.connect(act)
            self.buttons[glyph] = button
            row.addWidget(button)
        self.knobs = LayerKnobs(document, verbs, settings)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.addWidget(self.hint)
        layout.addWidget(self.view, 1)
        layout.addLayout(row)
        layout.addWidget(self.knobs)
        self._spin = QTimer(self)
        self._spin.setInterval(SPIN_MS)
        self._spin.timeout.connect(self._turn)
        selection = self.view.selectionModel()
        assert selection is not None
        self._selection = selection
        selection.currentChanged.connect(self._picked)
        selection.selectionChanged.connect(lambda new, old: self._enable())
        self.view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.view.customContextMenuRequested.connect(self._menu)
        document.layers_changed.connect(self._refresh)
        document.selection_changed.connect(self._mark)
        self._paint_icons()
        self._refresh()
        self._mark()

    # --- verbs on what is selected

    def selected(self) -> list[int]:
        """Selected layers that are computed, the top one first."""
        rows = sorted(index.row() for index in self._selection.selectedRows())
        layers = [self.model.layer(self.model.index(row)) for row in rows]
        return [each.uid for each in layers if each is not None and not each.busy]

    def remove(self) -> None:
        """Delete the selected layers."""
        for uid in self.selected():
            if not self._verbs.remove_layer(uid):
                return

    def duplicate(self) -> None:
        """Make the selected layers once more."""
        for uid in self.selected():
            if not self._verbs.duplicate_layer(uid):
                return

    def rename(self) -> None:
        """Open the field for the name of the present layer."""
        index = self.view.currentIndex()
        if index.isValid() and self.model.flags(index) & Qt.ItemFlag.ItemIsEditable:
            self.view.edit(index)

    def shift(self, rows: int) -> None:
        """Move the selected layers down by `rows`, or up."""
        uids = self.selected()
        if not uids:
            return
        places = [self.model.row_of(uid) for uid in uids]
        target = min(places) - 1 if rows < 0 else max(places) + 2
        if 0 <= target <= self.model.rowCount():
            self.model.move(uids, target)

    def toggle(self) -> None:
        """Show or hide the selected layers."""
        for index in self._selection.selectedRows():
            toggle(self.model, index)

    # --- following

    def _picked(self, now: QModelIndex, before: QModelIndex) -> None:
        layer = self.model.layer(now)
        self._document.select(layer.uid if layer is not None else None)

    def _mark(self) -> None:
        row = self.model.row_of(self._document.selected)
        if row < 0:
            self.view.clearSelection()
            self._selection.clearCurrentIndex()
        elif self.view.currentIndex().row() != row:
            kind = QItemSelectionModel.SelectionFlag.ClearAndSelect
            self._selection.setCurrentIndex(self.model.index(row), kind)
            self.view.scrollTo(self.model.index(row))
        self._enable()

    def _refresh(self) -> None:
        empty = not self._document.layers
        self.hint.setVisible(empty)
        self.view.setVisible(not empty)
        if self._document.busy_edits:
            self._spin.start()
        else:
            self._spin.stop()
        self._enable()

    def _enable(self) -> None:
        uids = self.selected()
        rows = [self.model.row_of(uid) for uid in uids]
        first = sum(each.uid < 0 for each in self._document.layers)  # those that wait are on top
        for glyph, button in self.buttons.items():
            usable = bool(uids)
            if glyph == "up":
                usable = usable and min(rows) > first
            if glyph == "down":
                usable = usable and max(rows) < self.model.rowCount() - 1
            button.setEnabled(usable)

    def _turn(self) -> None:
        self.tile.turn = (self.tile.turn + 1) % 12
        for row, layer in enumerate(reversed(self._document.layers)):
            if layer.busy:
                self.view.update(self.model.index(row))

    def _menu(self, place: QPoint) -> None:
        if not self.view.indexAt(place).isValid():
            return
        menu = self.context_menu()
        port = self.view.viewport()
        if port is not None:
            menu.exec(port.mapToGlobal(place))
        menu.deleteLater()

    def context_menu(self) -> QMenu:
        """What can be done with the selected layers."""
        menu = QMenu(self)
        usable = bool(self.selected())
        for text, act in (
            (self.tr("Rename\tF2"), self.rename), (self.tr("Duplicate\tCtrl+J"), self.duplicate),
            (self.tr("Show or hide\tSpace"), self.toggle), (self.tr("Delete\tDel"), self.remove),
        ):  # fmt: skip
            action = menu.addAction(text, act)
            if action is not None:
                action.setEnabled(usable)
        return menu

    def changeEvent(self, event: QEvent | None) -> None:  # noqa: N802
        """Draw the icons anew in another theme."""
        super().changeEvent(event)
        if event is not None and event.type() == QEvent.Type.PaletteChange:
            self._paint_icons()

    def _paint_icons(self) -> None:
        ink = self.palette().color(QPalette.ColorRole.ButtonText)
        for glyph, button in getattr(self, "buttons", {}).items():
            button.setIcon(glyph_icon(glyph, ink))


class LayersView(QListView):
    """A list whose keys win over those of the window while it has the keyboard."""

    owner: LayersPanel

    def __init__(self, parent: QWidget | None = None) -> None:
        """Rows can be dragged to another place."""
        super().__init__(parent)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setUniformItemSizes(True)
        self.setMouseTracking(True)
        self.setDragDropMode(QAbstractItemView.DragDropMode.DragDrop)
        self.setDefaultDropAction(Qt.DropAction.MoveAction)
        self.setDragDropOverwriteMode(False)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumHeight(90)
        trigger = QAbstractItemView.EditTrigger
        self.setEditTriggers(trigger.DoubleClicked)

    def event(self, event: QEvent | None) -> bool:
        """Keep keys that mean something here from being shortcuts of the window."""
        if (
            event is not None
            and event.type() == QEvent.Type.ShortcutOverride
            and isinstance(event, QKeyEvent)
            and self._act_of(event) is not None
        ):
            event.accept()
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent | None) -> None:  # noqa: N802
        """Delete, rename, duplicate, show or hide, move."""
        act = self._act_of(event) if event is not None else None
        if act is None:
            super().keyPressEvent(event)
        else:
            act()

    def _act_of(self, event: QKeyEvent) -> Callable[[], None] | None:
        held = event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
        chord = QKeyCombination(held, Qt.Key(event.key())) if event.key() in _KEYS else None
        if chord is None:
            return None
        owner = self.owner
        acts: dict[str, Callable[[], None]] = {
            "Del": owner.remove, "Backspace": owner.remove, "F2": owner.rename,
            "Space": owner.toggle, "Ctrl+J": owner.duplicate,
            "Alt+Up": lambda: owner.shift(-1), "Alt+Down": lambda: owner.shift(1),
        }  # fmt: skip
        return acts.get(QKeySequence(chord).toString(QKeySequence.SequenceFormat.PortableText))


_KEYS = frozenset(  # other numbers need not be keys that this Qt knows
    each.value
    for each in (
        Qt.Key.Key_Delete, Qt.Key.Key_Backspace, Qt.Key.Key_F2, Qt.Key.Key_Space, Qt.Key.Key_J,
        Qt.Key.Key_Up, Qt.Key.Key_Down,
    )
)  # fmt: skip
