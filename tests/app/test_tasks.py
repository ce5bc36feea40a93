import threading
import time
from functools import partial

import pytest

from app.tasks import Clock, Tasks
from btfcore.errors import InvalidMesh

pytestmark = pytest.mark.filterwarnings("error")


def outcome(qtbot, tasks, job):
    """Run a job; returns its name, how it ended and with what."""
    heard = []
    tasks.finished.connect(lambda name, value: heard.append(("finished", value)))
    tasks.failed.connect(lambda name, text: heard.append(("failed", text)))
    tasks.cancelled.connect(lambda name: heard.append(("cancelled", None)))
    with qtbot.waitSignal(tasks.idle, timeout=20_000):
        assert tasks.start("job", job)
    assert len(heard) == 1
    return heard[0]


def test_a_result_arrives_on_the_windows_thread(qtbot):
    tasks = Tasks()
    threads = []
    tasks.finished.connect(lambda name, value: threads.append(threading.get_ident()))
    kind, value = outcome(qtbot, tasks, lambda progress, report: threading.get_ident())
    assert kind == "finished"
    assert threads == [threading.get_ident()] and value != threads[0]


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (InvalidMesh("no triangle left, 3 were dropped"), "no triangle left, 3 were dropped"),
        (MemoryError(), "memory"),
        (ZeroDivisionError("odd"), "internal error: ZeroDivisionError: odd"),
        (SystemExit(3), "internal error: SystemExit: 3"),
    ],
)
def test_every_error_is_told_and_the_next_job_runs(qtbot, error, expected):
    tasks = Tasks()

    def job(progress, report):
        raise error

    kind, text = outcome(qtbot, tasks, job)
    assert kind == "failed" and expected in text
    with qtbot.waitSignal(tasks.finished, timeout=20_000):
        tasks.start("next", lambda progress, report: 1)


def test_cancel_stops_at_the_next_progress(qtbot):
    tasks = Tasks()
    running = threading.Event()

    def job(progress, report):
        while True:
            progress(0.5, "waiting")
            running.set()

    tasks.progressed.connect(lambda fraction, label, left: tasks.cancel())
    assert outcome(qtbot, tasks, job)[0] == "cancelled"
    assert running.is_set() and not tasks.busy


def test_a_job_that_does_not_listen_is_left_to_itself_if_it_is_harmless(qtbot):
    tasks = Tasks()
    go = threading.Event()
    heard = []
    tasks.finished.connect(lambda name, value: heard.append((name, value)))

    def deaf(progress, report):
        go.wait(60)
        report("late", 1)
        return "late"

    tasks.reported.connect(lambda name, value: heard.append((name, value)))
    tasks.start("deaf", deaf)
    with qtbot.waitSignal(tasks.cancelled, timeout=20_000):
        tasks.cancel()
    assert not tasks.busy
    with qtbot.waitSignal(tasks.finished, timeout=20_000):
        tasks.start("next", lambda progress, report: "next")
        qtbot.wait(50)
        assert heard == []  # the next one waits for the worker thread
        go.set()
    assert heard == [("next", "next")]


def test_a_job_that_writes_is_waited_for(qtbot):
    tasks = Tasks()
    go = threading.Event()

    def job(progress, report):
        go.wait(60)
        return "written"

    tasks.start("export", job, harmless=False)
    tasks.cancel()
    qtbot.wait(400)
    assert tasks.busy
    with qtbot.waitSignal(tasks.finished, timeout=20_000):
        go.set()


def test_one_job_at_a_time(qtbot):
    tasks = Tasks()
    go = threading.Event()
    assert tasks.start("first", lambda progress, report: go.wait(20))
    assert tasks.busy and not tasks.start("second", lambda progress, report: None)
    with qtbot.waitSignal(tasks.idle, timeout=20_000):
        go.set()


def test_a_slow_window_misses_frames_but_no_result(qtbot):
    tasks = Tasks()
    got, made = [], []
    tasks.reported.connect(lambda name, value: got.append((name, value)))

    def job(progress, report):
        for number in range(50):  # the window is not listening meanwhile: it sits in `wait`
            report("frame", partial(made.append, number), droppable=True)
        report("last", 50)

    tasks.start("job", job)
    assert tasks.wait(20_000)
    qtbot.waitUntil(lambda: not tasks.busy, timeout=20_000)
    assert got == [("frame", None), ("last", 50)]
    assert made == [0]  # what nobody sees is not made


def test_a_paused_job_waits_and_goes_on(qtbot):
    tasks, calls, told = Tasks(), [], []
    tasks.held.connect(told.append)

    def job(progress, report):
        end = time.monotonic() + 30
        while told != [True, False] and time.monotonic() < end:  # until it was let go on
            progress(0.5, "counting")
            calls.append(0)
            time.sleep(0.001)
        return len(calls)

    tasks.progressed.connect(lambda fraction, label, left: tasks.pause() if not told else None)
    with qtbot.waitSignal(tasks.held, timeout=20_000):
        tasks.start("job", job)
    qtbot.wait(100)  # it stops at its next call
    before = len(calls)
    qtbot.wait(200)
    assert tasks.paused and tasks.busy and len(calls) == before
    with qtbot.waitSignal(tasks.finished, timeout=20_000):
        tasks.pause(False)
    assert told == [True, False] and len(calls) >= before and not tasks.paused
    tasks.pause()  # nothing runs: nothing to hold
    assert told == [True, False]


def test_a_paused_job_can_be_cancelled(qtbot):
    tasks, calls = Tasks(), []

    def job(progress, report):
        while True:
            progress(0.5, "waiting")
            calls.append(0)

    tasks.start("job", job)
    qtbot.waitUntil(lambda: len(calls) > 0, timeout=20_000)
    tasks.pause()
    with qtbot.waitSignal(tasks.cancelled, timeout=20_000):
        tasks.cancel()
    assert not tasks.busy and not tasks.paused


def test_a_pause_does_not_count_as_time_spent():
    clock = Clock()
    assert clock.left(0.0, 100.0) == -1
    clock.skip(50.0)
    assert clock.left(0.25, 151.0) == pytest.approx(3.0)


def test_time_left_is_proportional_and_silent_at_first():
    clock = Clock()
    assert clock.left(0.0, 100.0) == -1
    assert clock.left(0.1, 100.1) == -1
    assert clock.left(0.25, 101.0) == pytest.approx(3.0)
    assert clock.left(0.5, 102.0) == pytest.approx(2.0)
