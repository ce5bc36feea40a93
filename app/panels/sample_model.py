"""The samples on offer as rows, and the two groups in which they are shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PyQt6.QtCore import QAbstractListModel, QModelIndex, QObject, QSortFilterProxyModel, Qt
from PyQt6.QtGui import QPixmap

from app.document import Document, SampleEntry
from app.panels.pictures import pixmap, readable

PATH, STATE, FEATURE, ERROR = (Qt.ItemDataRole.UserRole + 1 + at for at in range(4))
LOADING, READY, BROKEN = range(3)
Role = Qt.ItemDataRole


class SampleModel(QAbstractListModel):
    """Shows `document.samples`; pictures are made when they are first drawn."""

    def __init__(self, document: Document, parent: QObject | None = None) -> None:
        """Follow the samples of `document`."""
        super().__init__(parent)
        self._document = document
        self._rows: list[SampleEntry] = []
        self._marked: list[bool] = []
        self._pictures: dict[Path, tuple[SampleEntry, QPixmap]] = {}
        document.samples_changed.connect(self._follow)
        self._follow()

    def row_of(self, path: Path | None) -> int:
        """Row of a file, -1 where it is not on offer."""
        return next((row for row, each in enumerate(self._rows) if each.path == path), -1)

    def rowCount(self, parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008, N802
        """How many samples there are."""
        return 0 if parent.isValid() else len(self._rows)

    def data(self, index: QModelIndex, role: int = Role.DisplayRole) -> Any:
        """One property of a sample."""
        if not index.isValid():
            return None
        entry = self._rows[index.row()]
        if role == Role.DisplayRole:
            return readable(entry.path)
        if role == PATH:
            return str(entry.path)
        if role == STATE:
            return BROKEN if entry.error else LOADING if entry.thumbnail is None else READY
        if role == FEATURE:
            return self._marked[index.row()]
        if role == ERROR:
            return entry.error
        if role == Role.DecorationRole:
            return self._picture(entry)
        if role == Role.ToolTipRole:
            if entry.error:
                return self.tr("{0}\nCannot be used: {1}").format(entry.path, entry.error)
            return f"{readable(entry.path)}\n{entry.path}"
        if role == Role.AccessibleTextRole:
            words = [readable(entry.path), entry.error]
            words.append("" if entry.error or entry.thumbnail is not None else self.tr("loading"))
            return ", ".join(each for each in words if each)
        return None

    def flags(self, index: QModelIndex) -> Qt.ItemFlag:
        """A broken file can be selected, to be looked at or removed, and is never chosen."""
        plain = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        return plain | Qt.ItemFlag.ItemNeverHasChildren

    def _picture(self, entry: SampleEntry) -> QPixmap | None:
        if entry.thumbnail is None:
            return None
        known = self._pictures.get(entry.path)
        if known is None or known[0] is not entry:
            known = (entry, pixmap(entry.thumbnail))
            self._pictures[entry.path] = known
        return known[1]

    def _follow(self) -> None:
        fresh = self._document.samples
        paths = {entry.path: entry for entry in fresh}
        for row in reversed(range(len(self._rows))):
            if self._rows[row].path not in paths:
                self.beginRemoveRows(QModelIndex(), row, row)
                self._pictures.pop(self._rows[row].path, None)
                del self._rows[row], self._marked[row]
                self.endRemoveRows()
        old = len(self._rows)
        known = {entry.path for entry in self._rows}
        changed = []
        for row, entry in enumerate(self._rows):
            now = paths[entry.path]
            marked = self._is_marked(now)
            if now is not entry or marked != self._marked[row]:
                self._rows[row], self._marked[row] = now, marked
                changed.append(row)
        if changed:
            self.dataChanged.emit(self.index(changed[0]), self.index(changed[-1]))
        new = [entry for entry in fresh if entry.path not in known]
        if new:
            self.beginInsertRows(QModelIndex(), old, old + len(new) - 1)
            self._rows += new
            self._marked += [self._is_marked(entry) for entry in new]
            self.endInsertRows()

    def _is_marked(self, entry: SampleEntry) -> bool:
        return entry.feature or entry.path in self._document.masks


class SampleGroup(QSortFilterProxyModel):
    """Those with a marked feature, or those without, whose names hold all words looked for."""

    def __init__(self, source: SampleModel, *, features: bool, parent: QObject) -> None:
        """`features` : show imperfections, else backgrounds."""
        super().__init__(parent)
        self._features = features
        self._words: list[str] = []
        self.setSourceModel(source)

    def search(self, text: str) -> None:
        """Show only what has these words, in whatever order, in its name or its folder's."""
        words = text.casefold().split()
        if words != self._words:
            self._words = words
            self.invalidateFilter()

    def row_of(self, path: Path | None) -> int:
        """Row of a file in this group, -1 where it is not shown."""
        source = self.sourceModel()
        assert isinstance(source, SampleModel)
        return self.mapFromSource(source.index(source.row_of(path))).row()

    def filterAcceptsRow(self, row: int, parent: QModelIndex) -> bool:  # noqa: N802
        """Whether a sample belongs here."""
        source = self.sourceModel()
        assert source is not None
        index = source.index(row, 0)
        if bool(index.data(FEATURE)) != self._features:
            return False
        path = Path(index.data(PATH))
        text = f"{path.parent.name} {path.name} {index.data()}".casefold()
        return all(word in text for word in self._words)
