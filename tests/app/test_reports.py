"""Unexpected errors become a sentence and a report; questions come before work is lost."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from PyQt6.QtCore import QPoint, QRect, Qt
from PyQt6.QtGui import QGuiApplication
from PyQt6.QtWidgets import QLabel, QMainWindow, QMessageBox, QPushButton, QWidget

from app.close_guard import CloseGuard, Step, Work
from app.panels.error_dialog import ErrorDialog, ErrorTeller
from app.panels.recovery_dialog import RecoveryDialog
from app.recovery import Recovery, discard, recoverable
from app.reports import Problem, Reporter, problem_of, problem_of_crash, shortened, tell_fact
from app.sessions import About, last_words, open_session
from app.tasks import Tasks
from btfcore.errors import InvalidMesh
from tests.app import worked

ROOT = Path(__file__).resolve().parents[2]


def caught(text="odd"):
    """An error that has another one behind it."""
    try:
        try:
            raise ZeroDivisionError(text)
        except ZeroDivisionError as inner:
            raise KeyError("outer") from inner
    except KeyError as error:
        return error


def click(qtbot, button):
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton, pos=button.rect().center())


# --- reports


def test_a_report_says_what_where_and_on_what():
    tell_fact("OpenGL", "a renderer")
    problem = problem_of(caught(), "synthesize")
    assert problem.sentence == "internal error: KeyError: 'outer'"
    for text in ("Running: synthesize", "ZeroDivisionError: odd", "which led to", "in caught",
                 "OpenGL: a renderer", "Python: 3.", "PyQt6: 6.", "vtk: ", "numpy: ", "numba: ",
                 "System: "):  # fmt: skip
        assert text in problem.report, text
    where = problem.report.index
    assert where("ZeroDivisionError: odd") < where("KeyError: 'outer'")
    assert problem.place.startswith("KeyError ") and "test_reports.py:" in problem.place
    assert problem_of(MemoryError()).sentence == "there is not enough memory for this"


def test_a_report_holds_neither_contents_nor_the_home_folder(monkeypatch, tmp_path):
    home = tmp_path / "home" / "ann"
    monkeypatch.setattr(Path, "home", lambda: home)
    secret = problem_of(caught("x" * 2000 + "secret"), "open")
    assert "secret" not in secret.report and "…" in secret.report
    assert shortened(f"in {home}/a/b.obj, {home}") == f"in ~/a/b.obj, {home}"
    told = problem_of(OSError(2, "gone", f"{home}/mesh.obj"))
    assert str(home) not in told.report and "~/mesh.obj" in told.report
    assert "ann" not in told.sentence
    monkeypatch.setattr(Path, "home", lambda: Path("/"))
    assert shortened("/usr/lib") == "/usr/lib"


def test_a_very_deep_error_makes_no_endless_report():
    def fall(depth):
        return fall(depth + 1)

    try:
        fall(0)
    except RecursionError as error:
        assert len(problem_of(error).report) < 60_100


def test_an_error_is_told_once_and_counted(qtbot):
    reporter, told = Reporter(), []
    reporter.happened.connect(told.append)
    for _ in range(50):
        reporter.broke("draw", problem_of(caught()))
    assert len(told) == 1 and list(reporter.count.values()) == [50]
    for number in range(500):
        reporter.take(Problem("a", "", "a", f"place {number}"))
    assert len(told) < 300


def test_a_worker_hands_over_the_report(qtbot):
    tasks, told = Tasks(), []
    tasks.broke.connect(lambda name, problem: told.append((name, problem)))
    tasks.failed.connect(lambda name, text: told.append((name, text)))

    def broken(progress, report):
        raise caught()

    with qtbot.waitSignal(tasks.idle, timeout=20_000):
        tasks.start("stamp", broken)
    (name, problem), (_, text) = told
    assert name == "stamp" and problem.running == "stamp" and "in caught" in problem.report
    assert text == problem.sentence

    def refused(progress, report):
        raise InvalidMesh("no triangle")

    with qtbot.waitSignal(tasks.idle, timeout=20_000):
        tasks.start("open", refused)
    assert told[2:] == [("open", "no triangle")]  # nothing of ours is broken: no report


def test_hooks_hear_of_slots_threads_and_paint_events_and_the_program_lives():
    code = """
import sys, threading
from PyQt6.QtCore import QTimer
from PyQt6.QtWidgets import QApplication, QWidget
from app.reports import Reporter
application = QApplication(sys.argv)
before = sys.excepthook, threading.excepthook
reporter = Reporter(); reporter.install(); reporter.install()
home = threading.get_ident(); told = []
reporter.happened.connect(lambda p: told.append((p.sentence, threading.get_ident() == home)))
class Broken(QWidget):
    def paintEvent(self, event):
        raise ValueError("paint")
def slot():
    raise KeyError("slot")
def work():
    raise TypeError("thread")
def interrupt():
    raise KeyboardInterrupt
widget = Broken(); widget.show()
for wait in (0, 50, 100):
    QTimer.singleShot(wait, widget.update)
QTimer.singleShot(10, slot)
QTimer.singleShot(20, lambda: threading.Thread(target=work, name="helper").start())
QTimer.singleShot(30, interrupt)
QTimer.singleShot(600, application.quit)
application.exec()
print(sorted(told))
print(max(reporter.count.values()) > 1)
reporter.remove()
print((sys.excepthook, threading.excepthook) == before)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    told, repeated, back = done.stdout.splitlines()
    assert told == str(
        sorted((f"internal error: {each}", True)
               for each in ("KeyError: 'slot'", "TypeError: thread", "ValueError: paint"))
    )  # fmt: skip
    assert repeated == "True" and back == "True"
    assert "KeyboardInterrupt" in done.stderr and "KeyError: 'slot'" in done.stderr


def test_a_reporter_that_is_gone_breaks_nothing(qtbot):
    from PyQt6 import sip

    reporter = Reporter()
    sip.delete(reporter)
    thread = threading.Thread(target=reporter._hand_over, args=(caught(),))
    thread.start()
    thread.join()


# --- the error dialog


def test_the_dialog_copies_saves_and_goes_on(qtbot, tmp_path):
    window = QWidget()
    qtbot.addWidget(window)
    window.show()
    teller = ErrorTeller(window, named_job={"synthesize": "Synthesise"}.get)
    teller.tell(problem_of(caught(), "synthesize"))
    dialog = teller.dialog
    qtbot.waitExposed(dialog)
    assert "Synthesise" in dialog.title.text() and "KeyError" in dialog.sentence.text()
    click(qtbot, dialog.copy)
    assert QGuiApplication.clipboard().text() == dialog.text
    assert dialog.told.text() == "Copied" and "in caught" in dialog.text
    assert dialog.write(tmp_path / "report.txt")
    assert (tmp_path / "report.txt").read_text() == dialog.text
    assert not dialog.write(tmp_path / "nowhere" / "report.txt")
    assert "nowhere" in dialog.told.text()
    teller.tell(problem_of(ValueError("<b>second</b>")))  # joins, and is no markup
    assert teller.dialog is dialog and "2" in dialog.title.text()
    assert dialog.text.count("System: ") == 2 and "<b>second</b>" in dialog.sentence.text()
    with qtbot.waitSignal(dialog.destroyed):
        click(qtbot, dialog.go_on)
    assert teller.dialog is None and window.isVisible()
    teller.tell(problem_of(caught()))
    teller.dialog.reject()


def test_every_control_says_what_it_does(qtbot, tmp_path):
    window = QWidget()
    qtbot.addWidget(window)
    left = crashed(tmp_path)
    for dialog in (ErrorDialog(problem_of(caught()), window),
                   RecoveryDialog(recoverable(tmp_path), discard, window)):  # fmt: skip
        buttons = dialog.findChildren(QPushButton)
        assert len(buttons) >= 3
        for button in buttons:
            assert button.toolTip() and button.accessibleName(), button.text()
        for label in dialog.findChildren(QLabel):
            assert label.textFormat() != Qt.TextFormat.RichText
        dialog.close()
    assert left.exists()


# --- questions


class Desk:
    """Work of a window, as the guard sees it."""

    def __init__(self, *, unsaved=True, scripted=False, running=""):
        self.unsaved, self.scripted, self.running = unsaved, scripted, running
        self.saves, self.gone = [], []

    def work(self):
        return Work(
            lambda: self.unsaved, self.saves.append, lambda: self.scripted, lambda: self.running
        )

    def go(self):
        self.gone.append(True)


@pytest.fixture
def window(qtbot):
    made = QWidget()
    qtbot.addWidget(made)
    made.show()
    return made


def answer(qtbot, guard, text):
    """Click the button of that name in the open question."""
    box = guard.box
    qtbot.waitExposed(box)
    (button,) = [each for each in box.buttons() if each.text().replace("&", "") == text]
    assert button.toolTip() and button.accessibleName() == text
    click(qtbot, button)
    qtbot.waitUntil(lambda: guard.box is not box)


@pytest.mark.parametrize("desk", [Desk(unsaved=False), Desk(scripted=True)])
def test_no_question_where_nothing_is_lost_or_nobody_answers(window, desk):
    guard = CloseGuard(window, desk.work())
    guard.ask(Step.QUIT, desk.go)
    assert desk.gone == [True] and guard.box is None


@pytest.mark.parametrize("step", list(Step))
def test_discard_goes_on_and_keep_does_not(qtbot, window, step):
    desk = Desk()
    guard = CloseGuard(window, desk.work())
    for text, gone in (("Keep working", []), ("Discard", [True])):
        guard.ask(step, desk.go)
        assert guard.box.text().endswith("?") and "lost" in guard.box.informativeText()
        answer(qtbot, guard, text)
        assert desk.gone == gone and desk.saves == [] and not guard.asking
    guard.ask(step, desk.go)  # nothing was remembered
    qtbot.waitExposed(guard.box)
    qtbot.keyClick(guard.box, Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not guard.asking)
    assert desk.gone == [True]


def test_save_goes_on_only_when_it_went_well(qtbot, window):
    desk = Desk()
    guard = CloseGuard(window, desk.work())
    guard.ask(Step.OPEN, desk.go)
    answer(qtbot, guard, "Save")
    assert guard.asking and desk.gone == []
    guard.ask(Step.QUIT, desk.go)  # impatient: nothing happens until it is saved
    assert guard.box is None
    desk.saves[0](False)
    assert desk.gone == [] and not guard.asking
    guard.ask(Step.OPEN, desk.go)
    answer(qtbot, guard, "Save")
    desk.unsaved = False
    desk.saves[1](True)
    desk.saves[1](True)
    assert desk.gone == [True]


def test_work_that_went_on_while_it_was_saved_is_asked_for_again(qtbot, window):
    desk = Desk()
    guard = CloseGuard(window, desk.work())
    guard.ask(Step.QUIT, desk.go)
    answer(qtbot, guard, "Save")
    desk.saves[0](True)
    assert desk.gone == [] and guard.box is not None
    answer(qtbot, guard, "Discard")
    assert desk.gone == [True]


def test_asking_twice_opens_one_question(qtbot, window):
    desk = Desk()
    guard = CloseGuard(window, desk.work())
    guard.ask(Step.QUIT, desk.go)
    box = guard.box
    guard.ask(Step.OPEN, desk.go)
    assert guard.box is box and len(window.findChildren(QMessageBox)) == 1
    answer(qtbot, guard, "Keep working")


def test_a_running_task_is_named_before_quitting(qtbot, window):
    desk = Desk(unsaved=False, running="Synthesise")
    guard = CloseGuard(window, desk.work())
    guard.ask(Step.QUIT, desk.go)
    assert "Synthesise" in guard.box.informativeText()
    answer(qtbot, guard, "Stop it")
    assert desk.gone == [True]
    guard.ask(Step.OPEN, desk.go)
    assert desk.gone == [True, True] and guard.box is None


def test_a_save_that_raises_leaves_the_guard_ready(window):
    desk = Desk()

    def broken(then):
        raise RuntimeError

    guard = CloseGuard(window, Work(lambda: True, broken))
    with pytest.raises(RuntimeError):
        guard._save(Step.QUIT, desk.go)
    assert not guard.asking and desk.gone == []


class Main(QMainWindow):
    """A window that closes by way of the guard."""

    def __init__(self, desk):
        super().__init__()
        self.guard, self.closed = CloseGuard(self, desk.work()), 0

    def closeEvent(self, event):  # noqa: N802
        if self.guard.may_close():
            self.closed += 1
            super().closeEvent(event)
        else:
            event.ignore()


def test_a_window_closes_once_it_is_allowed_to(qtbot):
    desk = Desk()
    main = Main(desk)
    qtbot.addWidget(main)
    main.show()
    qtbot.waitExposed(main)
    for _ in range(3):
        assert not main.close() and main.isVisible()
    answer(qtbot, main.guard, "Keep working")
    assert main.isVisible() and not main.close()
    answer(qtbot, main.guard, "Save")
    assert main.isVisible() and not main.close() and main.guard.box is None
    desk.unsaved = False
    desk.saves[0](True)
    assert not main.isVisible() and main.closed == 1
    calm = Main(Desk(unsaved=False))
    qtbot.addWidget(calm)
    calm.show()
    assert calm.close() and calm.closed == 1


# --- the recovery dialog


def test_a_crash_without_work_leaves_its_words(tmp_path):
    crashed(tmp_path, crash="of a session with work")
    held = open_session(tmp_path)
    (held.folder / "crash.txt").write_text(f"Fatal Python error\n{Path.home()}/x.py\n")
    assert last_words(tmp_path) == []  # it runs
    held.release()
    (words,) = last_words(tmp_path)
    problem = problem_of_crash(words)
    assert "Fatal Python error" in problem.report and "numpy: " in problem.report
    assert str(Path.home()) not in problem.report
    assert len(recoverable(tmp_path)) == 1 and last_words(tmp_path) == []


def crashed(root, name="lion.patina", edits=3, saved=1.7e9, crash=""):
    """A session that has ended badly, with a save that is no project."""
    held = open_session(root)
    file = held.next_file()
    held.tell(file, About(name, edits, saved, str(root / name)))
    file.write_bytes(b"x" * 5000)
    if crash:
        (held.folder / "crash.txt").write_text(crash)
    held.release()
    return held.folder


def test_what_is_left_is_listed_and_one_is_chosen(qtbot, tmp_path):
    old = crashed(tmp_path, "old <b>.patina", 1, 1.6e9)
    crashed(tmp_path, "", 12, 1.7e9, "Fatal Python error")
    dialog = RecoveryDialog(recoverable(tmp_path), discard)
    dialog.show()
    qtbot.waitExposed(dialog)
    texts = [dialog.list.item(row).text() for row in range(2)]
    assert texts[0].startswith("Without a name") and "12" in texts[0] and "crash" in texts[0]
    assert texts[1].startswith("old <b>.patina") and "crash" not in texts[1]
    assert dialog.words.isVisible()
    click(qtbot, dialog.words)
    assert QGuiApplication.clipboard().text() == "Fatal Python error"
    second = dialog.list.visualItemRect(dialog.list.item(1)).center()
    qtbot.mouseClick(dialog.list.viewport(), Qt.MouseButton.LeftButton, pos=second)
    assert not dialog.words.isVisible()
    with qtbot.waitSignals([dialog.restore_wanted, dialog.destroyed]):
        dialog.restore_wanted.connect(lambda left: found.append(left.folder))
        found = []
        click(qtbot, dialog.restore)
    assert found == [old] and len(recoverable(tmp_path)) == 2  # the window restores, not we


def test_discarding_asks_first_and_deciding_later_keeps_all(qtbot, tmp_path):
    crashed(tmp_path, "one", saved=1.7e9)
    two = crashed(tmp_path, "two", saved=1.6e9)
    dialog = RecoveryDialog(recoverable(tmp_path), discard)
    dialog.show()
    qtbot.waitExposed(dialog)
    for text, count in (("Keep it", 2), ("Discard", 1)):
        click(qtbot, dialog.drop)
        box = dialog.question
        qtbot.waitExposed(box)
        (button,) = [each for each in box.buttons() if each.text().replace("&", "") == text]
        click(qtbot, button)
        qtbot.waitUntil(lambda: dialog.question is None)
        assert dialog.list.count() == count and len(recoverable(tmp_path)) == count
    assert dialog.chosen.folder == two
    with qtbot.waitSignal(dialog.destroyed):
        click(qtbot, dialog.later)
    assert two.exists()


def test_a_thumbnail_is_shown(qtbot, tmp_path):
    recovery = Recovery(tmp_path, interval_s=0.0)
    recovery.track(worked.painting(), "cow")
    with qtbot.waitSignal(recovery.saved, timeout=60_000):
        recovery.poll()
    recovery.close(keep=True)
    dialog = RecoveryDialog(recoverable(tmp_path), discard)
    dialog.show()
    qtbot.waitExposed(dialog)
    icon = dialog.list.item(0).icon().pixmap(72, 72).toImage()
    colours = {icon.pixel(QPoint(x, y)) for x in range(0, 72, 3) for y in range(0, 72, 3)}
    assert len(colours) > 50
    assert dialog.list.visualItemRect(dialog.list.item(0)).intersects(QRect(0, 0, 400, 90))
    dialog.close()
