"""Saves a project again and again, killed at each step in turn; run as a program.

    python -m tests.files.project.killed FOLDER [no-links]

A step is each write of a piece, the flush, every fsync, every read and checksum of the
verification, link, rename and removal: the process is killed right before it. Prints one JSON
line per step: its number, its name, and the save found under the project's name and as .bak.
"""

import errno
import io
import json
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

from btfcore.files import atomic
from btfcore.files.project import read, write
from tests.files.project.projects import project

COUNT = {"left": -1, "name": ""}


def step(name):
    """Kill this very process where it is the step's turn."""
    COUNT["left"] -= 1
    if COUNT["left"] == 0:
        os.write(1, name.encode())
        os.kill(os.getpid(), signal.SIGKILL)


class Stepping(io.FileIO):
    """A file without a buffer, each of whose writes is a step."""

    def write(self, data):
        step("write")
        return super().write(data)

    def flush(self):
        step("flush")
        super().flush()


def stepping(module, name):
    """Make a step of every call of a function."""
    inner = getattr(module, name)

    def call(*args, **options):
        step(name)
        return inner(*args, **options)

    setattr(module, name, call)


def opened(folder, prefix=".patina-"):
    """Stand in for `btfcore.files.atomic._temporary`."""
    step("create")
    name = folder / f"{prefix}{os.urandom(8).hex()}.part"
    return Stepping(name, "xb")


def no_links(*_):
    raise OSError(errno.EPERM, "no links here")


def main(folder, links):
    path = folder / "a.patina"
    one = project()
    old = write.write_project(path, one)
    other = replace(one, next_uid=one.next_uid + 1)
    atomic._temporary = opened
    for module, name in (
        (os, "fsync"), (os, "link"), (os, "replace"), (os, "unlink"),
        (read, "check_sum"), (write, "verify"), (atomic, "_sync_folder"), (atomic, "_sweep"),
        (atomic, "_lock"),
    ):  # fmt: skip
        stepping(module, name)
    if not links:
        os.link = no_links
        stepping(atomic.shutil, "copyfile")
    number = 0
    while True:
        number += 1
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.dup2(writer, 1)
            COUNT["left"] = number
            write.write_project(path, other, expected=old)
            os._exit(0)
        os.close(writer)
        with os.fdopen(reader) as pipe:
            name = pipe.read()
        killed = os.WIFSIGNALED(os.waitpid(child, 0)[1])
        found = read.read_project(path)  # raises where the file is not whole
        backup = folder / "a.patina.bak"
        kept = read.read_project(backup).token if backup.exists() else ""
        left = sorted(each.name for each in folder.glob(".patina-*"))
        line = [number, name, found.next_uid - one.next_uid, found.token == old, kept == old]
        sys.stdout.write(json.dumps([*line, len(left)]) + "\n")
        sys.stdout.flush()
        if not killed:
            return
        # the state before, but for what was left behind: that the next save has to clear
        COUNT["left"] = -1
        backup.unlink(missing_ok=True)
        old = write.write_project(path, one)
        backup.unlink()
        assert not list(folder.glob(".patina-*")), "left behind"


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:] != ["no-links"])
