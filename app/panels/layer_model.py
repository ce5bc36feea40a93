"""The edits of a painting as rows, the top of the stack first."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any, Protocol

from PyQt6.QtCore import QAbstractListModel, QMimeData, QModelIndex, QObject, Qt

from app.document import Document
from app.layer_views import LayerView

UID, KIND, SAMPLE, BUSY = (Qt.ItemDataRole.UserRole + 1 + at for at in range(4))
MIME = "application/x-patina-layers"

Role = Qt.ItemDataRole
Flag = Qt.ItemFlag


class LayerVerbs(Protocol):
    """What the panels of layers and history ask of the edits; False: refused."""

    def show_layer(self, uid: int, visible: bool) -> bool:
        """Show or hide a layer."""

    def remove_layer(self, uid: int) -> bool:
        """Take a layer away."""

    def duplicate_layer(self, uid: int) -> bool:
        """Make a layer once more, right above itself."""

    def move_layer(self, uid: int, place: int) -> bool:
        """Put a layer at a place of the stack, 0 being the bottom."""

    def rename_layer(self, uid: int, name: str) -> bool:
        """Give a layer another name."""

    def change_layer(self, uid: int, **knobs: Any) -> bool:
        """Set knobs of a layer's edit."""

    def undo_to(self, step: int) -> bool:
        """Undo or redo until `step` steps of the history are done."""


class LayerModel(QAbstractListModel):
    """Shows the layers of a document; what is edited here is asked of `verbs`.

    Rows that stay keep their selection and their open editor when others come and go.
    """

    def __init__(
        self, document: Document, verbs: LayerVerbs, parent: QObject | None = None
    ) -> None:
        """Follow the layers of `document`."""
        super().__init__(parent)
        self._document, self._verbs = document, verbs
        self._rows: list[LayerView] = list(reversed(document.layers))
        document.layers_changed.connect(self._follow)

    def row_of(self, uid: int | None) -> int:
        """Row of a layer, -1 where there is none."""
        return next((row for row, each in enumerate(self._rows) if each.uid == uid), -1)

    def layer(self, index: QModelIndex) -> LayerView | None:
        """The layer of a row."""
        return self._rows[index.row()] if index.isValid() else None

    # --- what Qt asks for

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008, N802
        """How many layers there are."""
        return 0 if parent.isValid() else len(self._rows)

    def data(self, index: QModelIndex, role: int = Role.DisplayRole) -> Any:
        """One property of a layer."""
        if not index.isValid():
            return None
        layer = self._rows[index.row()]
        found: dict[int, Any] = {UID: layer.uid, KIND: layer.kind, SAMPLE: layer.sample}
        if role in found:
            return found[role]
        if role == BUSY:
            return layer.busy
        if role in (Role.DisplayRole, Role.EditRole):
            return layer.name or self.kind_name(layer.kind)
        if role == Role.CheckStateRole:
            return Qt.CheckState.Checked if layer.visible else Qt.CheckState.Unchecked
        if role == Role.ToolTipRole:
            return self._tip(layer)
        if role == Role.AccessibleTextRole:
            states = [layer.name or self.kind_name(layer.kind), layer.sample]
            states.append("" if layer.visible else self.tr("hidden"))
            states.append(self.tr("being computed") if layer.busy else "")
            return ", ".join(each for each in states if each)
        return None

    def setData(  # noqa: N802
        self, index: QModelIndex, value: Any, role: int = Role.EditRole
    ) -> bool:
        """Ask for another name or visibility."""
        layer = self.layer(index)
        if layer is None or layer.busy:
            return False
        if role == Role.EditRole:
            name = str(value).strip()
            return bool(name) and name != layer.name and self._verbs.rename_layer(layer.uid, name)
        if role == Role.CheckStateRole:
            shown = Qt.CheckState(value) == Qt.CheckState.Checked
            return shown != layer.visible and self._verbs.show_layer(layer.uid, shown)
        return False

    def flags(self, index: QModelIndex) -> Flag:
        """A layer that is waited for can only be selected."""
        if not index.isValid():
            return Flag.ItemIsDropEnabled  # between rows, not onto them
        plain = Flag.ItemIsEnabled | Flag.ItemIsSelectable | Flag.ItemNeverHasChildren
        if self._rows[index.row()].busy:
            return plain
        return plain | Flag.ItemIsEditable | Flag.ItemIsDragEnabled | Flag.ItemIsUserCheckable

    # --- dragging

    def supportedDropActions(self) -> Qt.DropAction:  # noqa: N802
        """Layers are moved."""
        return Qt.DropAction.MoveAction

    def mimeTypes(self) -> list[str]:  # noqa: N802
        """Only layers of this very document are taken."""
        return [MIME]

    def mimeData(self, indexes: Any) -> QMimeData:  # noqa: N802
        """Which layers are dragged, and of which document."""
        uids = [str(self._rows[index.row()].uid) for index in indexes]
        data = QMimeData()
        data.setData(MIME, " ".join([str(id(self._document)), *uids]).encode())
        return data

    def canDropMimeData(  # noqa: N802
        self, data: QMimeData | None, action: Any, row: int, column: int, parent: QModelIndex
    ) -> bool:
        """Refuse layers of another window."""
        return bool(self._dragged(data))

    def dropMimeData(  # noqa: N802
        self, data: QMimeData | None, action: Any, row: int, column: int, parent: QModelIndex
    ) -> bool:
        """Ask for another order; the rows follow when the document has it."""
        if row < 0:
            row = parent.row() if parent.isValid() else len(self._rows)
        self.move(self._dragged(data), row)
        return False  # else the view takes the dragged rows away

    def move(self, uids: Sequence[int], row: int) -> None:
        """Put layers right above what stands in `row` now, keeping their order."""
        order = [each.uid for each in reversed(self._rows) if each.uid >= 0]
        moved = [uid for uid in order if uid in set(uids)]
        above = [each.uid for each in self._rows[:row] if each.uid >= 0]
        kept = [uid for uid in order if uid not in set(moved)]
        at = len(kept) - sum(uid not in set(moved) for uid in above)
        wanted = [*kept[:at], *moved, *kept[at:]]
        for uid in moved:  # from the bottom: each right above the one that shall be below it
            below = wanted.index(uid) - 1
            was, now = order, [each for each in order if each != uid]
            place = now.index(wanted[below]) + 1 if below >= 0 else 0
            order = [*now[:place], uid, *now[place:]]
            if order != was and not self._verbs.move_layer(uid, place):
                return

    def _dragged(self, data: QMimeData | None) -> list[int]:
        text = bytes(data.data(MIME).data()).decode("ascii", "replace") if data else ""
        document, *uids = text.split() or [""]
        if document != str(id(self._document)):
            return []
        return [int(uid) for uid in uids if uid.lstrip("-").isdigit()]

    # --- following the document

    def _follow(self) -> None:
        fresh = list(reversed(self._document.layers))
        wanted = {each.uid for each in fresh}
        gone = [row for row, each in enumerate(self._rows) if each.uid not in wanted]
        for low, high in reversed(_runs(gone)):
            self.beginRemoveRows(QModelIndex(), low, high)
            del self._rows[low : high + 1]
            self.endRemoveRows()
        known = {each.uid for each in self._rows}
        self._reorder([each for each in fresh if each.uid in known])
        new = [row for row, each in enumerate(fresh) if each.uid not in known]
        for low, high in _runs(new):
            self.beginInsertRows(QModelIndex(), low, high)
            self._rows[low:low] = fresh[low : high + 1]
            self.endInsertRows()
        self._rows = fresh
        if fresh:
            self.dataChanged.emit(self.index(0), self.index(len(fresh) - 1))

    def _reorder(self, rows: list[LayerView]) -> None:
        before = [each.uid for each in self._rows]
        if before == [each.uid for each in rows]:
            return
        self.layoutAboutToBeChanged.emit()
        old = self.persistentIndexList()
        place = {each.uid: row for row, each in enumerate(rows)}
        self._rows = rows
        self.changePersistentIndexList(
            old, [self.index(place[before[index.row()]]) for index in old]
        )
        self.layoutChanged.emit()

    # --- words

    def kind_name(self, kind: str) -> str:
        """A kind of edit in words."""
        names = {
            "paint": self.tr("Paint"), "stamp": self.tr("Stamp"), "erase": self.tr("Erase"),
            "repair": self.tr("Repair"), "requilt": self.tr("Requilt"),
        }  # fmt: skip
        return names.get(kind, kind)

    def _tip(self, layer: LayerView) -> str:
        lines = [layer.name or self.kind_name(layer.kind)]
        if layer.sample:
            lines.append(self.tr("{0} with {1}").format(self.kind_name(layer.kind), layer.sample))
        if layer.busy:
            lines.append(self.tr("Being computed, or waiting for it"))
        elif layer.vertices is not None:
            lines.append(self.tr("{0} points written").format(f"{len(layer.vertices):,}"))
        return "\n".join([*lines, *layer.notes])


def _runs(rows: list[int]) -> list[tuple[int, int]]:
    """First and last of each run of rising numbers."""
    found = []
    for _, group in groupby(enumerate(rows), lambda pair: pair[1] - pair[0]):
        run = [row for _, row in group]
        found.append((run[0], run[-1]))
    return found
