"""The status bar over real background jobs."""

import threading

import pytest

pytest.importorskip("PyQt6.QtWidgets")

from PyQt6.QtCore import Qt  # noqa: E402
from PyQt6.QtTest import QTest  # noqa: E402
from PyQt6.QtWidgets import QApplication  # noqa: E402

from app.document import Document  # noqa: E402
from app.layer_views import LayerView, PaintState  # noqa: E402
from app.panels.status import StatusPanel, duration  # noqa: E402
from app.tasks import Tasks  # noqa: E402

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def executors(qtbot):
    made = {"Synthesising": Tasks(), "Painting": Tasks()}
    yield made
    for tasks in made.values():
        tasks.close()


@pytest.fixture
def document(qtbot):
    return Document()


@pytest.fixture
def panel(qtbot, document, executors):
    panel = StatusPanel(document, executors)
    qtbot.addWidget(panel)
    panel.resize(900, 34)
    panel.show()
    qtbot.waitExposed(panel)
    return panel


def job(fraction, label, go):
    """A job that stops at a fraction until it may go on, asking whether it is cancelled."""

    def run(progress, report):
        while not go.wait(0.02):
            progress(fraction, label)
        return 1

    return run


def test_nothing_is_shown_while_nothing_runs(panel):
    for widget in (panel.bar, panel.cancel, panel.queue, panel.messages):
        assert not widget.isVisible()
    assert panel.label.text() == ""


def test_progress_phase_and_cancel(qtbot, panel, executors):
    tasks = executors["Synthesising"]
    panel.cancel_wanted.connect(tasks.cancel)
    tasks.start("synthesize", job(0.4, "laying patches", threading.Event()))
    qtbot.waitUntil(lambda: panel.bar.isVisible() and panel.bar.value() == 400)
    assert panel.label.text() == "Synthesising · laying patches"
    with qtbot.waitSignal(tasks.idle):
        QTest.mouseClick(panel.cancel, LEFT)
    assert not panel.bar.isVisible() and not panel.cancel.isVisible()


def test_time_left_is_told_and_a_pause_too(qtbot, panel, executors):
    tasks = executors["Painting"]
    go = threading.Event()
    tasks.start("stroke", job(0.5, "cutting", go))
    qtbot.waitUntil(panel.bar.isVisible)
    tasks.progressed.emit(0.5, "cutting", 90.0)
    assert panel.label.text() == "Painting · cutting · 2 min left"
    tasks.pause()
    assert panel.label.text() == "Painting · paused"
    tasks.pause(False)
    go.set()
    qtbot.waitUntil(lambda: not tasks.busy)


def test_short_work_does_not_flicker(qtbot, panel, executors):
    seen = []
    tasks = executors["Painting"]
    tasks.progressed.connect(lambda *told: seen.append(panel.bar.isVisible()))
    with qtbot.waitSignal(tasks.idle):
        tasks.start("dab", lambda progress, report: progress(1.0, "done"))
    assert seen == [False] and not panel.bar.isVisible()


def test_the_first_of_two_is_shown(qtbot, panel, executors):
    go = threading.Event()
    executors["Painting"].start("stroke", job(0.1, "cutting", go))
    executors["Synthesising"].start("synthesize", job(0.2, "patches", go))
    qtbot.waitUntil(lambda: panel.label.text() == "Synthesising · patches · and 1 more")
    go.set()
    qtbot.waitUntil(lambda: not any(tasks.busy for tasks in executors.values()))


def test_waiting_edits_are_counted_and_can_be_dropped(qtbot, panel, document):
    wait = tuple(LayerView(-1 - at, "Paint", "paint", busy=True) for at in range(3))
    document.set_state(PaintState(layers=wait))
    assert panel.queue.isVisible() and panel.queue.text() == "3 edits to do"
    with qtbot.waitSignal(panel.cancel_wanted):
        QTest.mouseClick(panel.cancel, LEFT)
    document.set_state(PaintState())
    assert not panel.queue.isVisible() and not panel.cancel.isVisible()


def test_messages_are_kept_and_can_be_copied(qtbot, panel):
    panel.note("rust.png: the picture was turned")
    panel.fail("ring.obj cannot be read:\nit is empty")
    assert panel.label.text() == "ring.obj cannot be read:" and panel.messages.text() == "✕ 1"
    QTest.mouseClick(panel.messages, LEFT)
    dialog = panel.history
    texts = [dialog.list.item(row).text() for row in range(dialog.list.count())]
    assert "ring.obj" in texts[0] and "rust.png" in texts[1]
    panel.note("another")
    assert dialog.list.count() == 3, "it follows"
    QTest.mouseClick(dialog.copy, LEFT)
    assert "rust.png" in QApplication.clipboard().text()
    for number in range(400):
        panel.note(str(number))
    assert len(panel.log.messages) == 300
    dialog.close()
    qtbot.waitUntil(lambda: panel.history is None)
    QTest.mouseClick(panel.messages, LEFT)
    assert panel.history is not None


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "1 s"),
        (59, "59 s"),
        (60, "1 min"),
        (3500, "58 min"),
        (3599, "1 h"),
        (7800, "2 h 10 min"),
    ],
)
def test_durations_are_rough(seconds, text):
    assert duration(seconds) == text


def test_every_control_says_what_it_is(panel):
    for widget in (panel.bar, panel.cancel, panel.messages, panel.queue):
        assert widget.toolTip() and widget.accessibleName()
