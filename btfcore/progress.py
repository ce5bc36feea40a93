"""The one callback that carries progress out of a stage and cancellation in."""

from collections.abc import Iterator
from typing import Protocol


class Progress(Protocol):
    """Called as ``progress(fraction, label)``; may raise `btfcore.errors.Cancelled`.

    `fraction` runs from 0 to 1 within the stage; `label` names what is being done.
    """

    def __call__(self, fraction: float, label: str) -> None:
        """Report `fraction` of the stage as done."""


def silent(fraction: float, label: str) -> None:
    """Ignore progress."""


def between(progress: Progress, start: float, stop: float) -> Progress:
    """Map a sub-stage's 0–1 onto `start`–`stop` of `progress`."""

    def inner(fraction: float, label: str) -> None:
        progress(start + (stop - start) * fraction, label)

    return inner


def blocks(
    count: int, size: int, progress: Progress, label: str, start: float = 0.0, stop: float = 1.0
) -> Iterator[tuple[int, int]]:
    """Ranges (begin, end) of at most `size` that make up 0 … count, with a call before each.

    For loops too long to leave the caller unheard: a kernel does one range at a time.
    """
    for begin in range(0, count, size):
        progress(start + (stop - start) * begin / count, label)
        yield begin, min(begin + size, count)
