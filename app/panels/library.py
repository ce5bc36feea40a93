"""What the sample library does beyond showing: folders, import, masks, information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from PyQt6.QtCore import QObject, QSettings, QStandardPaths, QUrl, pyqtSignal
from PyQt6.QtGui import QDesktopServices
from PyQt6.QtWidgets import QMenu, QToolButton, QWidget

from app.document import Document
from app.panels.import_dialog import ImportDialog
from app.panels.latest import Latest
from app.panels.mask_editor import MaskEditor
from app.panels.sample_info import SampleInfo
from app.panels.samples import SamplesPanel
from app.tasks import Job, Report
from btfcore.btf.sample import BtfSample
from btfcore.errors import PatinaError
from btfcore.mesh.reader import SUFFIXES as MESHES
from btfcore.progress import Progress
from btfcore.types import F4

FOLDERS = "samples/folders"  # key of the store
MOST_FOLDERS = 50
IMPORTS = (".zip", ".btf", ".ptm")  # files that become a package first


class Offering(Protocol):
    """What is asked of the operations (`app.operations.Operations`)."""

    def offer(self, paths: Sequence[Path], *, choose: bool = False) -> None:
        """Put samples on offer; their thumbnails follow."""

    def offer_folder(self, folder: Path) -> None:
        """Put the samples of a folder on offer."""


@dataclass(frozen=True, eq=False)
class _Opened:
    """A sample ready to be marked."""

    sample: BtfSample
    colour: F4


class SampleLibrary(QObject):
    """Answers a panel of samples; failed(text), noted(text) are sentences for the user.

    meshes_dropped(paths) : files dropped on the panel that are meshes.
    """

    meshes_dropped = pyqtSignal(object)
    failed = pyqtSignal(str)
    noted = pyqtSignal(str)

    def __init__(
        self,
        document: Document,
        operations: Offering,
        panel: SamplesPanel,
        store: QSettings,
        *,
        own: Path | None = None,
    ) -> None:
        """`store` remembers the folders; `own` : where imports are written (None: the user's)."""
        super().__init__(panel)
        self._document, self._operations, self._panel = document, operations, panel
        self._store = store
        self.own = own if own is not None else _own_folder()
        self.worker = Latest(self)
        self.worker.failed.connect(self.failed)
        self._seen: dict[Path, int] = {}  # when a file on offer was last changed
        self.dialog: QWidget | None = None  # the last one opened
        panel.dropped.connect(self.take)
        panel.import_wanted.connect(lambda: self.import_())
        panel.refresh_wanted.connect(self.refresh)
        panel.remove_wanted.connect(self.remove)
        panel.mark_wanted.connect(self.mark)
        panel.info_wanted.connect(self.inform)
        panel.reveal_wanted.connect(reveal)
        self._folder_menu = QMenu(panel)
        self._folder_menu.aboutToShow.connect(self._fill_folder_menu)
        button = panel.buttons["list"]
        button.setMenu(self._folder_menu)
        button.setPopupMode(QToolButton.ToolButtonPopupMode.MenuButtonPopup)
        document.samples_changed.connect(self._look)

    # --- folders

    @property
    def folders(self) -> list[Path]:
        """Folders that are shown at every start."""
        stored = self._store.value(FOLDERS)
        names = [stored] if isinstance(stored, str) else stored if isinstance(stored, list) else []
        return [Path(str(name)) for name in names[:MOST_FOLDERS]]

    def restore(self) -> None:
        """Show the remembered folders and what was imported; call it once, at the start."""
        for folder in self.folders:
            if folder.is_dir():
                self._operations.offer_folder(folder)
            else:
                self.noted.emit(self.tr("The folder of samples {0} is gone.").format(folder))
        self._operations.offer(self._imported())

    def add_folder(self, folder: Path) -> None:
        """Show the samples of a folder, now and at every start."""
        folder = folder.absolute()
        known = [each for each in self.folders if each != folder]
        self._keep([*known, folder][-MOST_FOLDERS:])
        self._operations.offer_folder(folder)

    def forget_folder(self, folder: Path) -> None:
        """Show a folder no more; its samples leave the library, the files stay."""
        self._keep([each for each in self.folders if each != folder])
        samples = self._document.samples
        self._withdraw([each.path for each in samples if each.path.parent == folder])

    def _fill_folder_menu(self) -> None:
        menu = self._folder_menu
        menu.clear()
        menu.addAction(self.tr("Add folder…"), self._panel.folder_wanted.emit)
        menu.addSeparator()
        for folder in self.folders:
            menu.addAction(
                self.tr("Forget {0}").format(str(folder).replace("&", "&&")),
                lambda at=folder: self.forget_folder(at),
            )

    def refresh(self) -> None:
        """Look into the folders again: new files come, lost ones go, changed ones are reread."""
        gone, changed = [], []
        for entry in self._document.samples:
            now = _changed_at(entry.path)
            if now is None:
                gone.append(entry.path)
            elif entry.error or now != self._seen.get(entry.path, now):
                changed.append(entry.path)
        chosen, options = self._document.sample_path, self._document.options
        self._withdraw([*gone, *changed])
        if changed:  # what was chosen stays so
            self._operations.offer(changed)
            if chosen in changed:
                self._document.choose_sample(chosen)
            if options.sample in changed:
                self._document.set_options(sample=options.sample)
        for folder in self.folders:
            if folder.is_dir():
                self._operations.offer_folder(folder)
        self._operations.offer(self._imported())

    def remove(self, paths: Sequence[Path]) -> None:
        """Take samples off the library; files stay where they are."""
        self._withdraw(list(paths))

    # --- what comes in

    def take(self, paths: Sequence[Path]) -> None:
        """Take files and folders that were dropped: samples at once, others by the dialog."""
        from btfcore.btf.image import SUFFIXES
        from btfcore.files.package.write import SUFFIX

        plain = [path for path in paths if path.suffix.lower() in (*SUFFIXES, SUFFIX)]
        plain = [path for path in plain if path.is_file()]
        others = [path for path in paths if path not in plain]
        if plain:
            self._operations.offer(plain, choose=len(plain) == 1)
        foreign = [path for path in others if path.suffix.lower() in IMPORTS and path.is_file()]
        folders = [path for path in others if path.is_dir()]
        if folders:
            self.worker.ask("look", _kinds_of(folders), self._take_folders)
        meshes = [path for path in others if path.suffix.lower() in MESHES and path.is_file()]
        if meshes:
            self.meshes_dropped.emit(meshes)
        for path in others:
            if path not in foreign and path not in folders and path not in meshes:
                self.failed.emit(self.tr("{0} is no sample that Patina reads.").format(path.name))
        if foreign:
            self.import_(foreign[0])
        if len(foreign) > 1:
            text = self.tr("{0} files need the import dialog; the first is shown.")
            self.noted.emit(text.format(len(foreign)))

    def import_(self, source: Path | None = None) -> ImportDialog:
        """Open the dialog that brings in what needs baking or factorising."""
        dialog = ImportDialog(self.own, source, self._panel)
        dialog.imported.connect(self._imported_one)
        self._open(dialog)
        return dialog

    # --- about one sample

    def mark(self, path: Path) -> None:
        """Open the editor of a sample's mask; what is drawn becomes the document's."""
        self.worker.ask("mark", _opening(path), lambda opened: self._edit(path, opened))

    def inform(self, path: Path) -> None:
        """Show all that is known about a sample."""
        self.worker.ask(
            "inform", _describing(path), lambda found: self._open(SampleInfo(found, self._panel))
        )

    def close(self) -> None:
        """Stop what runs in the background, the panel's moving light too."""
        self.worker.close()
        self._panel.light.close()
        if isinstance(self.dialog, ImportDialog):
            self.dialog.done(0)

    # --- inside

    def _edit(self, path: Path, opened: _Opened) -> None:
        sample = opened.sample
        mask = self._document.masks.get(path, sample.mask)
        editor = MaskEditor(
            sample.name, opened.colour, mask, tiles=sample.tiles,
            btf=None if sample.is_image else sample, folder=path.parent, parent=self._panel,
        )  # fmt: skip
        editor.accepted.connect(lambda: self._document.set_mask(path, editor.drawn_mask()))
        self._open(editor)

    def _open(self, dialog: Any) -> None:
        self.dialog = dialog
        dialog.finished.connect(lambda result: dialog.deleteLater())
        dialog.destroyed.connect(lambda: self._forget(dialog))
        dialog.open()

    def _forget(self, dialog: QWidget) -> None:
        if self.dialog is dialog:
            self.dialog = None

    def _take_folders(self, found: list[tuple[Path, str]]) -> None:
        foreign = [folder for folder, kind in found if kind]
        for folder in [folder for folder, kind in found if not kind]:
            self.add_folder(folder)
        if foreign:
            self.import_(foreign[0])

    def _imported_one(self, path: Path, notes: tuple[str, ...]) -> None:
        self._operations.offer([path], choose=True)
        for note in notes:
            self.noted.emit(f"{path.name}: {note}")

    def _imported(self) -> list[Path]:
        return sorted(self.own.glob("*.btfz")) if self.own.is_dir() else []

    def _withdraw(self, paths: Sequence[Path]) -> None:
        gone = set(paths)
        if not gone:
            return
        document = self._document
        if document.sample_path in gone:
            document.choose_sample(None)
        if document.options.sample in gone:
            document.set_options(sample=None)
        for path in gone:
            self._seen.pop(path, None)
            self._panel.light.forget(path)
        document.samples = tuple(each for each in document.samples if each.path not in gone)
        document.samples_changed.emit()

    def _keep(self, folders: Sequence[Path]) -> None:
        self._store.setValue(FOLDERS, [str(each) for each in folders])

    def _look(self) -> None:
        for entry in self._document.samples:
            if entry.path not in self._seen:
                self._seen[entry.path] = _changed_at(entry.path) or 0


def reveal(path: Path) -> None:
    """Show the folder of a file in the desktop's own way."""
    QDesktopServices.openUrl(QUrl.fromLocalFile(str(path.parent)))


def _own_folder() -> Path:
    place = QStandardPaths.StandardLocation.GenericDataLocation
    return Path(QStandardPaths.writableLocation(place)) / "Patina" / "samples"


def _changed_at(path: Path) -> int | None:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def _kinds_of(folders: Sequence[Path]) -> Job:
    """A job: each folder, and its kind where it is one sample of many images, else ""."""

    def job(progress: Progress, report: Report) -> list[tuple[Path, str]]:
        from btfcore.files.samples import kind_of

        found = []
        for number, folder in enumerate(folders):
            progress(number / len(folders), "looking into folders")
            try:
                kind = kind_of(folder)
            except PatinaError:  # several samples, or none: the offer says so
                kind = ""
            found.append((folder, "" if kind in ("image", "package") else kind))
        return found

    return job


def _opening(path: Path) -> Job:
    def job(progress: Progress, report: Report) -> _Opened:
        from btfcore.btf.appearance import frontal_colours
        from btfcore.files.samples import open_sample

        sample = open_sample(path, progress=progress)
        return _Opened(sample, frontal_colours(sample))

    return job


def _describing(path: Path) -> Job:
    def job(progress: Progress, report: Report) -> dict[str, Any]:
        from btfcore.files.samples import kind_of, open_sample
        from btfcore.samples import description

        sample = open_sample(path, progress=progress)
        return {"kind": kind_of(path), "file": str(path), **description(sample)}

    return job
