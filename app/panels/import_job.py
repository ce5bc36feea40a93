"""What an import does in the background: find out the kind, make a package of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.tasks import Job, Report
from btfcore.progress import Progress, between

LAYOUTS = {"12x4x12x4": 48, "ubo81": 81, "12x8x12x8": 96}  # and their directions
SMALLEST, LARGEST = 16, 1024
MEMORY_MB = 2048


@dataclass(frozen=True)
class ImportKnobs:
    """How a sample is brought in.

    size : longer edge in texels of a baked PBR set. depth : of its relief in texels, None: from
    its maps. layout : its directions. rank : factors that are kept.
    """

    size: int = 256
    depth: float | None = None
    layout: str = "ubo81"
    shadows: bool = True
    parallax: bool = True
    rank: int = 40


@dataclass(frozen=True)
class Look:
    """What was found at a path: the kind, a line about it, and notes of reading it."""

    path: Path
    kind: str
    summary: str
    notes: tuple[str, ...] = ()


def look(path: Path) -> Job:
    """A job that returns a `Look`; raises what reading raises."""

    def job(progress: Progress, report: Report) -> Look:
        from btfcore.files.sample_kind import WORDS
        from btfcore.files.samples import kind_of, open_sample

        progress(0.0, "looking at the files")
        kind = kind_of(path)
        sample = open_sample(path, size=SMALLEST if kind == "pbr" else None, progress=progress)
        height, width = sample.shape
        parts = [WORDS[kind]]
        if kind != "pbr":
            parts.append(f"{width} × {height}")
            if not sample.is_image:
                parts.append(f"{len(sample.views)} × {len(sample.lights)} directions")
        return Look(path, kind, " · ".join(parts), sample.notes)

    return job


def bring(found: Look, knobs: ImportKnobs, target: Path) -> Job:
    """A job that writes the package `target` and returns its path and notes."""

    def job(progress: Progress, report: Report) -> tuple[Path, tuple[str, ...]]:
        from btfcore.files.samples import directions_of, open_sample, save_sample
        from btfcore.samples import bake_files, with_factors

        if found.kind == "pbr":
            sample = bake_files(
                found.path, *directions_of(knobs.layout), size=knobs.size, depth=knobs.depth,
                shadows=knobs.shadows, parallax=knobs.parallax, memory_mb=MEMORY_MB / 2,
                progress=between(progress, 0.0, 0.6),
            )  # fmt: skip
        else:
            sample = open_sample(
                found.path, layout=knobs.layout, progress=between(progress, 0.0, 0.1)
            )
        if sample.factors is None and not sample.is_image:
            begin = 0.6 if found.kind == "pbr" else 0.1
            sample = with_factors(
                sample, rank=knobs.rank, memory_mb=MEMORY_MB,
                progress=between(progress, begin, 0.95),
            )  # fmt: skip
        target.parent.mkdir(parents=True, exist_ok=True)
        notes = save_sample(target, sample, progress=between(progress, 0.95, 1.0))
        return target, (*sample.notes, *notes)

    return job
