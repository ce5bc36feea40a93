"""Lights that had to step aside where the camera stood, put back where they belong."""

from __future__ import annotations

import numpy as np

from btfcore.btf.readers.conditions import Conditions, renumbered

# Less than half of the 14.5° by which neighbours of the 81 directions differ, so that a shifted
# light cannot be taken for its neighbour.
MOST_DEG = 7.0
_FEW = 0.25


def snapped(conditions: Conditions, *, most_deg: float = MOST_DEG) -> tuple[Conditions, str | None]:
    """Move lights seen from a few views to the light nearby that those views lack.

    Where light and camera would stand in one place, UTIA's set-up moves the light a little;
    taken literally each such image makes a light of its own. A light that at most a quarter
    of the views have is merged into the nearest one within `most_deg` degrees that more than
    half of the views have and that lacks exactly these views. Returns the conditions and a
    note with count and largest angle, or None where nothing was moved.
    """
    views, lights, index = conditions.views, conditions.lights, conditions.index
    has = index >= 0
    share = has.mean(axis=0)
    odd = np.flatnonzero(share <= _FEW)
    usual = np.flatnonzero(share > 0.5)
    if len(odd) == 0 or len(usual) == 0:
        return conditions, None
    chord = np.linalg.norm(lights[odd][:, None] - lights[usual][None], axis=2)
    angle = np.degrees(2 * np.arcsin(np.clip(chord / 2, 0, 1)))
    place = np.where(has, conditions.order[index], -1)
    gone: list[int] = []
    largest = 0.0
    images = 0
    for row, column in zip(
        *np.unravel_index(np.argsort(angle, axis=None), angle.shape), strict=True
    ):
        if angle[row, column] > most_deg:
            break
        old, new = odd[row], usual[column]
        own = place[:, old] >= 0
        if old in gone or (place[own, new] >= 0).any():
            continue
        place[own, new] = place[own, old]
        gone.append(int(old))
        largest = max(largest, float(angle[row, column]))
        images += int(own.sum())
    if not gone:
        return conditions, None
    kept = np.setdiff1d(np.arange(len(lights)), gone)
    note = (
        f"took the light of {images} images as the neighbouring one that their views lack, up to"
        f" {largest:.2g}° away (the light steps aside where the camera stands)"
    )
    return renumbered(views, lights[kept], place[:, kept]), note
