"""The settings dialog as a user meets it."""

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import QEvent, Qt  # noqa: E402
from PyQt6.QtWidgets import (  # noqa: E402
    QAbstractButton,
    QApplication,
    QComboBox,
    QDoubleSpinBox,
    QLineEdit,
    QMessageBox,
    QSpinBox,
)

from app.panels.settings_dialog import SettingsDialog  # noqa: E402
from app.pressure import LINEAR  # noqa: E402
from app.settings import NAMES, Settings, Values  # noqa: E402
from app.store import open_store  # noqa: E402


@pytest.fixture
def path(tmp_path):
    return tmp_path / "patina.ini"


@pytest.fixture
def settings(qtbot, path):
    return Settings(open_store(path).settings)


@pytest.fixture
def dialog(qtbot, settings):
    dialog = SettingsDialog(
        settings,
        detected=lambda: f"{settings.values.backend} was asked for",
        languages=("en", "de"),
    )
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.activateWindow()
    qtbot.waitExposed(dialog)
    return dialog


def page(dialog, title):
    """Turn to a page."""
    for row in range(dialog.pages.count()):
        if dialog.pages.item(row).text() == title:
            dialog.pages.setCurrentRow(row)


def choose(qtbot, field, value):
    """Choose by the keyboard, as a user does."""
    field.setFocus()
    step = Qt.Key.Key_Down if field.findData(value) > field.currentIndex() else Qt.Key.Key_Up
    for _ in range(field.count()):
        if field.currentData() == value:
            return
        qtbot.keyClick(field, step)
    raise AssertionError(f"{value} is not to be had")


def test_every_choice_works_at_once(qtbot, dialog, settings):
    fields = dialog.fields
    for title, name, field, value in (
        ("General", "theme", fields.theme, "dark"), ("General", "unit", fields.unit, "cm"),
        ("General", "language", fields.language, "de"), ("Work", "rate", fields.rate, 2048),
        ("View", "navigation", fields.navigation, "maya"),
        ("View", "pivot", fields.pivot, "stroke"), ("View", "backend", fields.backend, "software"),
    ):  # fmt: skip
        page(dialog, title)
        choose(qtbot, field, value)
        assert getattr(settings.values, name) == value
    assert dialog.machine.text() == "software was asked for"


def test_numbers_are_typed(qtbot, dialog, settings):
    page(dialog, "Work")
    for field, name, text, value in (
        (dialog.fields.autosave, "autosave_seconds", "120", 120),
        (dialog.fields.undo, "undo_megabytes", "2048", 2048),
    ):
        field.setFocus()
        field.selectAll()
        qtbot.keyClicks(field, text)
        qtbot.keyClick(field, Qt.Key.Key_Return)
        assert getattr(settings.values, name) == value and dialog.isVisible()
    page(dialog, "General")
    assert not dialog.fields.metres.isEnabled()
    settings.change(unit="mm")
    assert dialog.fields.metres.isEnabled()
    dialog.fields.metres.setValue(0.0254)
    assert settings.values.metres_per_unit == 0.0254
    assert dialog.fields.metres.text().startswith("0.0254 ")


def test_the_dialog_follows_the_settings(dialog, settings):
    settings.change(rate=300, theme="light", undo_megabytes=300, language="pt_BR")
    assert dialog.fields.rate.currentText() == "300"
    assert dialog.fields.theme.currentData() == "light"
    assert dialog.fields.undo.value() == 300
    assert dialog.fields.language.currentText() == "pt_BR"


def test_the_search_finds_settings_on_all_pages(qtbot, dialog):
    def seen():
        return {
            name for name, row in dialog.rows.items() if not row.field.isHidden()
        }  # on whatever page

    qtbot.keyClicks(dialog.search, "undo")
    assert seen() == {"undo_megabytes"}
    assert dialog.pages.currentItem().text() == "Work" and dialog.fields.undo.isVisible()
    dialog.search.setText("no such thing")
    assert seen() == set() and dialog.nothing.isVisible()
    dialog.search.clear()
    assert seen() == set(NAMES) and dialog.fields.theme.isVisible()


def test_a_page_and_everything_can_be_reset(qtbot, dialog, settings):
    settings.change(theme="dark", rate=1024)
    page(dialog, "Pen")
    assert not dialog.reset_page.isEnabled()
    page(dialog, "General")
    qtbot.mouseClick(dialog.reset_page, Qt.MouseButton.LeftButton)
    assert settings.values == Values(rate=1024)
    for button, expected in (("Leave as it is", 1024), ("Reset", 512)):
        qtbot.mouseClick(dialog.reset_all, Qt.MouseButton.LeftButton)
        box = dialog.findChild(QMessageBox)
        found = next(each for each in box.buttons() if each.text() == button)
        qtbot.mouseClick(found, Qt.MouseButton.LeftButton)
        assert settings.values.rate == expected
        QApplication.sendPostedEvents(box, QEvent.Type.DeferredDelete)
    assert not dialog.reset_all.isEnabled()


def test_the_curve_is_dragged_and_gets_points(qtbot, dialog, settings):
    page(dialog, "Pen")
    editor = dialog.fields.pressure

    def at(x, y):
        return editor.place((x, y)).toPoint()

    qtbot.mouseDClick(editor, Qt.MouseButton.LeftButton, pos=at(0.5, 0.75))
    qtbot.mouseRelease(editor, Qt.MouseButton.LeftButton, pos=at(0.5, 0.75))
    (_, (x, y), _) = settings.values.pressure.points
    assert (x, y) == pytest.approx((0.5, 0.75), abs=0.01)
    qtbot.mousePress(editor, Qt.MouseButton.LeftButton, pos=at(x, y))
    qtbot.mouseMove(editor, at(0.3, 0.2))
    qtbot.mouseMove(editor, at(5.0, -3.0))  # outside: as far as the neighbours let it
    qtbot.mouseRelease(editor, Qt.MouseButton.LeftButton, pos=at(5.0, -3.0))
    assert settings.values.pressure.points[1] == (0.99, 0.0)
    editor.setFocus()
    qtbot.keyClick(editor, Qt.Key.Key_Up)
    assert settings.values.pressure.points[1] == (0.99, 0.02)
    qtbot.keyClick(editor, Qt.Key.Key_Delete)
    assert settings.values.pressure == LINEAR
    qtbot.keyClick(editor, Qt.Key.Key_Delete)  # the ends stay
    assert settings.values.pressure == LINEAR


def test_every_control_has_a_tooltip_and_a_name(dialog):
    kinds = (QAbstractButton, QComboBox, QSpinBox, QLineEdit)
    for kind in kinds:
        for each in dialog.findChildren(kind):
            if isinstance(each.parent(), (QLineEdit, QSpinBox, QDoubleSpinBox)):
                continue  # parts of Qt's own controls
            assert each.toolTip(), each
            assert each.accessibleName() or each.text(), each


def test_broken_values_are_told_in_the_dialog(qtbot, path):
    path.write_text("[settings]\nrate=-7\n")
    dialog = SettingsDialog(Settings(open_store(path).settings), detected=lambda: "")
    qtbot.addWidget(dialog)
    dialog.show()
    assert "-7" in dialog.notes.text() and dialog.notes.isVisible()
