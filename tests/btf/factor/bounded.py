"""Factorises a generated BTF in a process of its own and says how much memory that took.

`python -m tests.btf.factor.bounded '{"images": 22801, …}'` prints one line of JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from btfcore.btf.factor.svd import factorize
from btfcore.btf.sample import BtfSample, Encoding
from btfcore.btf.stack import ArrayStack
from tests.btf.factor.sets import material, spiral

ROOT = Path(__file__).resolve().parents[3]


class Formula:
    """Images (J, size, size) of a few patterns plus noise, made whenever they are read."""

    def __init__(self, images: int, size: int, *, dear: bool, rank: int = 12) -> None:
        generator = np.random.default_rng(5)
        self.shape, self.dear = (images, size, size), dear
        self._maps = generator.standard_normal((rank, size * size)).astype(np.float32)
        decay = 0.75 ** np.arange(rank)
        self._angular = generator.standard_normal((images, 3, rank)) * decay
        self._noise = generator.standard_normal(size * size * 3 + 4099).astype(np.float32)

    def read(self, numbers):
        """Images `numbers` (n,) as (n, size, size, 3) f4."""
        chosen = np.asarray(numbers, np.int64)
        _, height, width = self.shape
        out = np.empty((len(chosen), height * width, 3), np.float32)
        for place, number in enumerate(chosen):
            start = int(number) * 37 % 4099
            noise = self._noise[start : start + out[0].size].reshape(-1, 3)
            wave = self._maps.T @ self._angular[number].T.astype(np.float32)
            out[place] = np.abs(0.5 + 0.04 * wave + 0.02 * noise)
        return out.reshape(len(chosen), height, width, 3)


@dataclass(frozen=True)
class Case:
    """source: "file" (half floats, mapped), "formula" or "dear formula"."""

    views: int
    lights: int
    size: int
    memory_mb: float
    source: str = "file"
    rank: int = 40
    folder: str | None = None


@dataclass(frozen=True)
class Outcome:
    """MiB of the coded images and of memory beyond what was used before; the error; seconds."""

    coded_mb: float
    grown_mb: float
    error: float
    rank: int
    cpu_s: float


def outcome(case: Case) -> Outcome:
    """Run a case in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.btf.factor.bounded", json.dumps(asdict(case))],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(done.stderr)
    return Outcome(**json.loads(done.stdout.splitlines()[-1]))


def run(case: Case) -> Outcome:
    """Run a case in this process, whose peak of memory is reset first."""
    images = case.views * case.lights
    formula = Formula(images, case.size, dear=case.source == "dear formula")
    with tempfile.TemporaryDirectory(dir=case.folder) as folder:
        stack = formula
        if case.source == "file":
            path = Path(folder) / "images.f2"
            with path.open("wb") as file:
                for start in range(0, images, 32):
                    block = formula.read(np.arange(start, min(start + 32, images)))
                    file.write(block.astype(np.float16).tobytes())
            shape = (images, case.size, case.size, 3)
            stack = ArrayStack(np.memmap(path, np.float16, "r", shape=shape))
        index = np.arange(images, dtype=np.int32).reshape(case.views, case.lights)
        sample = BtfSample("generated", stack, spiral(case.views), spiral(case.lights), index)
        factorize(material(12), rank=4, oversample=4)  # loads the kernels
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # resets the peak
        before, start = _status("VmRSS"), time.process_time()
        factors = factorize(
            sample, rank=case.rank, encoding=Encoding("sqrt"), memory_mb=case.memory_mb
        )
        seconds = time.process_time() - start
        grown = _status("VmHWM") - before
    coded = images * case.size**2 * 12 / 2**20
    return Outcome(coded, grown, factors.error, factors.rank, seconds)


def _status(field: str) -> float:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(field):
            return int(line.split()[1]) / 1024
    raise RuntimeError(field)


if __name__ == "__main__":
    print(json.dumps(asdict(run(Case(**json.loads(sys.argv[1]))))))  # noqa: T201
