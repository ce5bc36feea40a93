"""The verbs that command line, window and notebooks share: read, prepare, synthesise, export."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from btfcore.errors import InvalidParameter
from btfcore.phases import PhaseClock
from btfcore.progress import Progress, between, silent
from btfcore.quilt.parameters import QuiltParameters
from btfcore.regions import Plan, RegionSamples, plan_samples
from btfcore.types import Atlas, DenseMesh, Field, ImportReport, Mesh, Quilt, Sample

if TYPE_CHECKING:
    from btfcore.field import Guide
    from btfcore.quilt.synthesize import Synthesizer

SMALLEST_RATE, LARGEST_RATE = 16, 8192


@dataclass(frozen=True, eq=False)
class Prepared:
    """A mesh ready to be decorated: its atlas, dense mesh and orientation field."""

    mesh: Mesh
    atlas: Atlas
    dense: DenseMesh
    field: Field


@dataclass(frozen=True, eq=False)
class Decorated:
    """Everything that one run made.

    `sample_notes` say what reading the sample changed; `engine` knows the seams' statistics.
    `samples` are those that the quilt names, and `plan` says which region has which, where
    there are several.
    """

    prepared: Prepared
    imported: ImportReport
    sample: Sample
    sample_notes: tuple[str, ...]
    quilt: Quilt
    engine: Synthesizer
    clock: PhaseClock
    samples: tuple[Sample, ...] = ()
    plan: Plan | None = None


def load_mesh(
    path: str | Path, *, regions: str = "auto", progress: Progress = silent
) -> tuple[Mesh, ImportReport]:
    """Read and repair a mesh file; raises `InvalidMesh`, `InvalidRegions`, `GuardedFailure`."""
    from btfcore.mesh.reader import read_mesh

    return read_mesh(Path(path), regions=regions, progress=progress)


def load_sample(path: str | Path) -> Sample:
    """Read a texture or BTF sample; raises `InvalidImage`, `InvalidBtf` or `GuardedFailure`."""
    return load_sample_notes(path)[0]


def load_sample_notes(path: str | Path) -> tuple[Sample, tuple[str, ...]]:
    """Read a texture or BTF sample, and say in sentences what was done to it."""
    from btfcore.btf.image import SUFFIXES, read_image_notes

    path = Path(path)
    if path.suffix.lower() in SUFFIXES or not path.exists():
        return read_image_notes(path)
    from btfcore.samples import load_quilting_sample

    return load_quilting_sample(path)


def load_both(
    mesh: str | Path, sample: str | Path, *, regions: str = "auto", progress: Progress = silent
) -> tuple[Mesh, ImportReport, Sample, tuple[str, ...]]:
    """Read mesh and sample at the same time, each in its own guarded process."""
    with ThreadPoolExecutor(1) as pool:
        picture = pool.submit(load_sample_notes, sample)
        loaded, report = load_mesh(mesh, regions=regions, progress=progress)
        return loaded, report, *picture.result()


def prepare(
    mesh: Mesh,
    *,
    rate: int = 512,
    guide: Guide | None = None,
    progress: Progress = silent,
    clock: PhaseClock | None = None,
) -> Prepared:
    """Atlas, watertight dense mesh of side `rate` and orientation field of `mesh`."""
    from btfcore.dense.atlas import build_atlas
    from btfcore.dense.build import build_dense_mesh
    from btfcore.field import orientation_field

    if not SMALLEST_RATE <= rate <= LARGEST_RATE:
        raise InvalidParameter(f"rate is {rate}, outside {SMALLEST_RATE} … {LARGEST_RATE}")
    clock = clock if clock is not None else PhaseClock()
    with clock.phase("atlas"):
        atlas = build_atlas(mesh, rate=rate, progress=between(progress, 0.0, 0.7))
    with clock.phase("dense"):
        dense = build_dense_mesh(atlas, progress=between(progress, 0.7, 0.85))
    with clock.phase("field"):
        field = orientation_field(dense, mesh, guide=guide, progress=between(progress, 0.85, 1.0))
    return Prepared(mesh, atlas, dense, field)


def synthesizer(
    prepared: Prepared,
    sample: Sample | Sequence[Sample],
    parameters: QuiltParameters,
    *,
    plan: Plan | None = None,
) -> Synthesizer:
    """Return the quilting engine for a prepared mesh; call its `run`.

    Several samples come with the `plan` that says where each goes.
    """
    from btfcore.quilt.synthesize import Synthesizer

    if plan is None:
        return Synthesizer(prepared.dense, prepared.field, sample, parameters)
    layout = plan.layout(prepared.mesh, prepared.dense, prepared.field, parameters.border)
    return Synthesizer(
        prepared.dense, prepared.field, sample, parameters, layout=layout, scales=plan.scales
    )


def synthesize(
    prepared: Prepared,
    sample: Sample | Sequence[Sample],
    *,
    parameters: QuiltParameters | None = None,
    plan: Plan | None = None,
    progress: Progress = silent,
    on_update: Callable[[Quilt], None] | None = None,
) -> tuple[Quilt, Synthesizer]:
    """Cover the prepared mesh with `sample`; partial quilts go to `on_update`."""
    engine = synthesizer(prepared, sample, parameters or QuiltParameters(), plan=plan)
    return engine.run(progress=progress, on_update=on_update), engine


def decorate(
    mesh: str | Path,
    sample: str | Path,
    *,
    rate: int = 512,
    parameters: QuiltParameters | None = None,
    guide: str | Path | None = None,
    regions: RegionSamples | None = None,
    progress: Progress = silent,
) -> Decorated:
    """From two files to a finished quilt; every phase is measured.

    regions : other samples for some regions of the mesh, and how the regions meet.
    """
    clock = PhaseClock()
    vectors = plan = None
    asked = regions if regions is not None else RegionSamples()
    with clock.phase("import"):
        if guide is not None:
            from btfcore.field import read_guide

            vectors = read_guide(Path(guide))
        loaded, imported, picture, notes = load_both(
            mesh, sample, regions=asked.way, progress=between(progress, 0.0, 0.12)
        )
        samples: tuple[Sample, ...] = (picture,)
        if not asked.plain:
            plan = plan_samples(loaded, sample, asked)
            samples, notes = _planned(plan, sample, picture, notes)
    prepared = prepare(
        loaded, rate=rate, guide=vectors, progress=between(progress, 0.12, 0.45), clock=clock
    )
    with clock.phase("quilt"):
        quilt, engine = synthesize(
            prepared, samples, parameters=parameters, plan=plan,
            progress=between(progress, 0.45, 1.0),
        )  # fmt: skip
    return Decorated(prepared, imported, samples[0], notes, quilt, engine, clock, samples, plan)


def _planned(
    plan: Plan, path: str | Path, first: Sample, notes: tuple[str, ...]
) -> tuple[tuple[Sample, ...], tuple[str, ...]]:
    """Samples of a plan, each file read once, and the notes of all."""
    known = {Path(path): first}
    notes += plan.notes
    for file in plan.files:
        if file not in known:
            known[file], more = load_sample_notes(file)
            notes += tuple(f"{file.name}: {note}" for note in more)
    return tuple(known[file] for file in plan.files), notes


def export_decorated(
    path: str | Path, done: Decorated, *, dense_shape: bool = False, progress: Progress = silent
) -> tuple[Path, ...]:
    """Write the decorated mesh as .glb, .obj or .ply; the phase is measured as "export"."""
    with done.clock.phase("export"):
        return export(
            path, done.prepared, done.quilt, done.samples or done.sample,
            dense_shape=dense_shape, progress=progress,
        )  # fmt: skip


def export(
    path: str | Path,
    prepared: Prepared,
    quilt: Quilt,
    sample: Sample | Sequence[Sample],
    *,
    dense_shape: bool = False,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write a quilt's colours on the input mesh's shape, or on the dense mesh's."""
    from btfcore.files.export import export as write
    from btfcore.render.texture import vertex_colours

    colours = vertex_colours(quilt, [sample] if isinstance(sample, Sample) else sample)
    return write(
        Path(path), prepared.mesh, prepared.atlas, prepared.dense, colours,
        dense_shape=dense_shape, progress=progress,
    )  # fmt: skip
