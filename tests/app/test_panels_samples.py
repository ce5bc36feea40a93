"""The sample library as a user meets it, with the real readers behind it."""

import os
import time

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl  # noqa: E402
from PyQt6.QtGui import QDropEvent  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QApplication, QWidget  # noqa: E402

from app.document import Document, SampleEntry  # noqa: E402
from app.operations import Operations  # noqa: E402
from app.panels.import_dialog import ImportDialog  # noqa: E402
from app.panels.library import SampleLibrary  # noqa: E402
from app.panels.mask_editor import MaskEditor  # noqa: E402
from app.panels.sample_info import SampleInfo  # noqa: E402
from app.panels.sample_model import BROKEN, STATE  # noqa: E402
from app.panels.samples import SamplesPanel  # noqa: E402
from app.store import open_store  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from btfcore.files.package.read import read_package  # noqa: E402
from btfcore.files.package.write import write_package  # noqa: E402
from tests.btf.bricks import factors, images, sample  # noqa: E402

LONG = 120_000  # generous: a first run compiles
LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


class World:
    """A document, its operations, the panel and the library over a folder."""

    def __init__(self, folder):
        self.store = open_store(folder / "patina.ini").settings
        self.document = Document()
        self.operations = Operations(self.document)
        self.panel = SamplesPanel(self.document)
        self.library = SampleLibrary(
            self.document, self.operations, self.panel, self.store, own=folder / "own"
        )
        self.told = []
        for signal in (self.operations.failed, self.library.failed, self.library.noted):
            signal.connect(self.told.append)

    @property
    def names(self):
        return [entry.path.name for entry in self.document.samples]


@pytest.fixture
def world(qtbot, tmp_path):
    made = World(tmp_path)
    qtbot.addWidget(made.panel)
    made.panel.resize(330, 620)
    made.panel.show()
    qtbot.waitExposed(made.panel)
    yield made
    made.library.close()
    made.operations.close()


@pytest.fixture
def stock(tmp_path):
    """A folder with pictures, BTFs with and without a mask, and a broken file."""
    folder = tmp_path / "stock"
    folder.mkdir()
    noise = np.random.default_rng(5).integers(0, 255, (48, 40, 3), np.uint8)
    for name in ("oak_wood.png", "slate.png"):
        Image.fromarray(noise).save(folder / name)
    (folder / "broken.png").write_text("this is no image")
    stack = ArrayStack(images(5, 12, 40, 40))
    write_package(folder / "brick.btfz", sample(factors=factors(height=40, width=40), stack=stack))
    mask = np.zeros((40, 40), np.float32)
    mask[10:20, 10:20] = 1
    write_package(
        folder / "cracked.btfz",
        sample(factors=factors(height=40, width=40), stack=stack, mask=mask),
    )
    return folder


def settled(qtbot, world):
    qtbot.waitUntil(
        lambda: (
            not world.operations.reading.busy
            and not world.library.worker.busy
            and all(e.error or e.thumbnail is not None for e in world.document.samples)
        ),
        timeout=LONG,
    )


def filled(qtbot, world, stock):
    world.library.add_folder(stock)
    settled(qtbot, world)


def shown(group):
    return sorted(group.index(row, 0).data() for row in range(group.rowCount()))


def place(view, group, path):
    return view.visualRect(group.index(group.row_of(path), 0)).center()


def test_backgrounds_and_imperfections_are_two_groups(qtbot, world, stock):
    filled(qtbot, world, stock)
    panel = world.panel
    assert shown(panel.backgrounds) == ["brick", "broken", "oak wood", "slate"]
    assert shown(panel.features) == ["cracked"]
    bad = panel.backgrounds.index(panel.backgrounds.row_of(stock / "broken.png"), 0)
    assert bad.data(STATE) == BROKEN and "broken.png" in bad.data(Qt.ItemDataRole.ToolTipRole)


def test_a_click_chooses_background_or_feature_and_never_a_broken_one(qtbot, world, stock):
    filled(qtbot, world, stock)
    panel, document = world.panel, world.document
    for name in ("slate.png", "broken.png"):
        where = place(panel.view, panel.backgrounds, stock / name)
        QTest.mouseClick(panel.view.viewport(), LEFT, NONE, where)
        assert document.sample_path == stock / "slate.png"
    where = place(panel.feature_view, panel.features, stock / "cracked.btfz")
    QTest.mouseClick(panel.feature_view.viewport(), LEFT, NONE, where)
    assert document.options.sample == stock / "cracked.btfz"
    assert document.sample_path == stock / "slate.png"
    document.choose_sample(stock / "brick.btfz")
    assert panel.view.currentIndex().data() == "brick"
    panel.view.setFocus()
    QTest.keyClick(panel.view, Qt.Key.Key_Right)  # onto the broken one
    assert document.sample_path == stock / "brick.btfz"
    QTest.keyClick(panel.view, Qt.Key.Key_Right)
    assert document.sample_path == stock / "oak_wood.png"


def test_what_comes_and_goes_chooses_nothing(qtbot, world, stock):
    filled(qtbot, world, stock)
    document = world.document
    document.choose_sample(stock / "slate.png")
    document.set_mask(stock / "slate.png", np.ones((48, 40), np.float32))
    assert document.sample_path == stock / "slate.png", "it went to the other group"
    assert shown(world.panel.features) == ["cracked", "slate"]
    world.library.remove([stock / "slate.png"])
    assert document.sample_path is None and "slate.png" not in world.names
    assert (stock / "slate.png").exists()


def test_search_narrows_as_one_types(qtbot, world, stock):
    filled(qtbot, world, stock)
    panel = world.panel
    QTest.keyClicks(panel.search, "WOO oa")
    assert shown(panel.backgrounds) == ["oak wood"] and shown(panel.features) == []
    panel.search.clear()
    QTest.keyClicks(panel.search, "stock")  # the folder's name
    assert len(shown(panel.backgrounds)) == 4
    panel.search.clear()
    assert shown(panel.features) == ["cracked"]


def test_the_light_moves_over_the_hovered_btf_only(qtbot, world, stock):
    filled(qtbot, world, stock)
    panel, path = world.panel, stock / "brick.btfz"
    view = panel.view
    where = place(view, panel.backgrounds, path)
    QTest.mouseMove(view.viewport(), where + QPoint(0, -3))
    QTest.mouseMove(view.viewport(), where)
    qtbot.waitUntil(lambda: panel.light.frame(path) is not None, timeout=LONG)
    keys = set()

    def several():
        frame = panel.light.frame(path)
        keys.add(bytes(frame.toImage().constBits().asarray(frame.toImage().sizeInBytes())))
        return len(keys) >= 3

    qtbot.waitUntil(several, timeout=10_000)
    other = place(view, panel.backgrounds, stock / "slate.png")
    QTest.mouseMove(view.viewport(), other)
    qtbot.waitUntil(lambda: panel.light.frame(path) is None)
    qtbot.wait(400)
    qtbot.waitUntil(lambda: not panel.light.worker.busy)
    assert panel.light.frame(stock / "slate.png") is None, "a picture has no light to move"
    QTest.mouseMove(view.viewport(), where)
    qtbot.waitUntil(lambda: panel.light.frame(path) is not None)
    assert not panel.light.worker.busy, "the frames are remembered"


def test_folders_are_remembered_and_those_that_are_gone_are_told(qtbot, world, stock, tmp_path):
    filled(qtbot, world, stock)
    gone = tmp_path / "gone"
    gone.mkdir()
    Image.new("RGB", (8, 8)).save(gone / "a.png")
    world.library.add_folder(gone)
    settled(qtbot, world)
    world.store.sync()
    (gone / "a.png").unlink()
    gone.rmdir()
    later = World(tmp_path)
    qtbot.addWidget(later.panel)
    later.library.restore()
    settled(qtbot, later)
    assert sorted(later.names) == sorted(path.name for path in stock.iterdir())
    assert any(str(gone) in text for text in later.told)
    later.library.close()
    later.operations.close()


def test_a_folder_is_forgotten_by_the_menu(qtbot, world, stock, tmp_path):
    filled(qtbot, world, stock)
    other = tmp_path / "other.png"
    Image.new("RGB", (8, 8)).save(other)
    world.operations.offer([other])
    settled(qtbot, world)
    menu = world.panel.buttons["list"].menu()
    menu.aboutToShow.emit()
    (action,) = [each for each in menu.actions() if each.text() == f"Forget {stock}"]
    action.trigger()
    assert world.names == ["other.png"] and world.library.folders == []
    with qtbot.waitSignal(world.panel.folder_wanted):
        menu.actions()[0].trigger()


def test_refresh_finds_what_came_what_went_and_what_changed(qtbot, world, stock):
    filled(qtbot, world, stock)
    document = world.document
    document.choose_sample(stock / "slate.png")
    before = {entry.path.name: entry for entry in document.samples}
    (stock / "oak_wood.png").unlink()
    Image.new("RGB", (20, 20), (200, 30, 30)).save(stock / "slate.png")
    os.utime(stock / "slate.png", ns=(1, time.time_ns() + 5_000_000_000))
    Image.new("RGB", (20, 20), (30, 200, 30)).save(stock / "broken.png")  # mended
    Image.new("RGB", (20, 20), (30, 30, 200)).save(stock / "new.png")
    QTest.mouseClick(world.panel.buttons["fresh"], LEFT)
    settled(qtbot, world)
    after = {entry.path.name: entry for entry in document.samples}
    assert sorted(after) == ["brick.btfz", "broken.png", "cracked.btfz", "new.png", "slate.png"]
    assert after["brick.btfz"] is before["brick.btfz"], "not read again"
    assert after["slate.png"].thumbnail[0, 0, 0] == 200 and not after["broken.png"].error
    assert document.sample_path == stock / "slate.png"


def drop(world, paths):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    event = QDropEvent(QPointF(60, 90), Qt.DropAction.CopyAction, data, LEFT, NONE)
    world.panel.dropEvent(event)


def test_drops_are_taken_by_what_they_are(qtbot, world, stock, tmp_path):
    (tmp_path / "notes.txt").write_text("no sample")
    drop(world, [stock / "slate.png", stock / "cracked.btfz", tmp_path / "notes.txt"])
    settled(qtbot, world)
    assert world.names == ["slate.png", "cracked.btfz"]
    assert any("notes.txt" in text for text in world.told)
    (tmp_path / "ring.obj").write_text("v 0 0 0")
    with qtbot.waitSignal(world.library.meshes_dropped) as heard:
        drop(world, [tmp_path / "ring.obj"])
    assert heard.args == [[tmp_path / "ring.obj"]]
    drop(world, [stock])
    settled(qtbot, world)
    assert len(world.names) == 5 and world.library.folders == [stock]


def test_five_hundred_samples_make_no_widgets_and_stay_quick(qtbot, world, tmp_path):
    many = [tmp_path / f"sample {number:03}.png" for number in range(500)]
    grey = np.full((96, 96, 3), 90, np.uint8)
    before = len(world.panel.findChildren(QWidget))
    world.document.offer_samples([SampleEntry(path) for path in many])
    start = time.process_time()
    for at in range(0, 500, 50):
        world.document.offer_samples(
            [SampleEntry(path, grey, feature=at % 100 == 0) for path in many[at : at + 50]]
        )
    world.panel.grab()
    QTest.keyClicks(world.panel.search, "499")
    spent = time.process_time() - start
    print(f"500 samples: shown and searched in {spent * 1000:.0f} ms")  # noqa: T201
    assert len(world.panel.findChildren(QWidget)) == before
    assert shown(world.panel.backgrounds) == ["sample 499"]


def test_marking_a_feature_makes_an_imperfection(qtbot, world, stock):
    filled(qtbot, world, stock)
    path = stock / "slate.png"
    menu = world.panel.context_menu(path)
    (action,) = [each for each in menu.actions() if each.text() == "Mark feature…"]
    action.trigger()
    qtbot.waitUntil(lambda: isinstance(world.library.dialog, MaskEditor), timeout=LONG)
    editor = world.library.dialog
    qtbot.waitExposed(editor)
    qtbot.waitUntil(lambda: not editor.model.busy, timeout=LONG)
    at = editor.view.place_of(20, 20).toPoint()
    QTest.mousePress(editor.view, LEFT, NONE, at)
    QTest.mouseRelease(editor.view, LEFT, NONE, at)
    drawn = editor.drawn_mask()
    assert drawn.max() == 1
    editor.accept()
    assert np.array_equal(world.document.masks[path], drawn)
    assert shown(world.panel.features) == ["cracked", "slate"]
    menu = world.panel.context_menu(path)
    next(each for each in menu.actions() if "Forget" in each.text()).trigger()
    assert shown(world.panel.features) == ["cracked"]


def test_information_is_what_the_command_line_tells(qtbot, world, stock):
    filled(qtbot, world, stock)
    world.panel.info_wanted.emit(stock / "cracked.btfz")
    qtbot.waitUntil(lambda: isinstance(world.library.dialog, SampleInfo), timeout=LONG)
    dialog = world.library.dialog
    rows = dict(dialog.rows)
    assert rows["views"] == "5" and rows["lights"] == "12" and rows["kind"] == "package"
    assert rows["feature share"] == "0.0625"
    QTest.mouseClick(dialog.copy, LEFT)
    assert "feature share\t0.0625" in QApplication.clipboard().text()
    dialog.close()
    world.panel.info_wanted.emit(stock / "broken.png")
    qtbot.waitUntil(lambda: any("broken.png" in text for text in world.told), timeout=LONG)


# --- import


@pytest.fixture
def maps(tmp_path):
    """A PBR set of two maps."""
    folder = tmp_path / "tiles"
    folder.mkdir()
    row, column = np.mgrid[:32, :32]
    height = (np.hypot(row % 16 - 8, column % 16 - 8) < 6) * 200
    Image.fromarray(height.astype(np.uint8)).save(folder / "tiles_height.png")
    colour = np.stack([height, height // 2, 0 * height], axis=-1) + 40
    Image.fromarray(colour.astype(np.uint8)).save(folder / "tiles_albedo.png")
    return folder


def test_a_pbr_set_is_dropped_baked_and_shown(qtbot, world, maps):
    drop(world, [maps])
    qtbot.waitUntil(lambda: isinstance(world.library.dialog, ImportDialog), timeout=LONG)
    dialog = world.library.dialog
    qtbot.waitUntil(lambda: dialog.ok.isEnabled(), timeout=LONG)
    assert dialog.kind.text().startswith("PBR set") and dialog.side.isVisible()
    assert not dialog.relief.isEnabled()
    QTest.mouseClick(dialog.automatic, LEFT, NONE, QPoint(8, dialog.automatic.height() // 2))
    assert dialog.relief.isEnabled()
    dialog.side.setValue(24)
    dialog.relief.setValue(3)
    dialog.directions.setCurrentIndex(0)
    dialog.rank.setValue(6)
    dialog.name.setText("a/b")
    assert not dialog.ok.isEnabled() and dialog.taken.isVisible()
    dialog.name.setText("round tiles")
    QTest.mouseClick(dialog.ok, LEFT)
    assert dialog.work.busy and dialog.bar.isVisible() and not dialog.ok.isEnabled()
    package = world.library.own / "round tiles.btfz"
    qtbot.waitUntil(lambda: package in [e.path for e in world.document.samples], timeout=LONG)
    settled(qtbot, world)
    made = read_package(package)
    assert made.shape == (24, 24) and made.factors.rank == 6 and len(made.views) == 48
    assert world.document.sample_path == package


def test_a_running_import_is_cancelled_and_leaves_nothing(qtbot, world, maps):
    dialog = world.library.import_(maps)
    qtbot.waitUntil(lambda: dialog.ok.isEnabled(), timeout=LONG)
    dialog.side.setValue(64)
    QTest.mouseClick(dialog.ok, LEFT)
    with qtbot.waitSignal(dialog.work.cancelled, timeout=LONG):
        qtbot.wait(100)
        QTest.mouseClick(dialog.cancel, LEFT)
    assert dialog.isVisible() and dialog.ok.isEnabled()
    QTest.mouseClick(dialog.cancel, LEFT)
    dialog.work.wait()
    assert not list(world.library.own.glob("*"))
    assert world.names == []


def test_a_name_that_is_taken_gets_a_number(qtbot, world, maps):
    world.library.own.mkdir()
    (world.library.own / "tiles.btfz").write_bytes(b"")
    dialog = world.library.import_(maps)
    qtbot.waitUntil(lambda: dialog.ok.isEnabled(), timeout=LONG)
    assert dialog.name.text() == "tiles 2"
    dialog.name.setText("tiles")
    assert not dialog.ok.isEnabled() and "already" in dialog.taken.text()


def test_what_is_no_sample_is_told_in_the_dialog(qtbot, world, stock):
    dialog = world.library.import_(stock / "broken.png")
    qtbot.waitUntil(lambda: dialog.errors.isVisible(), timeout=LONG)
    assert "broken.png" in dialog.errors.text.text() and not dialog.ok.isEnabled()
    dialog.look_at(stock / "slate.png")
    qtbot.waitUntil(lambda: dialog.ok.isEnabled(), timeout=LONG)
    assert not dialog.errors.isVisible() and not dialog.fields.isVisible()
    QTest.mouseClick(dialog.ok, LEFT)
    assert world.names == ["slate.png"]


def test_every_control_says_what_it_is(world):
    panel = world.panel
    for widget in (panel.search, *panel.buttons.values()):
        assert widget.toolTip() and widget.accessibleName()
    assert panel.view.accessibleName() and panel.feature_view.accessibleName()
