"""Makes sound charts of a first guess: lays them flat, cuts what fails, joins what is small."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from btfcore.dense.charts import Charts, surface_areas, true_to_size
from btfcore.dense.labels import bisect, borders, connected
from btfcore.dense.quality import Quality, measure
from btfcore.dense.unwrap import C16, Flags, face_shapes, mean_positions, net, relax, unfold
from btfcore.mesh.topology import twins
from btfcore.progress import Progress, silent
from btfcore.types import F8, I4, I8, Mesh

_CUTS = 16  # rounds of halving what does not lie flat
_JOINS = 8  # rounds of joining small charts to a neighbour
_EFFORT = 60_000  # faces laid flat anew in one round of joining
_SMALL = 0.02  # of the surface: charts below are joined where the result lies flat
_MIRRORED, _OVERLAP, _BAD, _STRAIN = 5e-4, 2e-3, 0.01, 0.02  # most that a chart may have,
_TWICE = 4.0  # points of the sample grid that a chart may cover twice,
_STRICT = 0.4  # and the share of it that a joined chart may have
_FINE = 1024  # sample points along a square as large as the surface
_SPRAWL = 0.4  # least share that a large chart may fill of its bounding box: it packs badly
_LARGE = 0.03  # of the surface
_COMPACT = 0.55  # the same for joined charts, unless the guest leaves the host
_KEPT = 0.95  # of what it filled before


def flatten_charts(
    mesh: Mesh,
    chart: I4,
    uv: F8,
    *,
    usable: Flags | None = None,
    progress: Progress = silent,
) -> Charts:
    """Charts that lie flat as rigidly as possible, from labels and a rough first layout.

    chart (F,) i4 ≥ 0; uv (F, 3, 2) f8 (column, row), of right size and not mirrored; usable
    (F,): faces whose uv are worth starting from, the others are hinged on. Parts of a chart
    that do not hang together become charts. Charts that fold, overlap themselves or stretch
    are bisected; small ones are joined to a neighbour where that does none of it.
    """
    progress(0.0, "laying charts flat")
    work = _Flattening(mesh, chart, uv, lambda: progress(work.share, "laying charts flat"))
    everything = np.arange(len(mesh.faces))
    work.settle(everything, np.ones(len(everything), bool) if usable is None else usable)
    touched = everything
    for step in range(_CUTS):
        work.share = 0.5 + 0.3 * step / _CUTS
        progress(work.share, "laying charts flat")
        touched = work.cut(touched)
        if len(touched) == 0:
            break
    for step in range(_JOINS):
        work.share = 0.8 + 0.2 * step / _JOINS
        progress(work.share, "joining small charts")
        if not work.join():
            break
    flat = np.stack([work.place.real, -work.place.imag], axis=-1)
    return Charts(mesh, true_to_size(mesh, flat, work.chart), work.chart)


class _Flattening:
    """Labels and flat corners of a mesh while charts are cut and joined."""

    def __init__(self, mesh: Mesh, chart: I4, uv: F8, tick: Callable[[], None]) -> None:
        self.tick, self.share = tick, 0.0  # called between steps; share of the work done
        self.twin = twins(mesh.faces)
        self.shape, self.weight = face_shapes(mesh)
        self.area = surface_areas(mesh)
        self.step = max(float(np.sqrt(self.area.sum())) / _FINE, float(np.finfo(float).tiny))
        self.length = np.abs(self.shape).ravel()
        self.chart = connected(chart, self.twin)
        self.place: C16 = np.ascontiguousarray(uv[..., 0] - 1j * uv[..., 1])
        self.refused: set[tuple[int, int]] = set()

    @property
    def count(self) -> int:
        return int(self.chart.max()) + 1

    def settle(self, subset: I8, usable: Flags) -> None:
        """Lay whole charts flat anew, from the places of the faces that are usable."""
        some = net(self.chart, self.twin, self.shape, self.weight, subset)
        self.tick()
        position, known = mean_positions(some, self.place[subset], usable)
        unfold(some, position, known)
        self.tick()
        self.place[subset] = relax(some, position)[some.corner]

    def quality(self, subset: I8) -> tuple[I4, Quality]:
        """Charts of a subset of faces and how well they lie."""
        charts, local = np.unique(self.chart[subset], return_inverse=True)
        self.tick()
        found = measure(
            local.astype(np.int32),
            len(charts),
            self.shape[subset],
            self.place[subset],
            step=self.step,
        )
        found.culprit[found.culprit >= 0] = subset[found.culprit[found.culprit >= 0]]
        return charts.astype(np.int32), found

    def cut(self, subset: I8) -> I8:
        """Bisect every chart among those of a subset of faces that fails; faces touched."""
        charts, found = self.quality(subset)
        several = np.bincount(self.chart)[charts] > 1
        sprawls = (found.fill < _SPRAWL) & (found.area > _LARGE * self.area.sum())
        failing = np.flatnonzero((fails(found) | sprawls) & several)
        touched = np.flatnonzero(np.isin(self.chart, charts[failing]))
        if len(touched) == 0:
            return touched
        self.chart = connected(
            bisect(self.chart, self.twin, charts[failing], found.culprit[failing]), self.twin
        )
        self.settle(touched, np.ones(len(touched), bool))
        return touched

    def join(self) -> bool:
        """Join small charts to neighbours and undo what then fails; whether any was tried."""
        guest, host = self._pairs()
        if len(guest) == 0:
            return False
        before_chart, before_place = self.chart, self.place.copy()
        first = np.unique(self.chart, return_index=True)[1]
        target = np.arange(self.count, dtype=np.int32)
        target[guest] = host
        touched = np.flatnonzero(np.isin(self.chart, np.concatenate([guest, host])))
        usable = ~np.isin(self.chart[touched], guest)
        self.tick()
        hosts, earlier = self.quality(touched)
        self.chart = target[self.chart]
        self.settle(touched, usable)
        self.tick()
        charts, found = self.quality(touched)
        self.tick()
        worse = found.fill < _KEPT * earlier.fill[np.searchsorted(hosts, charts)]
        wrong = charts[fails(found, _STRICT) | (worse & (found.fill < _COMPACT))]
        back = np.flatnonzero(np.isin(self.chart, wrong))
        self.chart[back] = before_chart[back]
        self.place[back] = before_place[back]
        undone = np.isin(host, wrong)
        self.refused.update(
            zip(first[guest[undone]].tolist(), first[host[undone]].tolist(), strict=True)
        )
        self.chart = connected(self.chart, self.twin)
        return True

    def _pairs(self) -> tuple[I4, I4]:
        """Small charts and the neighbour each is to join; every chart in one pair at most.

        The pairs of one round hold no more than `_EFFORT` faces.
        """
        faces, effort = np.bincount(self.chart), 0
        size = np.bincount(self.chart, self.area, self.count)
        first = np.unique(self.chart, return_index=True)[1]
        a, b, shared = borders(self.chart, self.twin, self.length)
        small = np.flatnonzero((size[a] < _SMALL * size.sum()) & (size[a] <= size[b]))
        small = small[np.lexsort((b[small], -shared[small], a[small], size[a[small]]))]
        taken = np.zeros(self.count, bool)
        guest, host = [], []
        for one, other in zip(a[small].tolist(), b[small].tolist(), strict=True):
            if taken[one] or taken[other]:
                continue
            heavy = effort + int(faces[one] + faces[other]) > _EFFORT
            if not heavy and (int(first[one]), int(first[other])) not in self.refused:
                effort += int(faces[one] + faces[other])
                taken[one] = taken[other] = True
                guest.append(one)
                host.append(other)
        return np.array(guest, np.int32), np.array(host, np.int32)


def fails(found: Quality, share: float = 1.0) -> Flags:
    """Which charts fold, overlap themselves or stretch beyond `share` of what is allowed."""
    return (
        (found.mirrored > share * _MIRRORED)
        | (found.overlap > share * _OVERLAP)
        | (found.twice > share * _TWICE)
        | (found.bad > share * _BAD)
        | (found.strain > share * _STRAIN)
    )
