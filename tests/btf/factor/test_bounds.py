"""Memory stays within its bound, and bits do not depend on threads; in processes of their own."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.btf.factor.bounded import ROOT, Case, outcome

linux = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="peaks of memory are told by Linux only"
)

HASH = """
import hashlib, os, sys
cores = {int(core) for core in sys.argv[1].split(",")}
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, cores)
from btfcore.btf.factor.errors import factor_errors, held_out_errors
from btfcore.btf.factor.svd import factorize
from tests.btf.factor.sets import material
sample, digest = material(30), hashlib.sha256()
for knobs in ({"rank": 12}, {"rank": 12, "oversample": 8, "memory_mb": 36, "encoding": "logluma"},
              {"rank": "auto", "rmse": 0.02}):
    factors = factorize(sample, **knobs)
    for part in (factors.weights, factors.basis, factors.mean, factors.singular):
        digest.update(part.tobytes())
    digest.update(repr((factors.error, factor_errors(sample, factors, every=5))).encode())
digest.update(repr(held_out_errors(sample, rank=5)).encode())
print(digest.hexdigest())
"""


def digest(threads, cores):
    environment = os.environ | {
        name: str(threads) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    }
    done = subprocess.run(
        [sys.executable, "-c", HASH, cores],
        cwd=ROOT, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.strip()) == hashlib.sha256().digest_size * 2
    return done.stdout.strip()


def test_threads_do_not_change_a_bit():
    allowed = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
    one = digest(1, str(allowed[0]))
    assert digest(2, ",".join(map(str, allowed[:2]))) == one


@linux
@pytest.mark.parametrize("source", ["file", "dear formula"])
def test_a_sample_larger_than_the_bound_stays_within_it(source, tmp_path):
    case = Case(30, 36, 128, memory_mb=64, source=source, rank=16, folder=str(tmp_path))
    found = outcome(case)
    assert found.coded_mb > 3 * case.memory_mb
    assert found.grown_mb < case.memory_mb
    assert found.rank == 16 and 0.01 < found.error < 0.2


@linux
@pytest.mark.skipif(
    "PATINA_LARGE" not in os.environ, reason="takes minutes and 2 GB of disk: set PATINA_LARGE=1"
)
@pytest.mark.parametrize("source", ["file", "formula", "dear formula"])
def test_the_full_set_of_directions_stays_within_the_bound(source, tmp_path):
    case = Case(151, 151, 128, memory_mb=512, source=source, folder=str(tmp_path))
    found = outcome(case)
    assert found.coded_mb > 8 * case.memory_mb
    assert found.grown_mb < case.memory_mb
    assert found.rank == 40
