"""What the command line shows while it works: phase, share done, time left."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import typer

from btfcore.errors import Cancelled
from btfcore.progress import Progress, silent


def say(text: str, *, error: bool = False) -> None:
    """Print a line for the user."""
    typer.echo(text, err=error)


@contextmanager
def reporter(*, quiet: bool) -> Iterator[Progress]:
    """Progress callback that draws a bar on stderr; silent when `quiet` or no terminal."""
    if quiet or not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description:<10}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("start", total=1.0)

        def progress(fraction: float, label: str) -> None:
            bar.update(task, completed=fraction, description=label)

        yield progress


@contextmanager
def stoppable(progress: Progress) -> Iterator[Progress]:
    """Turn Ctrl-C and SIGTERM into `Cancelled` at the next call of the progress yielded.

    Work is thus left between two steps, in order, and what there is can still be saved. A
    second signal interrupts at once.
    """
    asked = threading.Event()

    def ask(number: int, frame: FrameType | None) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    def inner(fraction: float, label: str) -> None:
        if asked.is_set():
            raise Cancelled
        progress(fraction, label)

    if threading.current_thread() is not threading.main_thread():  # signals are not ours there
        yield progress
        return
    before = {each: signal.signal(each, ask) for each in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield inner
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
