"""The verbs that command line, window and notebooks share: read, prepare, synthesise, export."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from btfcore.errors import Cancelled, InvalidParameter, InvalidQuilt
from btfcore.phases import PhaseClock
from btfcore.progress import Progress, between, silent
from btfcore.quilt.parameters import QuiltParameters
from btfcore.regions import Plan, RegionSamples, plan_samples
from btfcore.types import F8, ImportReport, Mesh, Prepared, Quilt, Sample

if TYPE_CHECKING:
    from btfcore.btf.weights import Weights
    from btfcore.field import Guide
    from btfcore.files.gltf import Attached
    from btfcore.files.quilt_npz import StoredQuilt
    from btfcore.quilt.refine import RefineStatistics
    from btfcore.quilt.synthesize import Synthesizer

SMALLEST_RATE, LARGEST_RATE = 16, 8192


@dataclass(frozen=True, eq=False)
class Decorated:
    """Everything that one run made.

    `sample_notes` say what reading the sample changed; `engine` knows the seams' statistics;
    `complete` is False where the run was cancelled and the quilt is partly bare. `samples` are
    those that the quilt names, and `plan` says which region has which, where there are several.
    """

    prepared: Prepared
    imported: ImportReport
    sample: Sample
    sample_notes: tuple[str, ...]
    quilt: Quilt
    engine: Synthesizer
    clock: PhaseClock
    complete: bool = True
    refinement: RefineStatistics | None = None
    samples: tuple[Sample, ...] = ()
    plan: Plan | None = None


def load_mesh(
    path: str | Path, *, regions: str = "auto", progress: Progress = silent
) -> tuple[Mesh, ImportReport]:
    """Read and repair a mesh file; raises `InvalidMesh`, `InvalidRegions`, `GuardedFailure`."""
    from btfcore.mesh.reader import read_mesh

    return read_mesh(Path(path), regions=regions, progress=progress)


def load_sample(path: str | Path, *, progress: Progress = silent) -> Sample:
    """Read a texture or BTF sample; raises `InvalidImage`, `InvalidBtf` or `GuardedFailure`."""
    return load_sample_notes(path, progress=progress)[0]


def load_sample_notes(
    path: str | Path,
    *,
    view_weights: Weights = None,
    light_weights: Weights = None,
    progress: Progress = silent,
) -> tuple[Sample, tuple[str, ...]]:
    """Read a texture or BTF sample, and say in sentences what was done to it.

    view_weights, light_weights : how much each direction of a BTF counts when texels are
    compared, see `btfcore.btf.weights.direction_weights`.
    """
    from btfcore.btf.image import SUFFIXES, read_image_notes

    path = Path(path)
    if path.suffix.lower() in SUFFIXES or not path.exists():
        for weights, kind in ((view_weights, "view"), (light_weights, "light")):
            if weights is not None:  # one view under one light, but a wrong name is still wrong
                from btfcore.btf.sample import NORMAL
                from btfcore.btf.weights import direction_weights

                direction_weights(weights, NORMAL, name=path.name, kind=kind)
        return read_image_notes(path, progress=progress)
    from btfcore.samples import load_quilting_sample

    return load_quilting_sample(
        path, view_weights=view_weights, light_weights=light_weights, progress=progress
    )


def load_both(
    mesh: str | Path,
    sample: str | Path,
    *,
    regions: str = "auto",
    view_weights: Weights = None,
    light_weights: Weights = None,
    progress: Progress = silent,
) -> tuple[Mesh, ImportReport, Sample, tuple[str, ...]]:
    """Read mesh and sample at the same time, each in its own guarded process.

    Where the mesh fails or `progress` raises `Cancelled`, reading the sample is stopped too.
    """
    stop = Event()

    def heeding(fraction: float, label: str) -> None:
        if stop.is_set():
            raise Cancelled

    with ThreadPoolExecutor(1) as pool:
        picture = pool.submit(
            load_sample_notes, sample, view_weights=view_weights, light_weights=light_weights,
            progress=heeding,
        )  # fmt: skip
        try:
            loaded, report = load_mesh(mesh, regions=regions, progress=progress)
            while not picture.done():
                progress(1.0, "reading the sample")
                wait([picture], timeout=0.05)
        except BaseException:
            stop.set()
            raise
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
    start: Quilt | None = None,
    progress: Progress = silent,
) -> Synthesizer:
    """Return the quilting engine for a prepared mesh, perhaps to continue `start`; call `run`.

    Several samples come with the `plan` that says where each goes.
    """
    from btfcore.quilt.synthesize import Synthesizer

    layout = scales = None
    if plan is not None:
        layout = plan.layout(
            prepared.mesh, prepared.dense, prepared.field, parameters.border,
            progress=between(progress, 0.0, 0.6),
        )  # fmt: skip
        scales = plan.scales
    return Synthesizer(
        prepared.dense, prepared.field, sample, parameters,
        layout=layout, scales=scales, start=start, progress=progress,
    )  # fmt: skip


def synthesize(
    prepared: Prepared,
    sample: Sample,
    *,
    parameters: QuiltParameters | None = None,
    progress: Progress = silent,
    on_update: Callable[[Quilt], None] | None = None,
) -> tuple[Quilt, Synthesizer]:
    """Cover the prepared mesh with `sample`; partial quilts go to `on_update`."""
    engine = synthesizer(
        prepared, sample, parameters or QuiltParameters(), progress=between(progress, 0.0, 0.05)
    )
    return engine.run(progress=between(progress, 0.05, 1.0), on_update=on_update), engine


def decorate(
    mesh: str | Path,
    sample: str | Path,
    *,
    rate: int = 512,
    parameters: QuiltParameters | None = None,
    guide: str | Path | None = None,
    view_weights: Weights = None,
    light_weights: Weights = None,
    start: str | Path | None = None,
    partial: bool = False,
    refine_s: float | None = None,
    refine_tries: int | None = None,
    regions: RegionSamples | None = None,
    progress: Progress = silent,
) -> Decorated:
    """From two files to a finished quilt; every phase is measured.

    start : quilt file of a cancelled run with the same mesh, sample and knobs, to be gone on
    with; raises `InvalidQuilt` where it belongs to others. partial : where `progress` raises
    `Cancelled` after the first patch, return the partly bare quilt instead. refine_s,
    refine_tries : budget of a refinement, none by default (see `btfcore.quilt.refine.refine`, whose
    error it raises). regions : other samples for some regions, and how regions meet.
    """
    refining = refine_s is not None or refine_tries is not None
    if refining:
        from btfcore.quilt.refine import check_budget, refine

        check_budget(refine_s, refine_tries)
    clock = PhaseClock()
    vectors = stored = plan = None
    asked = regions if regions is not None else RegionSamples()
    with clock.phase("import"):
        if guide is not None:
            from btfcore.field import read_guide

            vectors = read_guide(Path(guide))
        if start is not None:
            from btfcore.files.quilt_npz import read_quilt_npz

            stored = read_quilt_npz(start)
        loaded, imported, picture, notes = load_both(
            mesh, sample, regions=asked.way, view_weights=view_weights,
            light_weights=light_weights, progress=between(progress, 0.0, 0.12),
        )  # fmt: skip
        samples: tuple[Sample, ...] = (picture,)
        if not asked.plain:
            plan = plan_samples(loaded, sample, asked)
            known, more = {Path(sample): picture}, list(plan.notes)
            for file in plan.files:
                if file not in known:
                    known[file], said = load_sample_notes(
                        file, view_weights=view_weights, light_weights=light_weights,
                        progress=between(progress, 0.12, 0.12),
                    )  # fmt: skip
                    more += [f"{file.name}: {note}" for note in said]
            samples, notes = tuple(known[file] for file in plan.files), (*notes, *more)
    prepared = prepare(
        loaded, rate=rate, guide=vectors, progress=between(progress, 0.12, 0.45), clock=clock
    )
    complete, refinement = True, None
    with clock.phase("quilt"):
        engine = synthesizer(
            prepared, samples, parameters or QuiltParameters(), plan=plan,
            start=None if stored is None else continued(stored, prepared),
            progress=between(progress, 0.45, 0.48),
        )  # fmt: skip
        try:
            quilt = engine.run(progress=between(progress, 0.48, 0.8 if refining else 1.0))
        except Cancelled:
            if not partial or engine.state.patches == 0:
                raise
            quilt, complete = engine.state.quilt(engine.sheet), False
    if refining and complete:
        with clock.phase("refine"):
            try:
                refinement = refine(
                    engine, seconds=refine_s, tries=refine_tries,
                    progress=between(progress, 0.8, 1.0),
                )  # fmt: skip
            except Cancelled:
                if not partial:
                    raise
                complete = False
            quilt = engine.state.quilt(engine.sheet)
    return Decorated(
        prepared, imported, samples[0], notes, quilt, engine, clock, complete, refinement,
        samples, plan,
    )  # fmt: skip


def continued(stored: StoredQuilt, prepared: Prepared) -> Quilt:
    """Return the quilt of a file after checking that it lies on this very dense mesh and field.

    Raises `InvalidQuilt` with the counts or the distance by which they differ.
    """
    dense = prepared.dense
    for what, held, wanted in (
        ("vertices", len(stored.vertices), len(dense.vertices)),
        ("triangles", len(stored.faces), len(dense.faces)),
    ):
        if held != wanted:
            raise InvalidQuilt(
                f"the quilt has {held} {what}, this mesh at rate {dense.size} has {wanted}:"
                " it is of another mesh or rate"
            )
    apart = float(np.abs(stored.vertices - dense.vertices).max())
    if not (np.array_equal(stored.texel, dense.texel) and apart <= 1e-6 * prepared.mesh.diagonal):
        raise InvalidQuilt(f"the quilt is of another mesh: vertices differ by up to {apart:.3g}")
    turned = float((1 - (stored.tangents * prepared.field.tangents).sum(axis=1)).max())
    if turned > 1e-3:
        raise InvalidQuilt(
            "the quilt follows another orientation field: directions differ by up to"
            f" {np.degrees(np.arccos(max(1 - turned, -1.0))):.0f} degrees; was it another guide?"
        )
    return Quilt(stored.source, stored.angle, stored.sample, stored.patch)


def export_decorated(
    path: str | Path,
    done: Decorated,
    *,
    dense_shape: bool = False,
    relightable: bool = False,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write the decorated mesh as .glb, .obj or .ply; the phase is measured as "export"."""
    with done.clock.phase("export"):
        return export(
            path, done.prepared, done.quilt, done.samples or done.sample,
            dense_shape=dense_shape, relightable=relightable, progress=progress,
        )  # fmt: skip


def export(
    path: str | Path,
    prepared: Prepared,
    quilt: Quilt,
    sample: Sample | Sequence[Sample],
    *,
    dense_shape: bool = False,
    relightable: bool = False,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write a quilt's colours on the input mesh's shape, or on the dense mesh's.

    relightable : the GLB also holds the quilt, so that it can be rendered under any light with
    its samples (`btfcore.relighting`). Raises `InvalidParameter` for other formats.
    """
    from btfcore.files.export import check_output
    from btfcore.files.export import export as write
    from btfcore.render.texture import vertex_colours

    attached = None
    if relightable:
        check_output(path, suffixes=(".glb",))

        def attached(positions: F8) -> dict[str, Attached]:
            from btfcore.files.glb_quilt import KEY, attach_quilt

            return {KEY: attach_quilt(prepared.dense, prepared.field, quilt, positions)}

    progress(0.0, "colours")
    samples = [sample] if isinstance(sample, Sample) else sample
    colours = vertex_colours(quilt, samples, progress=lambda fraction, label: progress(0.0, label))
    return write(
        Path(path), prepared.mesh, prepared.atlas, prepared.dense, colours,
        dense_shape=dense_shape, attached=attached, progress=progress,
    )  # fmt: skip
