"""The sample library: backgrounds to cover a mesh with, imperfections to paint."""

from __future__ import annotations

from pathlib import Path

from PyQt6.QtCore import QEvent, QModelIndex, QObject, QPoint, QSize, Qt, pyqtSignal
from PyQt6.QtGui import QDragEnterEvent, QDragMoveEvent, QDropEvent, QKeyEvent, QPalette
from PyQt6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListView,
    QMenu,
    QSplitter,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.document import Document
from app.panels.glyphs import glyph_icon
from app.panels.moving_light import MovingLight
from app.panels.sample_model import BROKEN, PATH, STATE, SampleGroup, SampleModel
from app.panels.sample_tile import SampleTile
from app.theme import named


class SamplesPanel(QWidget):
    """Two groups of thumbnails, a field to search in, and what can be done with a sample.

    A click on a background chooses what the next synthesis uses, on an imperfection what is
    painted with. What needs a dialog or the disk is asked for by signals: folder_wanted(),
    import_wanted(), refresh_wanted(), and dropped(paths), remove_wanted(paths),
    mark_wanted(path), info_wanted(path), reveal_wanted(path); `app.panels.library` answers.
    """

    folder_wanted = pyqtSignal()
    import_wanted = pyqtSignal()
    refresh_wanted = pyqtSignal()
    dropped = pyqtSignal(object)
    remove_wanted = pyqtSignal(object)
    mark_wanted = pyqtSignal(object)
    info_wanted = pyqtSignal(object)
    reveal_wanted = pyqtSignal(object)

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        """Show the samples of `document`."""
        super().__init__(parent)
        self._document = document
        self.setAcceptDrops(True)
        self.light = MovingLight(self)
        self.model = SampleModel(document, self)
        self.search = QLineEdit()
        self.search.setPlaceholderText(self.tr("Search"))
        self.search.setClearButtonEnabled(True)
        self.search.setToolTip(self.tr("Show only samples with these words in their name"))
        self.search.setAccessibleName(self.tr("Search samples"))
        top = QHBoxLayout()
        top.addWidget(self.search, 1)
        self.buttons: dict[str, QToolButton] = {}
        for glyph, name, tip, wanted in (
            ("plus", self.tr("Import"),
             self.tr("Bring a PBR set, a BTF or an image into the library"), self.import_wanted),
            ("list", self.tr("Folder"),
             self.tr("Show the samples of a folder, now and from now on"), self.folder_wanted),
            ("fresh", self.tr("Refresh"),
             self.tr("Look into the folders again"), self.refresh_wanted),
        ):  # fmt: skip
            button = QToolButton()
            button.setAutoRaise(True)
            button.setIconSize(QSize(18, 18))
            button.setToolTip(tip)
            button.setAccessibleName(name)
            button.clicked.connect(wanted)
            self.buttons[glyph] = button
            top.addWidget(button)
        self.backgrounds = SampleGroup(self.model, features=False, parent=self)
        self.features = SampleGroup(self.model, features=True, parent=self)
        self.view, first, self._first = self._group(self.backgrounds, self.tr("Backgrounds"), "")
        self.feature_view, second, self._second = self._group(
            self.features, self.tr("Imperfections"),
            self.tr("Samples whose feature is marked appear here.\n"
                    "Right-click a sample to mark its feature."),
        )  # fmt: skip
        self.parts = QSplitter(Qt.Orientation.Vertical)
        self.parts.addWidget(first)
        self.parts.addWidget(second)
        self.parts.setStretchFactor(0, 3)
        self.parts.setStretchFactor(1, 2)
        self.parts.setChildrenCollapsible(False)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.addLayout(top)
        layout.addWidget(self.parts, 1)
        for group in (self.backgrounds, self.features):
            self.search.textChanged.connect(group.search)
            for changed in (group.rowsInserted, group.rowsRemoved, group.modelReset):
                changed.connect(self._count)
        self.light.turned.connect(self._draw)
        document.samples_changed.connect(self._mark)
        document.sample_chosen.connect(self._mark)
        document.options_changed.connect(self._mark)
        self._paint_icons()
        self._count()
        self._mark()

    def _group(
        self, group: SampleGroup, title: str, hint: str
    ) -> tuple[QListView, QWidget, tuple[QLabel, str, QLabel]]:
        heading, empty = named(QLabel(), "heading"), named(QLabel(hint), "hint")
        empty.setWordWrap(True)
        view = named(SampleGrid(), "samples")
        view.setAccessibleName(title)
        view.setViewMode(QListView.ViewMode.IconMode)
        view.setResizeMode(QListView.ResizeMode.Adjust)
        view.setMovement(QListView.Movement.Static)
        view.setUniformItemSizes(True)
        view.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        view.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        view.setMouseTracking(True)
        view.setMinimumHeight(128)
        view.setItemDelegate(SampleTile(self.light, view))
        view.setModel(group)
        view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        view.customContextMenuRequested.connect(lambda place: self._menu(view, place))
        view.entered.connect(lambda index: self.light.hover(Path(index.data(PATH))))
        view.viewportEntered.connect(lambda: self.light.hover(None))
        port = view.viewport()
        assert port is not None
        port.installEventFilter(self)
        view.picked.connect(lambda index: self._picked(view, index))
        part = QWidget()
        column = QVBoxLayout(part)
        column.setContentsMargins(0, 4, 0, 0)
        for widget in (heading, empty):
            column.addWidget(widget)
        column.addWidget(view, 1)
        return view, part, (heading, title, empty)

    # --- what is chosen

    def _picked(self, view: QListView, index: QModelIndex) -> None:
        if not index.isValid() or index.data(STATE) == BROKEN:
            return
        path = Path(index.data(PATH))
        if view is self.view:
            self._document.choose_sample(path)
        else:
            self._document.set_options(sample=path)

    def _mark(self) -> None:
        sample = self._document.options.sample
        feature = sample if isinstance(sample, Path) else None
        for view, group, path in (
            (self.view, self.backgrounds, self._document.sample_path),
            (self.feature_view, self.features, feature),
        ):
            row = group.row_of(path)
            present = view.currentIndex()
            if row >= 0 and present.row() != row:
                view.setCurrentIndex(group.index(row, 0))
            elif row < 0 and present.isValid() and present.data(STATE) != BROKEN:
                view.clearSelection()

    def _count(self) -> None:
        for group, (heading, title, empty) in (
            (self.backgrounds, self._first), (self.features, self._second)
        ):  # fmt: skip
            count = group.rowCount()
            heading.setText(self.tr("{0} · {1}").format(title.upper(), count))
            empty.setVisible(not count and bool(empty.text()) and not self.search.text())

    # --- the pointer

    def _draw(self, path: Path) -> None:
        for view, group in ((self.view, self.backgrounds), (self.feature_view, self.features)):
            row = group.row_of(path)
            if row >= 0:
                view.update(group.index(row, 0))

    def eventFilter(self, watched: QObject | None, event: QEvent | None) -> bool:  # noqa: N802
        """Stop the light when the pointer leaves."""
        if event is not None and event.type() == QEvent.Type.Leave:
            self.light.hover(None)
        return super().eventFilter(watched, event)

    def hideEvent(self, event: object) -> None:  # noqa: N802
        """Stop the light when the panel is hidden."""
        self.light.hover(None)

    def _menu(self, view: QListView, place: QPoint) -> None:
        index, port = view.indexAt(place), view.viewport()
        if index.isValid() and port is not None:
            menu = self.context_menu(Path(index.data(PATH)))
            menu.exec(port.mapToGlobal(place))
            menu.deleteLater()

    def context_menu(self, path: Path) -> QMenu:
        """What can be done with a sample."""
        entry = next((each for each in self._document.samples if each.path == path), None)
        usable = entry is not None and not entry.error
        document, menu = self._document, QMenu(self)
        for text, act, needs in (
            (self.tr("Use as background"), lambda: document.choose_sample(path), True),
            (self.tr("Paint with it"), lambda: document.set_options(sample=path), True),
            (self.tr("Mark feature…"), lambda: self.mark_wanted.emit(path), True),
            (self.tr("Forget the mask that was drawn"),
             lambda: document.set_mask(path, None), path in document.masks),
            (None, None, False),
            (self.tr("Information…"), lambda: self.info_wanted.emit(path), False),
            (self.tr("Show in folder"), lambda: self.reveal_wanted.emit(path), False),
            (self.tr("Remove from the library"), lambda: self.remove_wanted.emit([path]), False),
        ):  # fmt: skip
            if text is None or act is None:
                menu.addSeparator()
                continue
            action = menu.addAction(text, act)
            if action is not None:
                action.setEnabled(usable if needs else True)
                if text == self.tr("Forget the mask that was drawn"):
                    action.setVisible(path in document.masks)
        return menu

    # --- files dropped from elsewhere

    def dragEnterEvent(self, event: QDragEnterEvent | None) -> None:  # noqa: N802
        """Take files and folders."""
        if event is not None and _files(event):
            event.acceptProposedAction()

    def dragMoveEvent(self, event: QDragMoveEvent | None) -> None:  # noqa: N802
        """Take them wherever they are."""
        if event is not None and _files(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent | None) -> None:  # noqa: N802
        """Hand them on."""
        if event is not None and _files(event):
            event.acceptProposedAction()
            self.dropped.emit(_files(event))

    def changeEvent(self, event: QEvent | None) -> None:  # noqa: N802
        """Draw the icons anew in another theme."""
        super().changeEvent(event)
        if event is not None and event.type() == QEvent.Type.PaletteChange:
            self._paint_icons()

    def _paint_icons(self) -> None:
        ink = self.palette().color(QPalette.ColorRole.ButtonText)
        for glyph, button in getattr(self, "buttons", {}).items():
            button.setIcon(glyph_icon(glyph, ink))


class SampleGrid(QListView):
    """Tells what the user picks, by mouse or keys; rows that come and go pick nothing."""

    picked = pyqtSignal(QModelIndex)

    def __init__(self, parent: QWidget | None = None) -> None:
        """Show nothing yet."""
        super().__init__(parent)
        self.clicked.connect(self.picked)

    def keyPressEvent(self, event: QKeyEvent | None) -> None:  # noqa: N802
        """Pick what the arrows go to, and again what Enter is pressed on."""
        before = self.currentIndex()
        super().keyPressEvent(event)
        enter = event is not None and event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter)
        if self.currentIndex() != before or enter:
            self.picked.emit(self.currentIndex())


def _files(event: QDropEvent) -> list[Path]:
    data = event.mimeData()
    urls = data.urls() if data is not None else []
    return [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
