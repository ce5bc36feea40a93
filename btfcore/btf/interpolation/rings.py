"""Directions that lie on rings around the normal, each with evenly spaced azimuths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.directions import to_angles
from btfcore.types import F8, I4, Frozen

SAME_RING = 2e-5  # radians
EVEN = np.radians(0.6)  # file names round azimuths to whole degrees
FEWEST = 3  # azimuths of a ring: fewer do not go around


@dataclass(frozen=True, eq=False)
class Rings(Frozen):
    """Rings from the normal outwards: theta (R,) rising, the first of them 0.

    Ring k has the azimuths phi[start[k]:start[k + 1]], rising in 0 … 2 pi, of the directions
    `member` there. Where no direction lies on the normal, the first ring is a made-up one
    whose member is the number of directions (see `btfcore.btf.interpolation.grid`).
    """

    theta: F8
    start: I4
    phi: F8
    member: I4
    count: int

    @property
    def pole(self) -> bool:
        """Whether a direction lies on the normal."""
        return int(self.member[0]) < self.count

    @property
    def aligned(self) -> bool:
        """Whether all rings but the first have the same azimuths: a grid in (theta, phi)."""
        around = [self.phi[a:b] for a, b in zip(self.start[1:-1], self.start[2:], strict=True)]
        return all(
            len(phi) == len(around[0]) and np.abs(phi - around[0]).max() < EVEN for phi in around
        )

    @property
    def innermost(self) -> I4:
        """Directions of the first ring around the normal."""
        return self.member[self.start[1] : self.start[2]] if len(self.theta) > 1 else self.member


def find_rings(directions: F8, nodes: I4) -> Rings | str:
    """Return the rings that `directions[nodes]` lie on, or the reason why they lie on none."""
    theta, phi = to_angles(directions[nodes])
    order = np.argsort(theta, kind="stable")
    cuts = np.flatnonzero(np.diff(theta[order]) > SAME_RING) + 1
    groups = np.split(order, cuts)
    pole = theta[groups[0]].max() < SAME_RING
    heights, azimuths, members = [0.0], [np.zeros(1)], [np.array([len(directions)])]
    if pole:
        members[0] = nodes[groups[0]]
    for group in groups[int(pole) :]:
        height = float(theta[group].mean())
        where = f"the ring at {np.degrees(height):.2f} degrees"
        if np.ptp(theta[group]) > SAME_RING:
            return f"the angles around {np.degrees(height):.2f} degrees do not part into rings"
        if len(group) < FEWEST:
            return f"{where} has {len(group)} directions, at least {FEWEST} are needed"
        turned = np.where(phi[group] < 0, phi[group] + 2 * np.pi, phi[group])
        turned[turned >= 2 * np.pi] = 0.0
        inner = np.argsort(turned, kind="stable")
        turned = turned[inner]
        steps = turned - 2 * np.pi * np.arange(len(turned)) / len(turned)
        if np.ptp(steps) > 2 * EVEN:
            return f"the azimuths of {where} are not evenly spaced"
        heights.append(height)
        azimuths.append(turned)
        members.append(nodes[group[inner]])
    sizes = [len(part) for part in members]
    return Rings(
        theta=np.array(heights),
        start=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32),
        phi=np.concatenate(azimuths),
        member=np.concatenate(members).astype(np.int32),
        count=len(directions),
    )
