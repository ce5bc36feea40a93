"""What the command line shows while it works: phase, share done, time left."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

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
