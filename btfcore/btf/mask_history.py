"""Undo and redo of a mask, kept as differences of its bits."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.types import F4

Box = tuple[int, int, int, int]  # left, top, right, bottom; the last two one beyond

_FAST = 1  # level of compression: most of the bits are 0


@dataclass(frozen=True)
class MaskStep:
    """One change: exclusive-or of the bits before and after, within a box, compressed.

    The same difference leads there and back.
    """

    label: str
    box: Box
    bits: bytes


def difference(label: str, before: F4, after: F4) -> MaskStep | None:
    """Step from one mask (H, W) to another; None where they are the same."""
    bits = before.view(np.uint32) ^ after.view(np.uint32)
    rows, columns = np.flatnonzero(bits.any(axis=1)), np.flatnonzero(bits.any(axis=0))
    if len(rows) == 0:
        return None
    box = (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
    return MaskStep(label, box, zlib.compress(bits[window(box)].tobytes(), _FAST))


def across(mask: F4, step: MaskStep) -> F4:
    """Mask on the other side of a step, a new array."""
    out = mask.copy()
    left, top, right, bottom = step.box
    bits: NDArray[np.uint32] = np.frombuffer(zlib.decompress(step.bits), np.uint32)
    out.view(np.uint32)[window(step.box)] ^= bits.reshape(bottom - top, right - left)
    return out


def window(box: Box) -> tuple[slice, slice]:
    """Rows and columns of a box."""
    left, top, right, bottom = box
    return slice(top, bottom), slice(left, right)


class MaskHistory:
    """Steps that can be undone and redone; the oldest are forgotten beyond `most_bytes`."""

    def __init__(self, *, most_bytes: int = 64 << 20) -> None:
        """Start without steps."""
        self._most = most_bytes
        self._done: list[MaskStep] = []
        self._undone: list[MaskStep] = []

    @property
    def size(self) -> int:
        """Bytes held."""
        return sum(len(step.bits) for step in (*self._done, *self._undone))

    @property
    def undo_label(self) -> str | None:
        """What would be undone, or None."""
        return self._done[-1].label if self._done else None

    @property
    def redo_label(self) -> str | None:
        """What would be redone, or None."""
        return self._undone[-1].label if self._undone else None

    def add(self, step: MaskStep) -> None:
        """Keep a step that was just taken; what had been undone is gone."""
        self._undone.clear()
        self._done.append(step)
        total = self.size
        while total > self._most and len(self._done) > 1:
            total -= len(self._done.pop(0).bits)

    def forget_last(self) -> None:
        """Drop the last step, which another one replaces."""
        self._done.pop()

    def undo(self, mask: F4) -> tuple[F4, Box] | None:
        """Mask before the last step, and the box that changed; None where there is none."""
        return self._move(mask, self._done, self._undone)

    def redo(self, mask: F4) -> tuple[F4, Box] | None:
        """Mask after the step that was undone last, and the box that changed, or None."""
        return self._move(mask, self._undone, self._done)

    @staticmethod
    def _move(mask: F4, source: list[MaskStep], target: list[MaskStep]) -> tuple[F4, Box] | None:
        if not source:
            return None
        step = source.pop()
        target.append(step)
        return across(mask, step), step.box
