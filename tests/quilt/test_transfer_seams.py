"""Seams of a carried quilt cut again: the expansion move against brute force."""

import itertools

import numpy as np
import pytest

from btfcore.quilt.transfer_seams import _cost, _edges, _edges_at, _expand
from tests.surfaces import plane


@pytest.mark.parametrize("known", [True, False])
def test_expansion_is_the_cheapest_of_all_labellings(known):
    random = np.random.default_rng(4)
    dense = plane(3, 4)
    for _ in range(20):
        band = np.arange(1, 11, dtype=np.int32)
        given = np.stack([random.permutation(3 if known else 4)[:3] for _ in band])
        given = given.astype(np.int32)
        if not known:
            given[random.random(len(band)) < 0.3, 2] = -1
        spots = random.random((len(band), 4, 2))  # a point per label: distances are metric
        apart = np.stack(
            [
                [
                    np.linalg.norm(at[row[a]] - at[row[b]]) if row[b] >= 0 else 0.0
                    for a, b in ((0, 1), (0, 2), (1, 2))
                ]
                for row, at in zip(given, spots, strict=True)
            ]
        )
        patch = random.integers(0, 3, 12).astype(np.int32)
        patch[band] = given[:, 0]
        node = np.full(12, -1, np.int32)
        node[band] = np.arange(len(band))
        tail, head = _edges(dense.faces, node)
        pairs = {tuple(sorted((int(f[i]), int(f[i - 1])))) for f in dense.faces for i in range(3)}
        assert set(zip(tail.tolist(), head.tolist(), strict=True)) == pairs - {(0, 11)}

        def energy(labels, tail=tail, head=head, node=node, given=given, apart=apart):
            return sum(
                _cost(node[v], labels[v], node[w], labels[w], given, apart)
                for v, w in zip(tail, head, strict=True)
            )

        pointer, edges = _edges_at(tail, head, node, len(band))
        alpha = int(random.integers(0, 3))
        rows = np.flatnonzero((given == alpha).any(axis=1) & (patch[band] != alpha))
        best = np.inf
        for taken in itertools.product((False, True), repeat=len(rows)):
            trial = patch.copy()
            trial[band[rows[list(taken)]]] = alpha
            best = min(best, energy(trial))
        before, local = energy(patch), np.full(len(band), -1, np.int32)
        gain = _expand(
            rows, alpha, tail, head, pointer, edges, node, band, local, given, apart, patch
        )
        assert energy(patch) == pytest.approx(before - gain)
        assert (local == -1).all()
        assert best - 1e-9 <= energy(patch) <= before + 1e-9
        if known:  # all costs are metric: else they are a bound
            assert energy(patch) == pytest.approx(best)
