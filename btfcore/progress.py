"""The one callback that carries progress out of a stage and cancellation in."""

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
