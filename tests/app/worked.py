"""Works on a painting until it is killed, again and again, and looks what can be restored.

    python -m tests.app.worked FOLDER ROUNDS

Each round is a process that makes edits one after the other in a worker thread, while its
recovery saves; it is killed at a random moment. Prints one JSON line per round: how many edits
the last save that was told of has, how many were told to be finished, how many were restored,
whether the restored surface has every bit of one with just these edits, and what is left after
it was saved again and ended well.
"""

import json
import os
import random
import select
import signal
import sys
import time
from pathlib import Path

from PyQt6.QtCore import QCoreApplication, QTimer

from app.recovery import Recovery, recoverable, restore
from app.tasks import Tasks
from btfcore.files.project.value import Material
from btfcore.paint.edits import PaintEdit, StampEdit
from btfcore.painting import Painting
from tests.paint.scenes import bits, document, dot

INTERVAL_S = 0.2
MOST = 60


def painting():
    """A small surface without edits."""
    made = document(rate=64)
    return Painting(made, tuple(Material(each.name, each) for each in made.samples))


def edit(made, number):
    """The edit of that number, the same in every process."""
    vertex = number * 97 % len(made.prepared.dense.vertices)
    if number % 3:
        point = tuple(made.prepared.dense.vertices[vertex].tolist())
        return StampEdit(point=point, sample=1, feature=number % 3 - 1)
    return PaintEdit(area=dot(made, vertex), sample=0)


def work(root, subject, out):
    """Edit for ever; told is what a user would have seen."""
    application = QCoreApplication([])
    recovery = Recovery(root, interval_s=INTERVAL_S)
    tasks = Tasks()
    count = 0

    def tell(kind, number):
        os.write(out, f"{kind} {number}\n".encode())

    def following():
        nonlocal count
        if count < MOST:
            count += 1
            wanted = edit(subject.document, count)
            tasks.start("edit", lambda progress, report: subject.document.add(wanted))

    tasks.finished.connect(lambda name, value: tell("done", len(subject.document.layers)))
    tasks.idle.connect(following)
    recovery.saved.connect(lambda path: tell("saved", len(recovery._stored.layers)))
    recovery.failed.connect(lambda text: tell("failed", text))
    recovery.track(subject, "child")
    QTimer.singleShot(0, following)
    application.exec()


def killed(root, subject, chance):
    """Run `work` in a process and kill it after its first save; returns what it told."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        work(root, subject, writer)
        os._exit(1)
    os.close(writer)
    text, end = b"", None
    while end is None or time.monotonic() < end:
        left = 60.0 if end is None else max(0.0, end - time.monotonic())
        if not select.select([reader], [], [], left)[0]:
            if end is None:
                break
            continue
        piece = os.read(reader, 65536)
        if not piece:
            break
        text += piece
        if end is None and b"saved" in text:
            end = time.monotonic() + chance.uniform(0.0, 1.5)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while piece := os.read(reader, 65536):
        text += piece
    os.close(reader)
    return [line.split(" ", 1) for line in text.decode().splitlines()]


def expected(number):
    """The surface with that many edits, bit by bit."""
    made = painting().document
    for each in range(number):
        made.add(edit(made, each + 1))
    return bits(made)


def main(root, rounds):
    subject, chance = painting(), random.Random(7)
    for _ in range(rounds):
        told = killed(root, subject, chance)
        saved = max((int(n) for kind, n in told if kind == "saved"), default=-1)
        done = max((int(n) for kind, n in told if kind == "done"), default=0)
        found = recoverable(root)
        assert len(found) == 1, found
        back = restore(found[0])
        layers = len(back.painting.document.layers)
        same = bits(back.painting.document) == expected(layers)
        hidden = len(recoverable(root))  # it is being looked after
        back.held.remove()
        left = sorted(each.name for each in root.iterdir())
        line = {"saved": saved, "done": done, "restored": layers, "same": same,
                "told": found[0].saves[0].about.edits, "hidden": hidden, "left": left,
                "failed": [n for kind, n in told if kind == "failed"]}  # fmt: skip
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
