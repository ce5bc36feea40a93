"""The verbs of painting that command line, window and notebooks share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.appearance import quilting_sample
from btfcore.btf.joint import common_channels, factorised
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidEdit, InvalidImage, InvalidParameter, InvalidProject
from btfcore.files.edits_json import BACKGROUND, Script, Source, read_edits
from btfcore.files.project.document import document_of, project_of
from btfcore.files.project.read import read_project
from btfcore.files.project.value import Material
from btfcore.files.project.write import write_project
from btfcore.paint.document import Document, Layer
from btfcore.paint.edits import kind_of
from btfcore.paint.engine import Engine
from btfcore.paint.palette import palette_of
from btfcore.phases import PhaseClock
from btfcore.pipeline import export, load_mesh, prepare, synthesizer
from btfcore.progress import Progress, between, silent
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.synthesize import Synthesizer
from btfcore.regions import Plan, RegionSamples, plan_samples
from btfcore.samples import load_paint_sample
from btfcore.types import Prepared, Quilt, Sample


@dataclass(eq=False)
class Painting:
    """A document with the materials behind its samples, and where it is saved.

    materials : one for each of the document's samples, the background's first. plan : which of
    them has which region, where there are several. notes : sentences fit for a user. path,
    token : the project file that it was read from or saved to last, and which save that was.
    """

    document: Document
    materials: tuple[Material, ...]
    plan: Plan | None = None
    notes: list[str] = field(default_factory=list)
    path: Path | None = None
    token: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names by which edits files call the samples."""
        return tuple(each.name for each in self.materials)


def new_document(
    mesh: str | Path | Prepared,
    background: str | Path | Source,
    *,
    rate: int = 512,
    parameters: QuiltParameters | None = None,
    guide: str | Path | None = None,
    regions: RegionSamples | None = None,
    clock: PhaseClock | None = None,
    progress: Progress = silent,
) -> Painting:
    """Cover a mesh with the background of a sample, ready to be painted on.

    mesh : a file, or what `btfcore.pipeline.prepare` made. background : a sample of any kind;
    where it has a mask, nothing of the feature is synthesised. Raises as reading a mesh,
    preparing and quilting do, and as `btfcore.samples.load_paint_sample` does.
    """
    clock = clock if clock is not None else PhaseClock()
    given = background if isinstance(background, Source) else Source(BACKGROUND, Path(background))
    knobs = parameters or QuiltParameters()
    knobs = replace(knobs, scale=knobs.scale * given.scale, features=False)
    asked = regions if regions is not None else RegionSamples()
    notes: list[str] = []
    if isinstance(mesh, Prepared):
        shape = mesh.mesh
    else:
        with clock.phase("import"):
            shape, imported = load_mesh(
                mesh, regions=asked.way, progress=between(progress, 0.0, 0.06)
            )
            notes += [f"{Path(mesh).name}: {note}" for note in imported.notes]
    plan = None if asked.plain else plan_samples(shape, given.file, asked)
    sources = [given]
    if plan is not None:
        notes += plan.notes
        kept = [given if file == given.file else Source(file.stem, file) for file in plan.files]
        sources = [replace(each, name=_free(each.name, kept[:at])) for at, each in enumerate(kept)]
    with clock.phase("samples"):
        found = [_loaded(each, notes, between(progress, 0.06, 0.12)) for each in sources]
        found = _with_factors(found, progress)
        own = [quilting_sample(each) for each in found]
    vectors = None
    if guide is not None:
        from btfcore.field import read_guide

        vectors = read_guide(Path(guide))
    prepared = mesh if isinstance(mesh, Prepared) else prepare(
        shape, rate=rate, guide=vectors, clock=clock, progress=between(progress, 0.12, 0.45)
    )  # fmt: skip
    with clock.phase("quilt"):
        made = synthesizer(
            prepared, own if plan is not None else own[0], knobs, plan=plan,
            progress=between(progress, 0.45, 0.5),
        )  # fmt: skip
        made.run(progress=between(progress, 0.5, 1.0))
    return painting_over(prepared, sources, found, made, plan=plan, notes=notes)


def load_background(
    source: Source, *, progress: Progress = silent
) -> tuple[BtfSample, Sample, list[str]]:
    """Read a sample to synthesise a background from: all of it, what is quilted, and notes.

    A BTF comes with its factors. Raises as `btfcore.samples.load_paint_sample` does.
    """
    notes: list[str] = []
    (found,) = _with_factors([_loaded(source, notes, progress)], progress)
    return found, quilting_sample(found), notes


def painting_over(
    prepared: Prepared,
    sources: Sequence[Source],
    found: Sequence[BtfSample],
    made: Synthesizer,
    *,
    plan: Plan | None = None,
    notes: Sequence[str] = (),
) -> Painting:
    """A painting without edits over what a synthesis made of the samples `found` in `sources`."""
    samples, told = common_channels(list(found))
    scales = [1.0] * len(found) if plan is None else list(plan.scales)
    engine = Engine.over(prepared, samples, made, scales=scales)
    materials = tuple(
        Material(source.name, sample, scale, btf, source.file.name)
        for source, sample, scale, btf in zip(sources, samples, scales, found, strict=True)
    )
    return Painting(Document(engine), materials, plan, [*notes, *told])


def add_samples(
    painting: Painting, sources: Sequence[Source], *, progress: Progress = silent
) -> list[int]:
    """Bring samples to paint with; returns their numbers.

    A sample that is there already under the same name, with the same texels, mask and scale, is
    not brought again. Where a picture comes to BTFs, or a BTF that cannot be compared with the
    first (`btfcore.btf.joint`), all go by their colours from then on; edits that there are get
    computed anew, and the history of undo ends: so bring all samples first. Raises `InvalidEdit`
    where another sample has the name, and as `btfcore.samples.load_paint_sample` does.
    """
    document, engine = painting.document, painting.document.engine
    notes: list[str] = []
    fresh: list[tuple[Source, BtfSample]] = []
    names = list(painting.names)
    for at, source in enumerate(sources):
        part = between(progress, 0.7 * at / len(sources), 0.7 * (at + 1) / len(sources))
        btf = _loaded(source, notes, part)
        if source.name not in names:
            names.append(source.name)
            fresh.append((source, btf))
        elif not _same(painting, source, btf):
            raise InvalidEdit(
                f"there is another sample {source.name!r} already; give {source.file.name}"
                " another name"
            )
    if fresh:
        known = [_material(each) for each in painting.materials]
        ready = _with_factors([*known, *(btf for _, btf in fresh)], progress)
        samples, told = common_channels(ready)
        old, scale = engine.samples, engine.parameters.scale
        scales = [*engine.scales, *(source.scale / scale for source, _ in fresh)]
        engine.take_samples(samples, scales)
        files = [*(each.file for each in painting.materials)]
        files += [source.file.name for source, _ in fresh]
        painting.materials = tuple(
            Material(*each) for each in zip(names, samples, scales, ready, files, strict=True)
        )
        painting.notes += [*notes, *(each for each in told if each not in painting.notes)]
        if document.layers and any(map(_moved, old, samples)):
            document.replay(progress=between(progress, 0.8, 1.0))
            document.restore(document.layers, document.next_uid)
    return [names.index(source.name) for source in sources]


def apply_edits(
    painting: Painting, script: Script | str | Path, *, progress: Progress = silent
) -> list[Layer]:
    """Make the edits of a script on top of those that there are; returns their layers.

    Where `progress` raises `Cancelled`, the edits made so far stay. Raises `InvalidEdit` naming
    the edit by its place in the file.
    """
    if not isinstance(script, Script):
        script = read_edits(script)
    script.check_names(painting.names)
    add_samples(painting, script.sources, progress=between(progress, 0.0, 0.1))
    document, names = painting.document, painting.names
    made = []
    for at, edit in enumerate(script.edits):
        number = getattr(edit, "sample", None)
        if number is not None:
            known: dict[str, Any] = {"sample": names.index(script.names[number])}
            edit = replace(edit, **known)
        share = 0.1 + 0.9 * at / len(script.edits)
        part = between(progress, share, share + 0.9 / len(script.edits))
        try:
            document.add(edit, progress=part)
        except InvalidEdit as error:
            raise InvalidEdit(f"{script.place(at)}: {error}") from None
        made.append(document.layers[-1])
    return made


def edit_figures(layer: Layer, names: Sequence[str]) -> dict[str, Any]:
    """What an edit did, as plain JSON; energies as in Zhou §IV-A, with its own λ.

    energy : E = λ Σ D_p + Σ V_pq / u over the vertices that it looked at, and before it.
    """
    edit, result = layer.edit, layer.result
    number = getattr(edit, "sample", None)
    out: dict[str, Any] = {
        "uid": edit.uid, "name": edit.name, "kind": kind_of(edit), "visible": edit.visible,
        "sample": None if number is None else names[number],
    }  # fmt: skip
    if result is None:
        return out
    figures = dict(vars(result.report))
    for end in ("", "_before"):
        figures[f"energy{end}"] = (
            figures["weight"] * figures[f"constraint{end}"] + figures[f"smooth{end}"]
        )
    return out | figures | {
        "vertices": len(result.delta.vertices), "read": len(result.delta.reads),
        "notes": list(result.report.notes),
    }  # fmt: skip


# --- files


def save_project(
    painting: Painting,
    path: str | Path,
    *,
    preview: NDArray[np.uint8] | None = None,
    progress: Progress = silent,
) -> None:
    """Save everything into one file; see `btfcore.files.project.write.write_project`.

    Saved under the path that it was read from or saved to last, the file there must be that
    very save: else `ProjectChanged` is raised.
    """
    path = Path(path)
    again = painting.path is not None and path.absolute() == painting.path.absolute()
    painting.token = write_project(
        path,
        project_of(painting.document, painting.materials, painting.plan, painting.token),
        preview=preview,
        expected=painting.token if again else None, progress=progress,
    )  # fmt: skip
    painting.path = path


def open_project(path: str | Path, *, progress: Progress = silent) -> Painting:
    """Read a project; raises `InvalidProject`."""
    project = read_project(path, progress=progress)
    try:
        document = document_of(project)
    except (InvalidImage, InvalidParameter) as error:  # samples that do not fit each other
        raise InvalidProject(f"{Path(path).name}: {error}") from None
    return Painting(
        document, project.materials, project.plan, list(project.notes), Path(path),
        project.token,
    )  # fmt: skip


def export_document(
    path: str | Path,
    painting: Painting,
    *,
    rate: int | None = None,
    dense_shape: bool = False,
    relightable: bool = False,
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write the painted mesh as .glb, .obj or .ply; returns the files written.

    rate : side of the texture; another one than the document's shows the same picture at a finer
    or coarser scale (`btfcore.quilt.transfer.transfer`). relightable : see
    `btfcore.pipeline.export`.
    """
    prepared, quilt = at_rate(painting, rate, progress=between(progress, 0.0, 0.7))
    return export(
        path, prepared, quilt, painting.document.samples, dense_shape=dense_shape,
        relightable=relightable, progress=between(progress, 0.7, 1.0),
    )  # fmt: skip


def at_rate(
    painting: Painting, rate: int | None, *, progress: Progress = silent
) -> tuple[Prepared, Quilt]:
    """Return the painted quilt on the dense mesh of another rate; None, or its own, as it is."""
    engine = painting.document.engine
    old = engine.prepared
    if rate is None or rate == old.dense.size:
        return old, painting.document.quilt()
    from btfcore.quilt.transfer import transfer

    new = prepare(old.mesh, rate=rate, progress=between(progress, 0.0, 0.6))
    knobs = engine.parameters
    finer = knobs.scale * rate / old.dense.size
    seams = palette_of(
        engine.samples, [finer * each for each in engine.scales], knobs.match_channels
    ).sheet
    allowed = None
    if painting.plan is not None:
        width = max(1, round(knobs.border * rate / old.dense.size))
        layout = painting.plan.layout(new.mesh, new.dense, new.field, width)
        allowed = np.ones((len(engine.samples), len(new.dense.vertices)), bool)
        allowed[: len(layout.allowed)] = layout.allowed
    quilt = transfer(
        old.dense, old.field, engine.net, engine.state, engine.palette.sheet, new.dense,
        new.field, seams=seams, allowed=allowed, progress=between(progress, 0.6, 1.0),
    )  # fmt: skip
    return new, quilt


# --- inside


def _loaded(source: Source, notes: list[str], progress: Progress) -> BtfSample:
    mask = source.mask if source.drawn is None else source.drawn
    found, told = load_paint_sample(source.file, mask, flat=source.flat, progress=progress)
    notes += [f"{source.file.name}: {note}" for note in told]
    return found


def _with_factors(samples: Sequence[BtfSample], progress: Progress) -> list[BtfSample]:
    """Return the samples with factors for all BTFs among them; pictures as they are."""
    made = iter(factorised([each for each in samples if not each.is_image], progress=progress))
    return [each if each.is_image else next(made) for each in samples]


def _material(material: Material) -> BtfSample:
    if material.btf is None:
        raise InvalidEdit(
            f"sample {material.name!r} was stored without its images; no other can join it"
        )
    return material.btf


def _same(painting: Painting, source: Source, btf: BtfSample) -> bool:
    """Whether the painting has this very sample under the source's name."""
    at = painting.names.index(source.name)
    there, engine = painting.materials[at], painting.document.engine
    (new,), _ = common_channels([btf if btf.is_image else factorised([btf])[0]])
    old, scale = there.sample, there.scale * engine.parameters.scale
    return bool(
        np.array_equal(old.colour, new.colour)
        and abs(scale - source.scale) <= 1e-12 * source.scale
        and (old.mask is None) == (new.mask is None)
        and (old.mask is None or np.array_equal(old.mask, np.asarray(new.mask)))
    )


def _moved(old: Sample, new: Sample) -> bool:
    """Whether a sample's channels are others now, and not only followed by zeros."""
    width = old.channels.shape[2]
    return not (
        np.array_equal(old.channels, new.channels[..., :width])
        and not new.channels[..., width:].any()
    )


def _free(name: str, taken: Sequence[Source]) -> str:
    names = {each.name for each in taken}
    number, free = 2, name
    while free in names:
        free, number = f"{name} {number}", number + 1
    return free
