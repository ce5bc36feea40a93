"""Bakes, factorises and packs the samples: ``python -m resources.recipes``."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

from btfcore.btf.bake.build import baked
from btfcore.btf.directions import layout
from btfcore.btf.factor.errors import FactorErrors, factor_errors
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfSample
from btfcore.files.package.read import read_package
from btfcore.files.package.write import write_package
from btfcore.files.samples import thumbnail
from resources.recipes.binned import binned
from resources.recipes.book import RECIPES, Recipe
from resources.recipes.emphasis import emphasised
from resources.recipes.sheet import looks, write_sheet

SAMPLES = Path(__file__).resolve().parents[1] / "samples"
DETAIL = 2  # texels of the baked maps on one of the sample
_STACK_MB = 1600.0  # of images kept: half floats for the larger samples
_WORK_MB = 2600.0  # of the factorisation
_MEASURED = 9  # one image in so many


def sample_of(recipe: Recipe, *, directions: str, detail: int = DETAIL) -> BtfSample:
    """Bake a recipe's maps at a layout of directions, images in memory."""
    wanted = layout(directions)
    fine = baked(recipe.maps(detail), wanted.views, wanted.lights, bounce=True)
    return materialize(binned(fine, detail), memory_mb=_STACK_MB)


def packed(
    recipe: Recipe, folder: Path, *, directions: str, rank: int, detail: int = DETAIL
) -> tuple[Path, FactorErrors]:
    """Write a recipe's package; return its path and the errors of its factors."""
    sample = sample_of(recipe, directions=directions, detail=detail)
    factors = emphasised(sample, rank=rank, memory_mb=_WORK_MB)
    errors = factor_errors(sample, factors, every=_MEASURED)
    # With an emphasis, the factorisation's own figure is that of the repeated texels too.
    whole = replace(sample, factors=replace(factors, error=errors.rel_l2_coded))
    folder.mkdir(parents=True, exist_ok=True)
    path = write_package(folder / f"{recipe.name}.btfz", whole, preview=thumbnail(sample))
    return path, errors


def main(arguments: list[str] | None = None) -> int:
    """Make the samples named, or all of them."""
    read = argparse.ArgumentParser(prog="python -m resources.recipes", description=__doc__)
    read.add_argument("names", nargs="*", help=f"of {', '.join(RECIPES)}; all where none is given")
    read.add_argument("--out", type=Path, default=SAMPLES, help="folder of the packages")
    read.add_argument("--layout", default="ubo81", help="directions, see patina sample bake")
    read.add_argument("--rank", type=int, help="number of factors instead of the recipe's own")
    read.add_argument("--detail", type=int, choices=(1, 2, 4), default=DETAIL)
    read.add_argument("--sheet", type=Path, help="also draw the folder's packages (JPEG)")
    read.add_argument("--only-sheet", action="store_true", help="make no package")
    given = read.parse_args(arguments)
    unknown = [name for name in given.names if name not in RECIPES]
    if unknown:
        read.error(f"there is no recipe {', '.join(unknown)}; there are {', '.join(RECIPES)}")
    for name in [] if given.only_sheet else given.names or RECIPES:
        recipe = RECIPES[name]
        began = time.process_time()
        path, errors = packed(
            recipe,
            given.out,
            directions=given.layout,
            rank=given.rank or recipe.rank,
            detail=given.detail,
        )
        sys.stdout.write(
            f"{name}: {recipe.size}x{recipe.size}, rank {errors.rank},"
            f" {path.stat().st_size / 1e6:.2f} MB,"
            f" sRGB RMSE {errors.srgb_rmse:.4f} (worst image {errors.srgb_rmse_worst:.4f}),"
            f" SSIM {errors.ssim:.3f}, {time.process_time() - began:.0f} CPU s\n"
        )
        sys.stdout.flush()
    files = [given.out / f"{name}.btfz" for name in RECIPES]
    files = [path for path in files if path.exists()]
    total = sum(path.stat().st_size for path in files)
    sys.stdout.write(f"{len(files)} samples in {given.out.name}, {total / 1e6:.1f} MB\n")
    if given.sheet:
        write_sheet(given.sheet, [(path.stem, looks(read_package(path))) for path in files])
    return 0
