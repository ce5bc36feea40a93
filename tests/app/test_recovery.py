"""What is at work is saved by itself, and comes back after whatever ended the program."""

import errno
import io
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.recovery import Recovery, Restored, discard, recoverable, restore
from app.sessions import MOST_FILES, claim, left_sessions, open_session, sweep
from btfcore.errors import Cancelled, InvalidEdit, InvalidProject
from btfcore.files import atomic
from btfcore.files.project.document import document_of, project_of
from btfcore.files.project.layout import netting
from btfcore.files.project.read import project_preview, read_project
from btfcore.painting import Painting, open_project, save_project
from tests.app import worked
from tests.files.project.projects import differences, project
from tests.paint.scenes import bits, stroke

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def painting():
    """A painting with every kind of edit, made by formula."""
    made = project()
    stone, crack = made.materials
    channels = np.ascontiguousarray(stone.sample.channels[..., :3])
    stone = replace(stone, sample=replace(stone.sample, channels=channels))
    _, net = netting(made.prepared, made.plan, made.parameters)
    made = replace(made, net=net, materials=(stone, crack))
    return Painting(document_of(made), made.materials, made.plan)


@pytest.fixture
def recovery(qtbot, tmp_path):
    """A recovery that is asked to save by hand."""
    made = Recovery(tmp_path / "recovery", interval_s=0.0)
    made._timer.stop()
    yield made
    made.close()


def rename(painting, name):
    """Make an edit that costs nothing."""
    painting.document.change(painting.document.edits[0].uid, name=name)


def save(qtbot, recovery):
    """Let the recovery save now; returns the file."""
    recovery._spent = 0.0  # else it would give a slow disk a rest
    with qtbot.waitSignal(recovery.saved, timeout=60_000) as heard:
        recovery.poll()
    return heard.args[0]


def crash(recovery):
    """End without a clean-up, as the system does it."""
    recovery._timer.stop()
    recovery._writing.wait()
    for held in [recovery._held, *recovery._adopted]:
        if held is not None:
            held.release()
    recovery._held, recovery._adopted = None, []


def names(file):
    return [each.edit.name for each in read_project(file).edits]


# --- when it saves


def test_a_change_is_saved_and_no_change_is_not(qtbot, recovery, painting):
    recovery.track(painting, "box")
    first = save(qtbot, recovery)
    recovery.poll()
    assert not recovery._writing.busy  # nothing has changed
    rename(painting, "one")
    second = save(qtbot, recovery)
    assert second != first and names(second)[0] == "one" and names(first)[0] != "one"
    rename(painting, "two")
    painting.document.undo()
    recovery.poll()
    assert not recovery._writing.busy  # what was undone does not count
    recovery.touch()
    assert save(qtbot, recovery) not in (first, second)


def test_it_saves_no_oftener_than_asked(qtbot, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    recovery.set_interval(3600.0)
    rename(painting, "one")
    recovery.poll()
    assert not recovery._writing.busy
    recovery.set_interval(0.0)
    assert names(save(qtbot, recovery))[0] == "one"


def test_the_timer_saves_without_being_asked(qtbot, tmp_path, painting):
    recovery = Recovery(tmp_path, interval_s=0.1)
    with qtbot.waitSignal(recovery.saved, timeout=60_000):
        recovery.track(painting)
    with qtbot.waitSignal(recovery.saved, timeout=60_000) as heard:
        rename(painting, "later")
    assert names(heard.args[0])[0] == "later"
    recovery.close()
    assert list(tmp_path.iterdir()) == []


def test_every_bit_is_what_the_painting_has(qtbot, recovery, painting):
    recovery.track(painting)
    wanted = project_of(painting.document, painting.materials, painting.plan)
    found = read_project(save(qtbot, recovery))
    assert differences(wanted, replace(found, token=wanted.token, notes=())) == []


def test_in_the_middle_of_a_stroke_the_last_finished_edit_is_saved(qtbot, recovery):
    painting = worked.painting()
    document = painting.document
    document.add(worked.edit(document, 1))
    before = bits(document)
    recovery.track(painting)
    edit = worked.edit(document, 3)
    path = stroke(document, at=500, length=30)
    with pytest.raises(Cancelled):
        # the layers of a painting change only when an edit is finished
        document.add(worked.edit(document, 2), progress=_cancel)
    start = replace(path, points=path.points[:1], normals=path.normals[:1])
    session = document.begin(replace(edit, area=replace(edit.area, strokes=(start,))))
    changed = session.extend(path.points[1:20], path.normals[1:20])
    assert len(changed) and bits(document) != before
    file = save(qtbot, recovery)
    assert bits(open_project(file).document) == before
    with pytest.raises(InvalidEdit, match="painted"):  # half a stroke is no background
        Recovery(recovery.root).track(painting)
    session.finish()
    assert bits(open_project(save(qtbot, recovery)).document) == bits(document) != before


def _cancel(fraction, label):
    raise Cancelled


# --- the user's own file


def test_the_users_file_is_never_touched(qtbot, tmp_path, recovery, painting):
    own = tmp_path / "own.patina"
    save_project(painting, own)
    before, token = own.read_bytes(), painting.token
    recovery.track(painting)
    assert not recovery.unsaved
    rename(painting, "changed")
    assert recovery.unsaved
    file = save(qtbot, recovery)
    assert own.read_bytes() == before and painting.token == token and painting.path == own
    assert sorted(each.name for each in tmp_path.iterdir()) == ["own.patina", "recovery"]
    crash(recovery)
    (left,) = recoverable(recovery.root)
    assert left.saves[0].about.name == "own.patina" and left.saves[0].file == file
    back = restore(left)
    rename(back.painting, "again")
    save_project(back.painting, own)  # the very save that it began with: no `ProjectChanged`
    assert names(own)[0] == "again"
    back.held.remove()


def test_what_the_user_has_saved_needs_no_recovery(qtbot, tmp_path, recovery, painting):
    recovery.track(painting)
    file = save(qtbot, recovery)
    mark = recovery.mark()
    save_project(painting, tmp_path / "own.patina")
    recovery.saved_as(mark, "own.patina")
    assert not file.exists() and not recovery.unsaved
    recovery.poll()
    assert not recovery._writing.busy
    rename(painting, "more")
    assert recovery.unsaved and names(save(qtbot, recovery))[0] == "more"
    painting.document.undo()
    assert not recovery.unsaved
    rename(painting, "even more")
    mark = recovery.mark()
    rename(painting, "while it was saved")
    recovery.saved_as(mark)
    assert recovery.unsaved and names(save(qtbot, recovery))[0] == "while it was saved"


def test_a_file_that_was_only_opened_needs_no_recovery(qtbot, tmp_path, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    save_project(painting, tmp_path / "own.patina")
    recovery.track(open_project(tmp_path / "own.patina"))
    recovery.poll()
    assert not recovery._writing.busy and not list(recovery._held.folder.glob("*.patina"))
    recovery.track(None)
    recovery.poll()
    assert not recovery._writing.busy and not recovery.unsaved


# --- what comes back


def test_it_comes_back_with_all_that_is_known(qtbot, tmp_path, recovery, painting):
    recovery._extra = lambda: {"lamps": [1, 2.5], "mode": "lit"}
    recovery.track(painting, "Box ⛏")
    file = save(qtbot, recovery)
    preview = project_preview(file)
    assert preview is not None and preview.startswith(b"\x89PNG")
    assert recoverable(recovery.root) == []  # its own session runs
    crash(recovery)
    (left,) = recoverable(recovery.root)
    about, size = left.saves[0].about, left.saves[0].size
    assert (about.name, about.edits, size) == ("Box ⛏", 5, file.stat().st_size)
    back = restore(left)
    assert isinstance(back, Restored) and back.notes == ()
    assert back.name == "Box ⛏" and back.extra == {"lamps": [1, 2.5], "mode": "lit"}
    assert back.painting.path is None and back.painting.token == ""
    assert bits(back.painting.document) == bits(painting.document)
    back.held.remove()


def test_what_was_restored_stays_until_it_is_saved_again(qtbot, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    crash(recovery)
    (left,) = recoverable(recovery.root)
    other = Recovery(recovery.root, interval_s=0.0)
    other._timer.stop()
    back = restore(left)
    other.track(back.painting, restored=back)
    assert other.unsaved and left.saves[0].file.exists()
    crash(other)  # before it was saved: nothing is lost
    (left,) = recoverable(recovery.root)
    third = Recovery(recovery.root, interval_s=0.0)
    third._timer.stop()
    back = restore(left)
    third.track(back.painting, restored=back)
    file = save(qtbot, third)
    assert not left.folder.exists() and file.exists()
    third.close()
    assert list(recovery.root.iterdir()) == []


def test_a_damaged_save_gives_way_to_the_one_before(qtbot, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    rename(painting, "newest")
    file = save(qtbot, recovery)
    crash(recovery)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    (left,) = recoverable(recovery.root)
    assert left.saves[0].file == file and len(left.saves) == 2
    back = restore(left)
    assert file.name in back.notes[0] and back.painting.document.edits[0].name != "newest"
    back.held.release()
    left.saves[1].file.write_bytes(b"")
    with pytest.raises(InvalidProject, match=file.name):
        restore(left)
    claim(left.folder).release()  # it was let go


def test_restoring_can_be_cancelled(qtbot, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    crash(recovery)
    (left,) = recoverable(recovery.root)
    with pytest.raises(Cancelled):
        restore(left, progress=_cancel)
    assert len(recoverable(recovery.root)) == 1 and discard(left)


@pytest.mark.parametrize(
    "text",
    ["", "[", "[]", '{"name": 3}', "[" * 100_000, '{"name":"a","edits":1,"saved":1e300,"path":"",'
     '"token":"","extra":{}}', '{"name":"a","edits":"1","saved":1,"path":"","token":"","extra":{}}',
     '{"name":"a","edits":1,"saved":NaN,"path":"","token":"","extra":{}}'],
)  # fmt: skip
def test_a_broken_note_beside_a_save_loses_nothing(qtbot, recovery, painting, text):
    recovery.track(painting, "lost name")
    file = save(qtbot, recovery)
    crash(recovery)
    file.with_suffix(".json").write_text(text)
    (left,) = recoverable(recovery.root)
    assert left.saves[0].about.name == "" and left.saves[0].about.saved == file.stat().st_mtime
    back = restore(left)
    assert bits(back.painting.document) == bits(painting.document) and back.painting.path is None
    back.held.remove()


def test_extras_that_cannot_be_kept_do_not_stop_the_saving(qtbot, recovery, painting):
    broke = []
    recovery.broke.connect(lambda name, problem: broke.append((name, problem.sentence)))
    recovery._extra = lambda: {"window": recovery}
    recovery.track(painting)
    assert save(qtbot, recovery).exists()
    recovery._extra = lambda: {"far": "too long" * 100_000}
    recovery.touch()
    assert save(qtbot, recovery).exists()
    assert [name for name, _ in broke] == ["autosave"] * 2 and "TypeError" in broke[0][1]


# --- several at once


def test_two_sessions_do_not_see_each_other(qtbot, tmp_path, painting):
    one, two = (Recovery(tmp_path, interval_s=0.0) for _ in range(2))
    for each in (one, two):
        each._timer.stop()
        each.track(painting)
        save(qtbot, each)
    assert one._held.folder != two._held.folder and recoverable(tmp_path) == []
    assert claim(one._held.folder, patience_s=0.0) is None
    code = (
        "import sys; from pathlib import Path; from app.sessions import *\n"
        "root = Path(sys.argv[1]); sweep(root)\n"
        "print(len(left_sessions(root)), *[claim(each, patience_s=0) for each in root.iterdir()])"
    )

    def other():
        command = [sys.executable, "-c", code, str(tmp_path)]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout.split()

    assert other() == ["0", "None", "None"]
    crash(one)
    found = other()
    assert found[0] == "1" and sorted(each == "None" for each in found[1:]).count(True) == 1
    two.close()
    assert [left.folder for left in recoverable(tmp_path)] == list(tmp_path.iterdir())


def test_only_one_of_two_takes_what_is_left(qtbot, recovery, painting):
    recovery.track(painting)
    save(qtbot, recovery)
    crash(recovery)
    (left,) = recoverable(recovery.root)
    back = restore(left)
    with pytest.raises(InvalidProject, match="another"):
        restore(left)
    assert not discard(left) and left.saves[0].file.exists() and recoverable(recovery.root) == []
    back.held.release()
    assert discard(left) and not left.folder.exists()
    assert discard(left)  # gone is gone


def test_a_folder_that_is_swept_while_it_is_made_is_made_again(tmp_path, monkeypatch):
    import app.sessions as sessions

    inner, swept = sessions._locked, []

    def slow(handle, folder, shared):
        if not swept:  # another start finds the folder before it is locked
            swept.append(folder)
            sweep(tmp_path)
        return inner(handle, folder, shared)

    monkeypatch.setattr(sessions, "_locked", slow)
    held = open_session(tmp_path)
    assert held.whole and held.folder != swept[0] and not swept[0].exists()
    held.remove()


def test_without_locks_the_process_is_looked_up(tmp_path, monkeypatch):
    import app.sessions as sessions

    def refuse(*_):
        raise OSError(errno.ENOLCK, "no locks")

    held = open_session(tmp_path)
    held.next_file().write_bytes(b"work")
    monkeypatch.setattr(sessions.fcntl, "flock", refuse)
    assert left_sessions(tmp_path) == []  # this process runs
    info = json.loads((held.folder / "session.json").read_text())
    for change, seen in (
        ({"started": "another boot"}, 1), ({"pid": 2**22 + 1}, 1), ({"host": "elsewhere"}, 0),
        ({"pid": "x"}, 0),
    ):  # fmt: skip
        (held.folder / "session.json").write_text(json.dumps(info | change))
        assert len(left_sessions(tmp_path)) == seen, change
    held.remove()


class Byte:
    """Stand-in for Windows' locks of bytes of files: others, also of this process, are refused."""

    LK_NBLCK = 2

    def __init__(self):
        self.held = {}

    def locking(self, descriptor, mode, count):
        assert (mode, count) == (Byte.LK_NBLCK, 1)
        key = os.fstat(descriptor).st_ino
        try:
            if self.held.get(key, descriptor) != descriptor and os.fstat(self.held[key]):
                raise PermissionError(errno.EACCES, "locked")
        except OSError as error:
            if error.errno != errno.EBADF:  # closing a file lets go of its locks
                raise
        self.held[key] = descriptor


def test_locks_of_bytes_serve_where_there_are_no_others(tmp_path, monkeypatch):
    import app.sessions as sessions

    monkeypatch.setattr(sessions, "fcntl", None)
    monkeypatch.setattr(sessions, "msvcrt", Byte(), raising=False)
    held = open_session(tmp_path)
    held.next_file().write_bytes(b"work")
    assert claim(held.folder, patience_s=0.0) is None and left_sessions(tmp_path) == []
    held.release()
    (left,) = left_sessions(tmp_path)
    other = claim(left.folder)
    assert other.whole and claim(left.folder, patience_s=0.0) is None
    other.remove()
    assert list(tmp_path.iterdir()) == []


# --- bounds


def test_a_session_keeps_two_files(qtbot, recovery, painting):
    recovery.track(painting)
    for number in range(4):
        rename(painting, f"edit {number}")
        save(qtbot, recovery)
        assert len(list(recovery._held.folder.glob("*.patina"))) <= MOST_FILES
        assert len(list(recovery._held.folder.glob("0*.json"))) <= MOST_FILES
    files = sorted(recovery._held.folder.glob("*.patina"))
    assert [names(file)[0] for file in files] == ["edit 2", "edit 3"]


def test_the_oldest_sessions_go(tmp_path):
    for number in range(6):
        held = open_session(tmp_path)
        file = held.next_file()
        file.write_bytes(b"work")
        os.utime(file, (1000 + number, 1000 + number))
        held.release()
    empty = open_session(tmp_path)
    empty.release()
    running = open_session(tmp_path)
    sweep(tmp_path, most=4)
    kept = [left.saves[0].about.saved for left in left_sessions(tmp_path)]
    assert kept == [1005, 1004, 1003, 1002]
    assert not empty.folder.exists() and running.whole
    running.remove()


@pytest.mark.parametrize("keep", [False, True])
def test_a_clean_end_leaves_nothing_unless_it_is_asked_to(qtbot, tmp_path, painting, keep):
    recovery = Recovery(tmp_path, interval_s=0.0)
    recovery._timer.stop()
    recovery.track(painting)
    save(qtbot, recovery)
    rename(painting, "on its way")
    recovery.poll()
    recovery.close(keep=keep)  # while it is being written
    assert len(recoverable(tmp_path)) == keep and len(list(tmp_path.iterdir())) == keep
    assert not list(tmp_path.glob("*/.patina-*"))


# --- when the disk says no


class Full(io.FileIO):
    """A file on a disk with `space` bytes left."""

    space = 0

    def write(self, data):
        size = memoryview(data).nbytes
        if size > Full.space:
            raise OSError(errno.ENOSPC, "No space left on device")
        Full.space -= size
        return super().write(data)


def heard(recovery):
    told = []
    recovery.failed.connect(lambda text: told.append(("failed", text)))
    recovery.noted.connect(lambda text: told.append(("noted", text)))
    return told


def attempt(qtbot, recovery):
    """Let it try; ends when it has tried."""
    recovery._spent = 0.0
    with qtbot.waitSignal(recovery._writing.idle, timeout=60_000):
        recovery.poll()


def test_a_full_disk_is_told_once_and_loses_nothing(qtbot, recovery, painting, monkeypatch):
    told = heard(recovery)
    recovery.track(painting)
    first = save(qtbot, recovery)
    size, before = first.stat().st_size, bits(painting.document)
    inner = atomic._temporary

    def opened(folder, prefix=".patina-"):
        return Full(folder / f"{prefix}{os.urandom(8).hex()}.part", "xb")

    monkeypatch.setattr(atomic, "_temporary", opened)
    rename(painting, "unsaved")
    for space in (0, 100, 600, *np.linspace(1000, size - 1, 12).astype(int)):  # at each write
        Full.space = int(space)
        attempt(qtbot, recovery)
        assert read_project(first).edits and not list(first.parent.glob(".patina-*"))
    assert [kind for kind, _ in told] == ["failed"] and "disk is full" in told[0][1]
    assert bits(painting.document) == before and recovery.unsaved
    rename(painting, "work goes on")
    monkeypatch.setattr(atomic, "_temporary", inner)
    assert names(save(qtbot, recovery))[0] == "work goes on"
    assert [kind for kind, _ in told] == ["failed", "noted"]


def test_a_folder_that_vanishes_is_made_again(qtbot, recovery, painting):
    told = heard(recovery)
    recovery.track(painting)
    first = save(qtbot, recovery)
    shutil.rmtree(recovery.root)
    rename(painting, "one")
    file = save(qtbot, recovery)
    assert file.parent != first.parent and names(file)[0] == "one" and told == []


def test_a_folder_that_cannot_be_made_is_told_once(qtbot, tmp_path, painting):
    place = tmp_path / "recovery"
    place.write_text("a file is in the way")
    recovery = Recovery(place, interval_s=0.0)
    recovery._timer.stop()
    told = heard(recovery)
    recovery.track(painting)
    for _ in range(3):
        attempt(qtbot, recovery)
    assert len(told) == 1 and str(place) in told[0][1]
    assert recoverable(place) == []
    place.unlink()
    assert save(qtbot, recovery).exists() and told[-1][0] == "noted"
    recovery.close()


# --- real ends


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork and SIGKILL")
def test_killed_at_any_moment(tmp_path):
    command = [sys.executable, "-m", "tests.app.worked", str(tmp_path), "6"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    rounds = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rounds) == 6 and max(each["done"] for each in rounds) > 2
    for each in rounds:
        assert each["saved"] >= 0 and each["failed"] == []
        assert each["restored"] >= each["saved"] and each["restored"] == each["told"]
        assert each["restored"] <= each["done"] + 1  # one may be finished and not yet told
        assert each["same"] and each["hidden"] == 0 and each["left"] == []


def test_the_last_words_of_a_crash_are_kept(tmp_path):
    code = (
        "import faulthandler, sys; from pathlib import Path\n"
        "from PyQt6.QtCore import QCoreApplication; from app.recovery import Recovery\n"
        "application = QCoreApplication([])\n"
        "place = Path(sys.argv[1]) / 'a' / 'b'; place.parent.write_text('in the way')\n"
        "recovery = Recovery(place); recovery._timer.stop(); recovery.watch_crashes()\n"
        "assert recovery._held is None\n"
        "place.parent.unlink(); held = recovery._hold(); recovery._watch()\n"
        "held.next_file().write_bytes(b'work')\n"
        "getattr(faulthandler, '_sigsegv')()\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode < 0, done.stderr
    (left,) = recoverable(tmp_path / "a" / "b")
    assert "Segmentation fault" in left.crash and "<module>" in left.crash
