"""The main window: the view in the middle, samples and knobs beside it, messages above."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PyQt6.QtCore import QLocale, QSettings, Qt
from PyQt6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QImage, QPainter, QPixmap
from PyQt6.QtWidgets import (
    QFileDialog,
    QLabel,
    QMainWindow,
    QMessageBox,
    QSplitter,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.document import Document
from app.menus import Menus
from app.operations import SAMPLE_SUFFIXES, Operations, is_mesh, is_sample
from app.panels.knobs import KnobsPanel
from app.panels.light import LightPanel
from app.panels.messages import MessageBar
from app.panels.modes import ModesPanel
from app.panels.run import RunPanel
from app.panels.samples import SamplesPanel
from app.panels.welcome import WelcomePanel
from app.theme import named
from app.viewport import Viewport
from app.workspace import Workspace, is_project
from btfcore import __version__
from btfcore.errors import PatinaError
from btfcore.files.export import SUFFIXES as EXPORT_SUFFIXES
from btfcore.library import btf_samples, meshes, samples
from btfcore.mesh.reader import SUFFIXES as MESH_SUFFIXES

PANEL_WIDTH = 344
ENVIRONMENTS = (".hdr", ".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff")


class Window(QMainWindow):
    """Shows one document; closing it stops what runs and waits for it."""

    def __init__(self, *, settings: QSettings | None = None, scripted: bool = False) -> None:
        """`scripted` windows ask nothing and remember nothing."""
        super().__init__()
        self.scripted = scripted
        self._settings = settings if settings is not None else QSettings("Patina", "Patina")
        self.document = Document(self)
        self.operations = Operations(self.document, self)
        self.setWindowTitle("Patina")
        self.setAcceptDrops(True)
        self.resize(1280, 800)
        examples, textures, lacking = _library()
        self.viewport = Viewport(self.document)
        self.welcome = WelcomePanel(examples)
        self.errors = MessageBar("errors")
        self.notes = MessageBar("notes", seconds=12)
        self.samples = SamplesPanel(self.document)
        self.knobs = KnobsPanel(self.document)
        self.run = RunPanel(self.document, self.operations.work)
        self.modes = ModesPanel(self.document)
        self.light = LightPanel(self.document)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.welcome)
        self.stack.addWidget(self.viewport)
        self._arrange()
        self._mesh_label, self._result_label = QLabel(), QLabel()
        status = self.statusBar()
        assert status is not None
        status.setSizeGripEnabled(False)
        status.addWidget(self._mesh_label, 1)
        status.addPermanentWidget(self._result_label)
        self.menus = Menus(
            self, self, self.document, self.operations.work,
            examples=examples, settings=self._settings,
        )  # fmt: skip
        self.workspace = Workspace(self, self._settings)
        self._connect()
        self._show_mesh()
        self.operations.offer(textures)
        if not scripted:
            self.workspace.restore()
        if lacking:
            self.errors.tell(lacking)

    def _arrange(self) -> None:
        side = named(QWidget(), "panel")
        column = QVBoxLayout(side)
        column.setContentsMargins(14, 12, 14, 12)
        column.setSpacing(12)
        column.addWidget(self.samples, 1)
        column.addWidget(self.knobs)
        column.addWidget(self.run)
        side.setMinimumWidth(300)
        main = QWidget()
        rows = QVBoxLayout(main)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(0)
        for widget in (self.modes, self.light, self.errors, self.notes):
            rows.addWidget(widget)
        rows.addWidget(self.stack, 1)
        splitter = QSplitter(Qt.Orientation.Horizontal)
        splitter.addWidget(side)
        splitter.addWidget(main)
        splitter.setStretchFactor(1, 1)
        splitter.setCollapsible(0, False)
        splitter.setCollapsible(1, False)
        splitter.setHandleWidth(1)
        splitter.setSizes([PANEL_WIDTH, 1280 - PANEL_WIDTH])
        self.setCentralWidget(splitter)

    def _connect(self) -> None:
        self.operations.failed.connect(self.errors.tell)
        self.operations.noted.connect(self.notes.tell)
        self.operations.exported.connect(self._tell_exported)
        self.operations.work.started.connect(lambda name: self.errors.clear())
        self.operations.work.started.connect(lambda name: self.viewport.set_lively(True))
        self.operations.work.idle.connect(lambda: self.viewport.set_lively(False))
        self.welcome.open_wanted.connect(self.ask_mesh)
        self.welcome.example_wanted.connect(self.open_mesh)
        self.samples.folder_wanted.connect(self.ask_folder)
        self.run.wanted.connect(self.synthesize)
        self.run.cancel_wanted.connect(self.cancel)
        self.run.pause_wanted.connect(self.pause)
        self.run.export_wanted.connect(self.ask_export)
        self.light.environment_wanted.connect(self.ask_environment)
        self.light.drag_wanted.connect(self.viewport.set_light_drag)
        self.viewport.lit.told.connect(self.light.tell)
        self.viewport.lit.backend_found.connect(self.light.tell_backend)
        self.viewport.lit.failed.connect(self.errors.tell)
        self.document.mesh_changed.connect(self._show_mesh)
        self.document.result_changed.connect(self._show_result)

    # --- verbs, for menus, buttons, drops and scripts

    def open_mesh(self, path: Path) -> None:
        """Open a mesh file, asking first where work would be lost."""
        if self.may_lose(self.tr("Open another mesh?")):
            self.operations.open_mesh(path)

    def synthesize(self) -> None:
        """Cover the mesh with the chosen sample."""
        self.operations.synthesize()

    def cancel(self) -> None:
        """Stop the stroke in hand, or what runs."""
        if not self.workspace.bench.cancel():
            self.operations.cancel()

    def pause(self) -> None:
        """Let what runs wait, or go on."""
        self.operations.pause()

    def frame(self) -> None:
        """Bring the whole mesh into view."""
        self.viewport.frame()

    def ask_mesh(self) -> None:
        """Let the user choose a mesh file."""
        kinds = self.tr("Meshes ({0})").format(_patterns(MESH_SUFFIXES))
        name, _ = QFileDialog.getOpenFileName(
            self, self.tr("Open mesh"), self._folder("mesh"), kinds
        )
        if name:
            self._keep_folder("mesh", name)
            self.open_mesh(Path(name))

    def ask_image(self) -> None:
        """Let the user choose image files and packages as samples."""
        kinds = self.tr("Samples ({0})").format(_patterns(SAMPLE_SUFFIXES))
        names, _ = QFileDialog.getOpenFileNames(
            self, self.tr("Open samples"), self._folder("sample"), kinds
        )
        if names:
            self._keep_folder("sample", names[0])
            self.operations.offer([Path(name) for name in names], choose=True)

    def ask_folder(self) -> None:
        """Let the user choose a folder of samples."""
        name = QFileDialog.getExistingDirectory(
            self, self.tr("Folder of samples"), self._folder("sample")
        )
        if name:
            self._keep_folder("sample", str(Path(name) / "x"))
            self.workspace.library.add_folder(Path(name))

    def ask_export(self) -> None:
        """Let the user choose where the result goes."""
        opened = self.document.opened
        if opened is None or self.document.decoration is None:
            return
        start = str(Path(self._folder("export")) / f"{opened.path.stem}_decorated.glb")
        kinds = self.tr(
            "glTF binary (*.glb);;Wavefront OBJ (*.obj);;PLY, colours per vertex (*.ply)"
        )
        name, kind = QFileDialog.getSaveFileName(
            self, self.tr("Export the decorated mesh"), start, kinds
        )
        if name:
            if Path(name).suffix.lower() not in EXPORT_SUFFIXES:
                name += next((each for each in EXPORT_SUFFIXES if each in kind), ".glb")
            self._keep_folder("export", name)
            self.operations.export(Path(name))

    def ask_environment(self) -> None:
        """Let the user choose a picture of all that is around."""
        kinds = self.tr("Environments ({0})").format(_patterns(ENVIRONMENTS))
        name, _ = QFileDialog.getOpenFileName(
            self, self.tr("Open environment"), self._folder("environment"), kinds
        )
        if name:
            self._keep_folder("environment", name)
            self.operations.open_environment(Path(name))

    def about(self) -> None:
        """Tell what this is, who made its parts and under which terms."""
        box = QMessageBox(self)
        box.setWindowTitle(self.tr("About Patina"))
        box.setIconPixmap(self.windowIcon().pixmap(64, 64))
        box.setText(f"<b>Patina {__version__}</b>")
        box.setInformativeText(
            self.tr(
                "Decorates meshes with real materials by graphcut quilting on the surface.\n\n"
                "Free software under the GNU General Public License, version 3 or later; it "
                "comes without any warranty.\n\n"
                "Method: Zhou, Du, Wang, Matsushita, Shi, Guo, Shum, “Decorating Surfaces with "
                "Bidirectional Texture Functions”, 2005. Built on NumPy, SciPy, Numba, "
                "PyMaxflow, xatlas, libigl, trimesh, Pillow, VTK, PyVista and Qt.\n\n"
                "Credits of the shipped meshes and samples: resources/CREDITS.md"
            )
        )
        box.open()

    # --- drops

    def dragEnterEvent(self, event: QDragEnterEvent | None) -> None:  # noqa: N802
        """Accept files and folders."""
        if event is not None and _dropped(event):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent | None) -> None:  # noqa: N802
        """Open what was dropped."""
        if event is not None:
            event.acceptProposedAction()
            self.take(_dropped(event))

    def take(self, paths: Sequence[Path]) -> None:
        """Open the first mesh, offer all images and the images of folders."""
        for folder in [path for path in paths if path.is_dir()]:
            self.operations.offer_folder(folder)
        images = [path for path in paths if is_sample(path) and not path.is_dir()]
        if images:
            self.operations.offer(images, choose=True)
        found = [path for path in paths if is_mesh(path) and not path.is_dir()]
        if found:
            self.open_mesh(found[0])
        if len(found) > 1:
            self.notes.tell(self.tr("Of {0} meshes the first was opened.").format(len(found)))
        projects = [path for path in paths if is_project(path) and not path.is_dir()]
        if projects:
            self.workspace.open_project(projects[0])
        known = {*images, *found, *projects}
        odd = [path for path in paths if path not in known and not path.is_dir()]
        if odd:
            text = self.tr("{0}: neither a mesh ({1}) nor an image ({2})")
            self.errors.tell(
                text.format(odd[0].name, " ".join(MESH_SUFFIXES), " ".join(SAMPLE_SUFFIXES))
            )

    # --- what the document says

    def _show_mesh(self) -> None:
        opened = self.document.opened
        self.stack.setCurrentWidget(self.welcome if opened is None else self.viewport)
        self.modes.setVisible(opened is not None)
        if opened is None:
            self._mesh_label.setText(self.tr("No mesh"))
            return
        counts = opened.imported.statistics
        border = self.tr("closed")
        if counts.boundary_loops:
            border = self.tr("{0} boundary loops").format(counts.boundary_loops)
        self._mesh_label.setText(
            self.tr("{0}: {1} faces, {2} vertices, {3}, Euler number {4}").format(
                opened.path.name,
                _count(counts.faces),
                _count(counts.vertices),
                border,
                counts.euler,
            )
        )
        self.setWindowTitle(self.tr("{0}[*] – Patina").format(opened.path.name))
        if not self.scripted:
            self.menus.remember(opened.path)

    def _show_result(self) -> None:
        done = self.document.decoration
        self.setWindowModified(self.document.unsaved)
        if done is None:
            self._result_label.clear()
            return
        text = self.tr("{0} × {0}: {1} patches, seams {2:.2f} × texel step, {3:.1f} s")
        self._result_label.setText(
            text.format(
                done.canvas.prepared.dense.size, done.patches, done.seams.per_edge, done.seconds
            )
        )
        self._result_label.setToolTip(
            self.tr(
                "Mean colour step across seam edges, over the mean step between neighbouring "
                "texels of the sample; {0} seam edges are {1:.1%} of all"
            ).format(_count(done.seams.seam_edges), done.seams.fraction)
        )

    def _tell_exported(self, written: tuple[Path, ...]) -> None:
        self.notes.tell(self.tr("Exported {0}").format(", ".join(map(str, written))))

    # --- the end

    def closeEvent(self, event: QCloseEvent | None) -> None:  # noqa: N802
        """Ask where work would be lost; then stop the workers, wait, and free the view."""
        if event is None:
            return
        if not self.may_lose(self.tr("Quit?")):
            event.ignore()
            return
        self.workspace.close()
        self.operations.close()
        self.viewport.close_view()
        super().closeEvent(event)

    def may_lose(self, title: str) -> bool:
        """Ask where work would be lost; False where the user would rather keep it."""
        if self.scripted or not self.document.unsaved:
            return True
        box = QMessageBox(self)
        box.setWindowTitle(title)
        box.setText(self.tr("The decorated mesh has not been saved or exported."))
        box.setInformativeText(self.tr("It will be lost if you go on."))
        keep = box.addButton(self.tr("Keep working"), QMessageBox.ButtonRole.RejectRole)
        box.addButton(self.tr("Discard it"), QMessageBox.ButtonRole.DestructiveRole)
        box.setDefaultButton(keep)
        box.exec()
        return box.clickedButton() is not keep

    def picture(self) -> QImage:
        """The whole window as an image, the view included."""
        self.viewport.picture()
        shot = QPixmap(self.size() * self.devicePixelRatioF())
        shot.setDevicePixelRatio(self.devicePixelRatioF())
        self.render(shot)
        if self.stack.currentWidget() is self.viewport:
            painter = QPainter(shot)
            corner = self.viewport.mapTo(self, self.viewport.rect().topLeft())
            painter.drawImage(corner, self.viewport.picture())
            painter.end()
        return shot.toImage()

    def _folder(self, kind: str) -> str:
        return str(self._settings.value(f"folder/{kind}", ""))

    def _keep_folder(self, kind: str, name: str) -> None:
        self._settings.setValue(f"folder/{kind}", str(Path(name).parent))


def _library() -> tuple[list[Path], list[Path], str]:
    """Shipped meshes and samples, or why there are none."""
    try:
        return meshes(), [*btf_samples(), *samples()], ""
    except (PatinaError, OSError) as error:
        return [], [], str(error)


def _count(number: int) -> str:
    """Write a number with the separators of the user's language."""
    return QLocale().toString(number)


def _patterns(suffixes: Sequence[str]) -> str:
    return " ".join(f"*{suffix}" for each in suffixes for suffix in (each, each.upper()))


def _dropped(event: QDropEvent) -> list[Path]:
    data = event.mimeData()
    urls = data.urls() if data is not None else []
    return [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
