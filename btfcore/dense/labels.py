"""Charts as labels of faces: connected parts, common borders, absorption, bisection."""

from __future__ import annotations

import numpy as np
from numba import njit

from btfcore.types import F8, I4, I8


def connected(label: I4, twin: I4) -> I4:
    """Number the connected parts of faces with equal label, in order of first appearance."""
    return _connected(label, twin)


def fill(label: I4, twin: I4) -> I4:
    """Give faces labelled -1 the label of their nearest labelled face, breadth first.

    A component without any label gets one of its own.
    """
    return _fill(label.copy(), twin, int(label.max()) + 1)


def smooth(label: I4, twin: I4, *, rounds: int = 3) -> I4:
    """Take off teeth: a face with two neighbours of one other label joins them."""
    out = label.copy()
    _smooth(out, twin, rounds)
    return out


def borders(label: I4, twin: I4, length: F8) -> tuple[I8, I8, F8]:
    """Pairs of labels (a, b), both ways, that share a border, and how long it is.

    length : (3F,) f8 of every half-edge. Sorted by (a, b).
    """
    here = np.flatnonzero(twin >= 0)
    one, two = label[here // 3].astype(np.int64), label[twin[here] // 3].astype(np.int64)
    apart = one != two
    count = int(label.max()) + 1
    key, inverse = np.unique(one[apart] * count + two[apart], return_inverse=True)
    shared: F8 = np.bincount(inverse, length[here[apart]], len(key)).astype(np.float64)
    return key // count, key % count, shared


def absorb(label: I4, twin: I4, area: F8, length: F8, *, least: float) -> I4:
    """Join parts smaller than `least` to the neighbour with the longest common border.

    The smallest go first; parts without neighbours stay. area (F,), length (3F,).
    """
    label = connected(label, twin)
    while True:
        count = int(label.max()) + 1
        size = np.bincount(label, area, count)
        a, b, shared = borders(label, twin, length)
        small = np.flatnonzero(size[a] < least)
        if len(small) == 0:
            return label
        # The longest border of each small part; ties go to the lower number.
        small = small[np.lexsort((b[small], -shared[small], a[small]))]
        small = small[np.unique(a[small], return_index=True)[1]]
        target = np.arange(count)
        for at in small[np.lexsort((a[small], size[a[small]]))]:
            if target[b[at]] == b[at] and target[a[at]] == a[at]:
                target[a[at]] = b[at]
        while not np.array_equal(target, target[target]):
            target = target[target]
        label = connected(target[label].astype(np.int32), twin)


def bisect(label: I4, twin: I4, chosen: I4, seeds: I4) -> I4:
    """Cut the parts `chosen` in two: faces nearer to the one or the other of two seed faces.

    seeds : (len(chosen), 2) i4; equal or negative seeds mean the two ends of the part.
    New halves get labels beyond the largest there is.
    """
    out = label.copy()
    order = np.argsort(label, kind="stable").astype(np.int32)
    start = np.searchsorted(label[order], chosen)
    stop = np.searchsorted(label[order], chosen, side="right")
    _bisect(out, twin, chosen, seeds, order, start, stop, int(label.max()) + 1)
    return out


@njit(cache=True)
def _connected(label: I4, twin: I4) -> I4:
    out = np.full(len(label), -1, np.int32)
    stack = np.empty(len(label), np.int32)
    count = 0
    for seed in range(len(label)):
        if out[seed] >= 0:
            continue
        out[seed] = count
        stack[0] = seed
        top = 1
        while top > 0:
            top -= 1
            f = stack[top]
            for k in range(3):
                g = twin[3 * f + k] // 3 if twin[3 * f + k] >= 0 else -1
                if g >= 0 and out[g] < 0 and label[g] == label[f]:
                    out[g] = count
                    stack[top] = g
                    top += 1
        count += 1
    return out


@njit(cache=True)
def _fill(label: I4, twin: I4, fresh: int) -> I4:
    queue = np.empty(len(label), np.int32)
    tail = 0
    for f in range(len(label)):
        if label[f] >= 0:
            queue[tail] = f
            tail += 1
    head = 0
    for seed in range(len(label) + 1):
        while head < tail:
            f = queue[head]
            head += 1
            for k in range(3):
                other = twin[3 * f + k]
                if other >= 0 and label[other // 3] < 0:
                    label[other // 3] = label[f]
                    queue[tail] = other // 3
                    tail += 1
        if seed < len(label) and label[seed] < 0:
            label[seed] = fresh
            fresh += 1
            queue[tail] = seed
            tail += 1
    return label


@njit(cache=True)
def _smooth(label: I4, twin: I4, rounds: int) -> None:
    for _ in range(rounds):
        changed = False
        for f in range(len(label)):
            near = np.full(3, -1, np.int32)
            for k in range(3):
                if twin[3 * f + k] >= 0:
                    near[k] = label[twin[3 * f + k] // 3]
            for k in range(3):
                one = near[k]
                if one >= 0 and one == near[(k + 1) % 3] and one != label[f]:
                    label[f] = one
                    changed = True
                    break
        if not changed:
            break


@njit(cache=True)
def _flood(label: I4, twin: I4, seed: int, mark: I4, stamp: int, queue: I4) -> int:
    """Last face that a breadth-first search within the seed's label reaches."""
    queue[0] = seed
    mark[seed] = stamp
    head, tail = 0, 1
    while head < tail:
        f = queue[head]
        head += 1
        for k in range(3):
            other = twin[3 * f + k]
            if other >= 0:
                g = other // 3
                if mark[g] != stamp and label[g] == label[f]:
                    mark[g] = stamp
                    queue[tail] = g
                    tail += 1
    return queue[tail - 1]


@njit(cache=True)
def _bisect(
    label: I4, twin: I4, chosen: I4, seeds: I4, order: I4, start: I8, stop: I8, fresh: int
) -> None:
    mark = np.zeros(len(label), np.int32)
    queue = np.empty(len(label), np.int32)
    stamp = 0
    for item in range(len(chosen)):
        if stop[item] - start[item] < 2:
            continue
        one, two = seeds[item, 0], seeds[item, 1]
        if one < 0 or two < 0 or one == two:
            stamp += 1
            far = _flood(label, twin, order[start[item]], mark, stamp, queue)
            stamp += 1
            one = _flood(label, twin, far, mark, stamp, queue)
            two = far
        if one == two:
            continue
        old = label[one]
        queue[0], queue[1] = one, two
        label[one], label[two] = -2, -3
        head, tail = 0, 2
        while head < tail:
            f = queue[head]
            head += 1
            for k in range(3):
                other = twin[3 * f + k]
                if other >= 0 and label[other // 3] == old:
                    label[other // 3] = label[f]
                    queue[tail] = other // 3
                    tail += 1
        for at in range(tail):
            label[queue[at]] = old if label[queue[at]] == -2 else fresh
        fresh += 1
