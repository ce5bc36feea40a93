"""Gives back the memory of mapped files that were read: the system keeps it in its own cache."""

from __future__ import annotations

import mmap
from typing import Any

from btfcore.btf.stack import ImageStack


def release(stack: ImageStack) -> None:
    """Drop from the process the pages of the mapped file behind `stack`, if it is one.

    Nothing is lost: they are read again when asked for. Without this, a file that was read
    through counts as memory of the process until the system runs short.
    """
    array = _array(stack)
    while array is not None:
        mapping, mode = getattr(array, "_mmap", None), getattr(array, "mode", None)
        if isinstance(mapping, mmap.mmap):
            if mode in ("r", "r+", "w+") and hasattr(mmap, "MADV_DONTNEED"):
                mapping.madvise(mmap.MADV_DONTNEED)
            return
        array = getattr(array, "base", None)


def _array(stack: Any) -> Any:
    """Find the array of images behind windows and subsets."""
    for _ in range(100):
        images = getattr(stack, "images", None)
        if images is not None:
            return images
        stack = getattr(stack, "_stack", None)
        if stack is None:
            return None
    return None
