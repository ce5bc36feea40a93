"""Saves the painting at work by itself, and gives back what a crash would have taken.

What is saved is taken without stopping anything (see `app.snapshots`), so the last finished edit
is saved also while a stroke is drawn or a long edit is computed. The user's own file is never
written.
"""

from __future__ import annotations

import faulthandler
import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from PyQt6.QtCore import QCoreApplication, QObject, QStandardPaths, QTimer, pyqtSignal

from app.reports import problem_of
from app.sessions import (
    CRASH,
    LARGEST_TEXT,
    MOST_FILES,
    About,
    Held,
    Left,
    claim,
    left_sessions,
    open_session,
    sweep,
)
from app.snapshots import Mark, picture_at, project_at
from app.tasks import Report, Tasks
from btfcore.errors import InvalidProject, OutputFailed
from btfcore.files.project.document import background_of
from btfcore.files.project.write import write_project
from btfcore.painting import Painting, open_project
from btfcore.progress import Progress, silent
from btfcore.quilt.state import QuiltState

INTERVAL_S = 30.0
THUMBNAIL = 256  # pixels a side
_POLL_S = 1.0
_SHARE = 2.0  # writing may take 1/2 of the time where the disk is very slow


@dataclass(frozen=True, eq=False)
class Restored:
    """A painting that was given back; `held` is where it lies until it is saved again.

    extra : what the window handed over when it was saved; notes : sentences for the user.
    """

    painting: Painting
    name: str
    held: Held
    extra: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


class Recovery(QObject):
    """Saves one window's painting into a folder of its own, at most every so often.

    failed(text): once when saving begins to fail; noted(text): it goes well again ;
    saved(path): after each save. `broke` is the one of `Tasks`.
    """

    failed = pyqtSignal(str)
    noted = pyqtSignal(str)
    saved = pyqtSignal(object)
    broke = pyqtSignal(str, object)

    def __init__(
        self,
        folder: Path | None = None,
        *,
        interval_s: float = INTERVAL_S,
        extra: Callable[[], Mapping[str, Any]] = dict,
        parent: QObject | None = None,
    ) -> None:
        """Save below `folder` (None: `default_folder`).

        extra : plain values, fit for JSON, that are kept beside the painting, such as lights.
        """
        super().__init__(parent)
        self.root = default_folder() if folder is None else folder
        self._extra = extra
        self._held: Held | None = None
        self._adopted: list[Held] = []
        self._name = ""
        self._painting: Painting | None = None
        self._background: QuiltState | None = None
        self._touched = 0
        self._stored = Mark()  # what the newest file holds
        self._safe = Mark()  # what the user's own file holds
        self._begun, self._spent = -float("inf"), 0.0
        self._failing = False
        self._watching = self._watched_before = False
        self._words: TextIO | None = None
        self._writing = Tasks(self)
        self._writing.finished.connect(self._finish)
        self._writing.failed.connect(self._fail)
        self._writing.broke.connect(self.broke)
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.poll)
        self.set_interval(interval_s)
        self._timer.start()

    # --- what the window tells

    def set_interval(self, seconds: float) -> None:
        """Save at most that often, and no later than that after a change."""
        self._interval = seconds
        self._timer.setInterval(max(10, round(min(_POLL_S, seconds / 4) * 1000)))

    def track(
        self,
        painting: Painting | None,
        name: str = "",
        *,
        background: QuiltState | None = None,
        restored: Restored | None = None,
    ) -> None:
        """Look after another painting from now on, None: after none.

        What was saved of the last one goes as soon as this one is saved or needs no saving. To be
        called while nothing changes the painting. background : what
        `btfcore.files.project.document.background_of` gives; where it is not at hand it is
        copied here, which takes about a millisecond for every 100,000 vertices. restored : where
        the painting comes from, whose folder is kept until the painting is saved again. Raises
        `InvalidEdit` while a stroke is being drawn.
        """
        if painting is not None and background is None:
            background = background_of(painting.document)
        opened = painting is not None and painting.path is not None and restored is None
        self._painting, self._background = painting, background
        self._name = name or (painting.path.name if painting and painting.path else "")
        self._safe = self.mark() if opened or painting is None else Mark()
        self._stored = Mark()
        if restored is not None:
            self._adopted.append(restored.held)
        self._begun = -float("inf")
        if self._safe.same(self.mark()):
            self._drop()

    def touch(self) -> None:
        """Say that something outside the painting is to be saved too."""
        self._touched += 1

    def mark(self) -> Mark:
        """The painting as it is now, for `saved_as` later; cheap."""
        if self._painting is None:
            return Mark()
        return Mark.of(self._painting, self._touched)

    def saved_as(self, mark: Mark, name: str = "") -> None:
        """Say that the user's own file now holds `mark`, taken when its saving began."""
        self._safe, self._name = mark, name or self._name
        if mark.same(self.mark()):
            self._drop()

    @property
    def unsaved(self) -> bool:
        """The painting is not as the user's own file has it."""
        return not self._safe.same(self.mark())

    def watch_crashes(self) -> None:
        """Let the interpreter write its last words into the folder, should it be killed by itself.

        That is one thing for the whole process, so for one window of it. Without a folder it is
        done as soon as there is one.
        """
        if not self._watching:
            self._watching, self._watched_before = True, faulthandler.is_enabled()
        try:
            self._hold()
        except OutputFailed:
            return  # said when there is something to save
        self._watch()

    def close(self, *, keep: bool = False) -> None:
        """End well: stop saving and remove the folder; `keep` leaves it for the next start."""
        self._timer.stop()
        self._writing.close()
        self._watching = False
        if self._words is not None:
            faulthandler.disable()
            self._words.close()
            self._words = None
            if self._watched_before and sys.__stderr__ is not None:
                faulthandler.enable(sys.__stderr__)
        for held in [*self._adopted, *([self._held] if self._held else [])]:
            if keep:
                held.release()
            else:
                held.remove()
        self._adopted, self._held, self._painting = [], None, None
        self._background = None

    # --- saving

    def poll(self) -> None:
        """Begin to save where it is time to; the timer calls this."""
        now, mark = time.monotonic(), self.mark()
        wait = max(self._interval, _SHARE * self._spent)
        if self._writing.busy or now - self._begun < wait or mark.same(self._stored):
            return
        if mark.painting is None or mark.same(self._safe):
            return
        assert self._background is not None
        self._begun = now
        project = project_at(mark, self._background)
        grids = mark.painting.document.engine.palette.sheet
        about = About(
            self._name, len(mark.layers), time.time(),
            "" if mark.painting.path is None else str(mark.painting.path.absolute()),
            mark.painting.token, self._extras(),
        )  # fmt: skip

        def job(progress: Progress, report: Report) -> tuple[Mark, Path]:
            progress(0.0, "saving")
            held = self._hold()
            held.prune(MOST_FILES - 1)  # so that there are never more on the disk
            file = held.next_file()
            held.tell(file, about)
            preview = picture_at(project, mark, grids, side=THUMBNAIL)
            write_project(file, project, preview=preview, progress=progress)
            held.prune()
            return mark, file

        self._writing.start("autosave", job, harmless=False)

    def _extras(self) -> dict[str, Any]:
        """What the window wants kept; a defect there must not stop the painting's saving."""
        try:
            text = json.dumps(dict(self._extra()))
            if len(text) > LARGEST_TEXT // 2:
                raise ValueError(f"{len(text):,} characters of extras to save")
            return json.loads(text)
        except Exception as error:
            self.broke.emit("autosave", problem_of(error, "autosave"))
            return {}

    def _hold(self) -> Held:
        """The folder of this session, a new one where it has vanished; raises `OutputFailed`."""
        if self._held is None or not self._held.whole:
            if self._held is not None:
                self._held.release()
                self._held = None
            self._held = open_session(self.root)
        return self._held

    def _watch(self) -> None:
        """Let the last words go to the folder that is held now; an older one may have vanished."""
        words, held = self._words, self._held
        if not self._watching or held is None:
            return
        if words is not None and Path(words.name).parent == held.folder:
            return
        try:
            self._words = (held.folder / CRASH).open("w", encoding="utf-8")
        except OSError:
            return
        faulthandler.enable(self._words, all_threads=True)
        if words is not None:
            words.close()

    def _finish(self, name: str, value: tuple[Mark, Path]) -> None:
        mark, file = value
        self._spent = time.monotonic() - self._begun
        if self._failing:
            self._failing = False
            self.noted.emit(self.tr("Saving automatically works again."))
        if mark.painting is not self._painting:  # another was taken up meanwhile
            if self._safe.same(self.mark()):
                self._drop()
            return
        self._stored = mark
        self._watch()
        self._let_go_of_adopted()
        if self._safe.same(self.mark()):
            self._drop()
        self.saved.emit(file)

    def _fail(self, name: str, text: str) -> None:
        self._spent = time.monotonic() - self._begun
        if not self._failing:
            self._failing = True
            told = self.tr(
                "Your work cannot be saved automatically: {0}. Patina keeps trying; save it"
                " yourself with File → Save."
            )
            self.failed.emit(told.format(text.rstrip(".")))

    def _drop(self) -> None:
        """Remove what was saved, as it is of no use any more."""
        self._stored = Mark()
        self._let_go_of_adopted()
        if self._held is not None and not self._writing.busy:
            self._held.prune(0)

    def _let_go_of_adopted(self) -> None:
        for held in self._adopted:
            held.remove()
        self._adopted = []


def default_folder() -> Path:
    """Where this user's recovery files lie."""
    place = QStandardPaths.StandardLocation.GenericDataLocation
    return Path(QStandardPaths.writableLocation(place)) / "Patina" / "recovery"


def recoverable(folder: Path | None = None) -> list[Left]:
    """What crashed sessions left, the newest first; clears away what is too old to be kept."""
    root = default_folder() if folder is None else folder
    sweep(root)
    return left_sessions(root)


def discard(left: Left) -> bool:
    """Remove what a session left; False where another Patina has taken it up."""
    held = claim(left.folder, patience_s=0.08)
    if held is None:
        return not left.folder.exists()
    held.remove()
    return True


def restore(left: Left, *, progress: Progress = silent) -> Restored:
    """Read the newest save of a crashed session that can be read; to be called in a job.

    Its folder is held from then on: hand what comes out to `Recovery.track`, or `release` its
    `held`. Raises `InvalidProject` where none can be read, or another Patina has taken it up;
    then everything stays where it was.
    """
    held = claim(left.folder)
    if held is None:
        raise InvalidProject(_tr("another Patina has taken up this work already"))
    notes: list[str] = []
    try:
        for save in left.saves:
            try:
                painting = open_project(save.file, progress=progress)
            except InvalidProject as error:
                notes.append(_tr("An automatic save cannot be read: {0}").format(error))
                continue
            about = save.about
            painting.path = Path(about.path) if about.path else None
            painting.token = about.token
            return Restored(painting, about.name, held, about.extra, tuple(notes))
    except BaseException:
        held.release()
        raise
    held.release()
    raise InvalidProject(" ".join(notes) or _tr("nothing is left of this work"))


def _tr(text: str) -> str:
    return QCoreApplication.translate("Recovery", text)
