"""Tiny quilts on which all labellings can be tried, and their energy in plain terms."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from scipy.ndimage import map_coordinates

from btfcore.paint.compose import Aim, Composer
from btfcore.paint.constrained import feature_of
from btfcore.paint.palette import Palette, palette_of
from btfcore.patch.connectivity import Connectivity
from btfcore.patch.flatten import FlatPatch
from btfcore.quilt.state import QuiltState
from btfcore.types import Sample
from tests.quilt.test_fitting import COLUMNS, ROWS, scene, value

COUNT = ROWS * COLUMNS
FREE = 12  # vertices of a patch proper, so 4,096 labellings
NEW = -2  # label of the patch that is cut in


def textured(name: str, seed: int, shape: tuple[int, int]) -> Sample:
    """Random colours with soft bands of feature, brighter than the rest."""
    random = np.random.default_rng(seed)
    row, column = np.mgrid[: shape[0], : shape[1]]
    wave = np.sin(column * 0.8 + 0.7 * np.sin(row / 2) + seed)
    mask = np.clip(0.5 + 1.5 * wave, 0, 1).astype(np.float32)
    values = (0.5 * random.random((*shape, 3)) + 0.5 * mask[..., None]).astype(np.float32)
    return Sample(name, values, values.copy(), mask=mask)


@dataclass(eq=False)
class Scene:
    """A tiny quilt of up to three patches, a placement of sample `mine` and what is wanted."""

    net: Connectivity
    palette: Palette
    samples: tuple[Sample, ...]
    state: QuiltState
    order: np.ndarray
    inner: int
    place: np.ndarray  # of every vertex
    target: np.ndarray  # of every vertex
    mine: int

    @cached_property
    def tails(self) -> np.ndarray:
        return np.repeat(np.arange(COUNT), np.diff(self.net.indptr))

    @cached_property
    def slot(self) -> dict[tuple[int, int], int]:
        pairs = zip(self.tails.tolist(), self.net.indices.tolist(), strict=True)
        return {pair: slot for slot, pair in enumerate(pairs)}

    @property
    def core(self) -> np.ndarray:
        return self.order[: self.inner]

    @cached_property
    def free(self) -> list[int]:
        """Vertices of the patch that may take either value."""
        high, wide = self.samples[self.mine].mask.shape
        x, y = self.place.T
        inside = (x >= 0) & (y >= 0) & (x <= wide - 1) & (y <= high - 1)
        return [int(v) for v in self.core if inside[v] and self.state.patch[v] >= 0]

    def texture(self, sample: int, at: np.ndarray) -> np.ndarray:
        return value(self.samples[sample].channels, at)

    def mask(self, sample: int, at: np.ndarray) -> float:
        at = np.asarray(at, np.float64)
        mask = self.samples[sample].mask
        return float(map_coordinates(mask, [[at[1]], [at[0]]], order=1, mode="nearest")[0])

    def label(self, vertex: int, new: bool) -> int:
        return NEW if new else int(self.state.patch[vertex])

    def shows(self, vertex: int, new: bool, at: int) -> np.ndarray:
        """f_σ(at) for the label σ of `vertex`; `at` is the vertex itself or a neighbour."""
        if new:
            return self.texture(self.mine, self.place[at])
        owner = int(self.state.sample[vertex])
        own = self.state.source[vertex]
        return self.texture(owner, own if at == vertex else self.state.ghost[self.slot[vertex, at]])

    def data(self, vertex: int, new: bool) -> float:
        """D_p(σ_p) = |m_σ(p) − m_0(p)|."""
        wanted = float(self.target[vertex])
        if self.state.patch[vertex] < 0:
            return 0.0
        if new:
            return abs(self.mask(self.mine, self.place[vertex]) - wanted)
        owner = int(self.state.sample[vertex])
        shown = self.mask(owner, self.state.source[vertex])
        if owner != self.mine and wanted >= 0.5:
            shown = 0.0  # F shall be textured by the feature of this sample alone
        return abs(shown - wanted)

    def smooth(self, p: int, new_p: bool, q: int, new_q: bool) -> float:
        """V_pq(σ_p, σ_q)."""
        if self.state.patch[p] < 0 or self.state.patch[q] < 0:
            return 0.0
        if self.label(p, new_p) == self.label(q, new_q):
            return 0.0
        at_p = self.shows(p, new_p, p) - self.shows(q, new_q, p)
        at_q = self.shows(p, new_p, q) - self.shows(q, new_q, q)
        return float(np.linalg.norm(at_p) + np.linalg.norm(at_q))

    def parts(self, new: set[int], vertices: set[int]) -> tuple[float, float]:
        """Σ D over `vertices` and Σ V over the edges with an end in them."""
        data = sum(self.data(v, v in new) for v in vertices)
        smooth = sum(
            self.smooth(i, i in new, j, j in new)
            for i, j in self.slot
            if i < j and (i in vertices or j in vertices)
        )
        return data, smooth

    def all_energies(self, weight: float, unit: float) -> np.ndarray:
        """E of every labelling of `free`, (2^n,), the last vertex changing first."""
        labels = np.zeros((2 ** len(self.free), COUNT), np.int8)
        labels[:, self.free] = list(itertools.product((0, 1), repeat=len(self.free)))
        core = set(self.core.tolist())
        total = np.zeros(len(labels))
        for v in core:
            cost = np.array([self.data(v, False), self.data(v, True)])
            total += weight * cost[labels[:, v]]
        for i, j in self.slot:
            if i < j and (i in core or j in core):
                cost = np.array(
                    [[self.smooth(i, a, j, b) for b in (False, True)] for a in (False, True)]
                )
                total += cost[labels[:, i], labels[:, j]] / unit
        return total

    def labelling(self, number: int) -> set[int]:
        return {v for k, v in enumerate(self.free[::-1]) if number >> k & 1}

    def aim(self, **given) -> Aim:
        order = self.order
        wanted = self.target[order]
        none = np.zeros(self.inner, np.bool_)
        asked = {"forced": none, "frozen": none, **given}
        present = feature_of(self.state, self.palette, self.mine, order, wanted)
        return Aim(wanted, present, np.zeros(len(order), np.bool_), **asked)

    def cut(self, weight: float, **given):
        """What the engine's own composer makes of it."""
        local = np.empty(COUNT, np.int32)
        local[self.order] = np.arange(COUNT)
        engine = SimpleNamespace(
            net=self.net, state=self.state, palette=self.palette, unit=self.palette.normaliser,
            flattener=SimpleNamespace(local=local),
        )  # fmt: skip
        patch = FlatPatch(
            self.order, np.zeros(1, np.int32), self.inner, np.zeros((COUNT, 2)), "chart", 2, 0
        )
        composer = Composer(engine, self.mine, weight)
        return composer._cut(patch, self.aim(**given), self.place[self.order])


def made(seed: int, *, several: bool = True, bare: float = 0.15, off: float = 0.0) -> Scene:
    """Random scene; off: how far the new placement is moved to the right, in texels."""
    random = np.random.default_rng(seed)
    net, _, patch, source, ghost, place, _ = scene(random, bare)
    samples = (textured("one", seed, (12, 14)), textured("two", seed + 100, (13, 17)))
    samples = samples if several else samples[:1]
    owner = np.where(patch == 1, len(samples) - 1, 0).astype(np.uint16)
    state = QuiltState(source, patch, ghost, np.zeros(COUNT, np.float32), 3, owner)
    order = [12]
    for vertex in order:
        for other in net.indices[net.indptr[vertex] : net.indptr[vertex + 1]]:
            if other not in order and len(order) < FREE:
                order.append(int(other))
    inner = len(order)
    order = np.array(order + [v for v in range(COUNT) if v not in order], np.int32)
    target = np.round(random.random(COUNT) * 4) / 4
    return Scene(
        net, palette_of(samples, [1.0] * len(samples)), samples, state, order, inner,
        place + np.array([off, 0], np.float32), target, seed % len(samples),
    )  # fmt: skip
