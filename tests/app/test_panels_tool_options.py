"""Options of the tools: what is shown is what the document has, in the user's units."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QPoint, Qt  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402

from app.document import Document, SampleEntry  # noqa: E402
from app.panels.tool_options import USED, ToolOptionsPanel  # noqa: E402
from app.tool_options import TOOLS, ToolOptions  # noqa: E402
from tests.app.panels_world import settings as settings_in  # noqa: E402

LEFT, NONE = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
GREY = np.full((24, 32, 3), 128, np.uint8)


@pytest.fixture
def settings(tmp_path):
    return settings_in(tmp_path)


@pytest.fixture
def document(qtbot):
    return Document()


@pytest.fixture
def panel(qtbot, document, settings):
    panel = ToolOptionsPanel(document, settings)
    qtbot.addWidget(panel)
    panel.resize(320, 620)
    document.set_tool("paint")
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def type_in(field, text):
    """Type over what is there, and Enter."""
    field.setFocus()
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Delete)
    QTest.keyClicks(field, text)
    QTest.keyClick(field, Qt.Key.Key_Return)


@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_shows_what_it_uses_and_nothing_else(panel, document, tool):
    document.set_tool(tool)
    shown = {name for name, field in panel.fields.items() if field.isVisible()}
    assert shown == set(USED.get(tool, ()))
    assert shown or panel.hint.isVisible() and panel.hint.text()
    assert panel.title.text()


def test_every_option_has_a_control():
    grouped = {"mirror", "radial", "axis"}
    names = {each.name for each in fields(ToolOptions)} - grouped | {"symmetry"}
    assert names == {name for used in USED.values() for name in used}


def test_lengths_are_typed_and_shown_in_the_users_unit(panel, document, settings):
    field = panel.fields["radius"]
    assert field.text() == "automatic"
    settings.change(unit="mm", metres_per_unit=0.1)
    type_in(field, "12")
    assert document.options.radius == pytest.approx(0.12)
    assert field.text() == "12 mm"
    type_in(field, "2,5cm")
    assert document.options.radius == pytest.approx(0.25) and field.text() == "25 mm"
    settings.change(unit="cm")
    assert field.text() == "2.5 cm"
    type_in(field, "nonsense")
    assert document.options.radius == pytest.approx(0.25) and field.text() == "2.5 cm"
    type_in(field, "")
    assert document.options.radius == 0 and field.text() == "automatic"


def test_a_step_is_a_tenth_and_begins_at_the_natural_size(panel, document, monkeypatch):
    field = panel.fields["radius"]
    field.natural = 0.05
    QTest.keyClick(field, Qt.Key.Key_Up)
    assert document.options.radius == pytest.approx(0.055)
    document.set_options(radius=3e-12)
    QTest.keyClick(field, Qt.Key.Key_Down)
    assert document.options.radius == pytest.approx(3e-12 / 1.1), "tiny meshes have tiny brushes"


def test_abrupt_and_automatic_transitions_differ(panel, document):
    field = panel.fields["transition"]
    type_in(field, "0")
    assert document.options.transition == 0.0 and field.text() == "abrupt"
    type_in(field, "")
    assert document.options.transition is None and field.text() == "automatic"


def test_the_document_is_shown_and_not_told_back(panel, document):
    heard = []
    document.options_changed.connect(lambda: heard.append(document.options))
    wanted = ToolOptions(
        radius=0.5, hardness=0.4, transition=0.2, weight=2.0, turn=190.0, scale=1.5, feature=2,
        orientation="stroke", protect=False, seed=7, tries=33, mirror="xz", radial=5, axis="z",
        erase_protection=True,
    )  # fmt: skip
    document.set_options(**vars(wanted))
    assert heard == [wanted], "showing must not change it"
    values = panel.fields
    assert values["hardness"].value == 40 and values["weight"].value == 2.0
    assert values["turn"].value == -170.0, "turns are shown within half a circle"
    assert values["feature"].value() == 3 and values["tries"].value() == 33
    assert values["orientation"].currentData() == "stroke"
    assert not values["protect"].isChecked() and values["erase_protection"].isChecked()
    assert panel.seed.value() == 7
    row = values["symmetry"]
    assert [row.mirrors[axis].isChecked() for axis in "xyz"] == [True, False, True]
    assert row.copies.value() == 5 and row.axis.currentData() == "z"


def test_a_dragged_slider_sets_the_option_at_once(panel, document):
    slide = panel.fields["hardness"]
    slider = slide.slider
    QTest.mousePress(slider, LEFT, NONE, QPoint(slider.width() - 6, slider.height() // 2))
    QTest.mouseMove(slider, QPoint(slider.width() // 2, slider.height() // 2))
    assert 0.3 < document.options.hardness < 0.7
    QTest.mouseRelease(slider, LEFT, NONE, QPoint(slider.width() // 2, slider.height() // 2))
    assert slide.value == round(100 * document.options.hardness)


def test_buttons_of_symmetry_and_seed(panel, document):
    row = panel.fields["symmetry"]
    QTest.mouseClick(row.mirrors["x"], LEFT)
    QTest.mouseClick(row.mirrors["z"], LEFT)
    assert document.options.mirror == "xz"
    QTest.mouseClick(row.mirrors["x"], LEFT)
    assert document.options.mirror == "z"
    assert not row.axis.isEnabled()
    type_in(row.copies, "6")
    assert document.options.radial == 6 and row.axis.isEnabled()
    QTest.keyClick(row.axis, Qt.Key.Key_Down)
    assert document.options.axis == "z"
    QTest.mouseClick(panel.next_seed, LEFT)
    QTest.mouseClick(panel.next_seed, LEFT)
    assert document.options.seed == 2 == panel.seed.value()


def test_samples_with_a_mask_are_offered(qtbot, panel, document):
    box = panel.fields["sample"]
    moss, rust, wood = Path("/a/moss.btfz"), Path("/a/rust_spots.png"), Path("/a/wood.png")
    document.offer_samples(
        [SampleEntry(moss, GREY, feature=True), SampleEntry(rust, GREY), SampleEntry(wood, GREY)]
    )
    qtbot.waitUntil(lambda: box.count() == 2)
    document.set_mask(rust, np.ones((24, 32), np.float32))
    qtbot.waitUntil(lambda: box.count() == 3)
    assert [box.itemText(at) for at in range(3)] == ["The background's own", "moss", "rust spots"]
    assert not box.itemIcon(1).isNull() and box.currentIndex() == 0
    box.setFocus()
    QTest.keyClick(box, Qt.Key.Key_End)
    assert document.options.sample == rust
    document.set_options(sample="lichen")  # picked from the surface
    qtbot.waitUntil(lambda: box.currentText() == "lichen")
    document.set_options(sample=None)
    assert box.currentIndex() == 0


def test_what_is_out_of_range_is_told_and_not_kept(panel, document):
    panel._set("seed", -3)
    assert panel.error.isVisible() and "-3" in panel.error.text()
    assert document.options.seed == 0
    QTest.mouseClick(panel.next_seed, LEFT)
    assert not panel.error.isVisible()


def test_every_control_says_what_it_is(panel):
    row = panel.fields["symmetry"]
    inner = [*row.mirrors.values(), row.copies, row.axis, panel.seed, panel.next_seed]
    for widget in (*[f for n, f in panel.fields.items() if n != "symmetry"], *inner):
        assert widget.toolTip() and widget.accessibleName(), widget
