"""The benchmarks' woven BTF: a plain weave of glossy red and blue threads, baked from maps.

Made here rather than shipped, so that anybody can make the very sample of the figures anew.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import fft

from btfcore.btf.appearance import quilting_sample
from btfcore.btf.bake.build import bake
from btfcore.btf.directions import layout
from btfcore.btf.factor.svd import factorize
from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample
from btfcore.files.package.read import read_package
from btfcore.files.package.write import write_package
from btfcore.types import F8, Sample
from resources.recipes.canvas import Canvas
from resources.recipes.colours import palette
from resources.recipes.noise import blur, mix, noise, step, wobble

VERSION = 1  # of what is drawn and baked; a change asks for another file in the cache
SIZE = 128
PITCH = 16  # texels from thread to thread
DIRECTIONS = "12x8x12x8"  # Zhou §III-B, "Handling BTF Values"
RANK = 40
SEED = 11
RED, BLUE = "b5342c", "3552a6"
CROWN = 2.6  # texels by which a thread rises over the one that it crosses
ROUND = 2.2  # texels from a thread's edge to its middle
_MEMORY_MB = 2600.0  # images as half floats and the factorisation's work


def woven_maps(*, seed: int = SEED, fine: int = 4) -> PbrSet:
    """Draw the maps (128, 128): warp threads (red) run down, weft threads (blue) across.

    fine : drawing samples a texel and axis. The same seed gives the same bits.
    """
    canvas = Canvas(SIZE, seed, fine)
    rows, columns = canvas.grid()
    # the weft is the warp's drawing laid on its side
    warp = _threads(canvas, "warp", rows, columns, 1.0)
    weft = [np.swapaxes(part, 0, 1) for part in _threads(canvas, "weft", rows, columns, -1.0)]
    above = warp[0] > weft[0]
    height, fibre, tone = (np.where(above, a, b) for a, b in zip(warp, weft, strict=True))
    colour = np.where(above[..., None], palette(RED)[0], palette(BLUE)[0])
    cloud = noise(canvas, "cloud", 24, 3.0, slope=1.0)
    colour = colour * (tone * (1 + 0.16 * fibre + 0.07 * cloud))[..., None]
    # Deep between the threads little light comes back, and what does is darker and greyer.
    gap = step(0.4, -1.6, height) * 0.7
    colour = mix(colour, colour * np.array([0.3, 0.3, 0.34]), gap)
    rough = 0.3 - 0.05 * fibre + 0.03 * cloud + 0.3 * gap
    maps = canvas.finish(
        "woven", albedo=colour, height=height, roughness=np.clip(rough, 0.15, 0.9), texel_size=0.05
    )
    return replace(maps, normal=_normals(canvas, height))


def _threads(canvas: Canvas, what: str, rows: F8, columns: F8, sign: float) -> list[F8]:
    """Height, fibres and tone of all threads that run down, as if nothing crossed them."""
    count = SIZE // PITCH
    rng = canvas.rng(what)
    sway = np.stack([wobble(canvas, f"{what} sway {k}", 70, 10) for k in range(count)], axis=1)
    number = np.clip((columns // PITCH).astype(np.int64), 0, count - 1)[0]
    across = (columns - (number + 0.5) * PITCH - 0.55 * sway[:, number]) / (PITCH / 2)
    profile = np.sqrt(np.clip(1 - across**2, 0.0, 1.0))
    over = np.where(number % 2 == 0, sign, -sign)
    # up at the middle of every second crossing, so that its sign changes between crossings
    level = CROWN * over * np.sin(np.pi * (rows / PITCH))
    slope = rng.normal(0.22, 0.04, count)[number]  # of the spun fibres' twist
    straight, spun = _fibres(canvas, f"{what} one", 0.14), _fibres(canvas, f"{what} two", 0.3)
    fibre = mix(straight, spun, step(0.16, 0.28, slope))
    tone = rng.normal(1.0, 0.06, count)[number] + 0 * across
    height = level + ROUND * profile + 0.22 * fibre * profile
    return [height, fibre, tone]


def _fibres(canvas: Canvas, what: str, slope: float) -> F8:
    """Periodic noise of long thin streaks that lean by `slope` columns a row; deviation 1."""
    side = canvas.side
    down = fft.fftfreq(side, 1 / canvas.fine)[:, None]
    right = fft.rfftfreq(side, 1 / canvas.fine)[None, :]
    along, across = down + slope * right, right - slope * down
    thin = (2.6 * across) ** 4
    gain = np.exp(-((9.0 * along) ** 2)) * thin / (1 + thin) / (1 + (0.9 * across) ** 6)
    white = fft.rfft2(canvas.rng(what).standard_normal((side, side)))
    field = fft.irfft2(white * gain, (side, side))
    return field / field.std()


def _normals(canvas: Canvas, height: F8) -> np.ndarray:
    """Mean normals (128, 128, 3) f4 of the drawn relief, fibres included."""
    down, right = canvas.slopes(blur(canvas, height, 0.3))
    normal = np.stack([-right, down, np.ones_like(height)], axis=-1)  # y is up, rows go down
    normal /= np.sqrt((normal**2).sum(axis=-1, keepdims=True))
    mean = canvas.coarse(normal)
    return (mean / np.sqrt((mean**2).sum(axis=-1, keepdims=True))).astype(np.float32)


def woven_btf(
    *, directions: str = DIRECTIONS, rank: int = RANK, folder: str | Path | None = None
) -> BtfSample:
    """Return the factorised BTF, baked where it is not in `folder` yet.

    folder : the cache; by default one of the temporary folder, whose files the system may
    drop whenever it likes. A file there is named by all that its contents depend on.
    """
    place = Path(folder) if folder is not None else Path(tempfile.gettempdir()) / "patina-bench"
    path = place / f"woven-{VERSION}-{directions}-{rank}.btfz"
    if not path.is_file():
        wanted = layout(directions)
        sample = bake(woven_maps(), wanted.views, wanted.lights, memory_mb=1024)
        factors = factorize(sample, rank=rank, memory_mb=_MEMORY_MB)
        place.mkdir(parents=True, exist_ok=True)
        write_package(path, replace(sample, factors=factors), full_floats=True)
    return read_package(path)


def woven_sample(
    *, directions: str = DIRECTIONS, rank: int = RANK, folder: str | Path | None = None
) -> Sample:
    """Return what the quilting needs of `woven_btf`: (128, 128) texels of `rank` channels."""
    return quilting_sample(woven_btf(directions=directions, rank=rank, folder=folder))
