"""The bench of growth fits what it says, and runs."""

import numpy as np
import pytest

from tests.bench.growth import STAGES, digest, exponent, exponents, fingerprint, fingerprints, run
from tests.bench.inputs import quilting_sample
from tests.bench.test_bench import copied
from tests.surfaces import plane

MESH, SAMPLE, RATE = "sphere.obj", "brick_red.png", 64


def test_the_exponent_is_that_of_the_power_law():
    counts = np.array([1e4, 4e4, 1.7e5, 6e5])
    assert exponent(counts, 3e-6 * counts**1.05) == pytest.approx(1.05)
    rough = 2e-6 * counts * np.array([1.1, 0.9, 0.9, 1.1])
    assert exponent(counts, rough) == pytest.approx(1.0, abs=0.03)


def test_whole_runs_are_measured_stage_by_stage():
    runs = run(MESH, quilting_sample(SAMPLE), [RATE, 2 * RATE])
    for each in runs:
        figures = [each.clock.figures[stage] for stage in STAGES]
        assert each.row.covered == 1.0 and each.row.peak > 0
        assert each.row.cpu_s == pytest.approx(sum(figure["cpu_s"] for figure in figures))
        assert each.row.per_vertex > 0 and each.row.per_edge > 0
    assert 3 < runs[1].row.vertices / runs[0].row.vertices < 5
    assert f"{RATE}² … {2 * RATE}²" in exponents(runs)


def test_one_and_two_threads_give_the_same_bits():
    hashes = fingerprints(MESH, SAMPLE, RATE)
    assert sorted(hashes) == [1, 2]
    assert set(hashes.values()) == {fingerprint(MESH, SAMPLE, RATE)}


def test_the_hash_sees_every_part_of_a_quilt():
    dense = plane(8, 9)
    quilt = copied(dense, [[1, 0], [0, -1]])
    assert digest(quilt) == digest(copied(dense, [[1, 0], [0, -1]]))
    assert digest(quilt) != digest(copied(dense, [[1, 0], [0, 1]]))
    for name in ("angle", "patch"):
        changed = copied(dense, [[1, 0], [0, -1]])
        values = getattr(changed, name).copy()
        values[3] += 1
        object.__setattr__(changed, name, values)
        assert digest(changed) != digest(quilt)
