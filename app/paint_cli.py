"""`patina paint …` and `patina project …`: edits made headless, and what a project holds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.console import reporter, say, stoppable
from btfcore.errors import Cancelled, InvalidParameter

if TYPE_CHECKING:
    from btfcore.files.edits_json import Script, Source
    from btfcore.painting import Painting
    from btfcore.progress import Progress

project_app = typer.Typer(help="Look at and check project files (.patina).", no_args_is_help=True)
_PROJECT, _MESHES = ".patina", (".glb", ".obj", ".ply")
_File = Annotated[Path, typer.Argument(help="Project (.patina).")]


def paint(
    source: Annotated[
        Path, typer.Argument(metavar="PROJECT|MESH", help="Project (.patina), or a mesh file.")
    ],
    edits: Annotated[
        list[Path] | None, typer.Option("--edits", help="Edits file (JSON); repeatable, in order.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Result: .glb, .obj, .ply or .patina.")
    ] = None,
    sample: Annotated[
        Path | None, typer.Option(help="Background of a mesh (else that of the first edits file).")
    ] = None,
    mask: Annotated[
        Path | None, typer.Option(help="Feature of the background, which is left out.")
    ] = None,
    rate: Annotated[
        int | None,
        typer.Option(
            help="Side of the texture: of a mesh to paint at (512), of a project to export."
        ),
    ] = None,
    export_rate: Annotated[
        int | None,
        typer.Option(help="Export at this side: the same picture at a finer or coarser scale."),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the background.")] = None,
    guide: Annotated[
        Path | None, typer.Option(help="JSON list of {position, direction} for the field.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(help="Project (.patina), also where the run is cancelled.")
    ] = None,
    dense: Annotated[bool, typer.Option(help="Export the dense mesh's shape.")] = False,
    relightable: Annotated[
        bool, typer.Option(help="The .glb also holds what `patina render` needs of it.")
    ] = False,
    preview: Annotated[Path | None, typer.Option(help="Picture of the result (PNG).")] = None,
    report: Annotated[Path | None, typer.Option(help="Figures of every edit (JSON).")] = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Print all figures.")] = False,
) -> None:
    """Make the edits of --edits on a project, or on a mesh covered with a background sample."""
    from btfcore.files.edits_json import BACKGROUND, read_edits
    from btfcore.files.export import check_output
    from btfcore.painting import apply_edits, save_project
    from btfcore.phases import PhaseClock

    if relightable and (output is None or output.suffix.lower() != ".glb"):
        raise InvalidParameter("--relightable is for a result in .glb")
    stored = source.suffix.lower() == _PROJECT
    _check_outputs(output, save, preview, report)
    for option, value in (("--sample", sample), ("--mask", mask), ("--seed", seed),
                          ("--guide", guide)):  # fmt: skip
        if stored and value is not None:
            raise InvalidParameter(f"{option} is for a mesh; {source.name} has its background")
    scripts = [read_edits(path) for path in edits or ()]
    _check_scripts(scripts, None if stored else (BACKGROUND,))
    clock, targets = PhaseClock(), _projects(output, save)
    with reporter(quiet=quiet) as progress, stoppable(progress) as heeding:
        painting = _begun(source, stored, scripts, sample, mask, rate, seed, guide, clock, heeding)
        _check_scripts(scripts, painting.names)
        first = len(painting.document.layers)
        try:
            with clock.phase("paint"):
                for at, script in enumerate(scripts):
                    apply_edits(painting, script, progress=_part(heeding, at, len(scripts)))
        except Cancelled:
            if save is not None:
                save_project(painting, save)
                made = len(painting.document.layers) - first
                say(f"patina: cancelled after {made} edits; {save} holds these", error=True)
                raise typer.Exit(130) from None
            raise
        progress(0.8, "saving")
        from btfcore.painting import export_document
        from btfcore.render.thumbnail import thumbnail

        for each in targets:
            picture = thumbnail(painting.document.prepared.dense, painting.document.quilt(),
                                painting.document.samples)  # fmt: skip
            save_project(painting, each, preview=picture)
        if output is not None and output.suffix.lower() in _MESHES:
            check_output(output)
            with clock.phase("export"):
                export_document(
                    output, painting, dense_shape=dense, relightable=relightable,
                    rate=export_rate or (rate if stored else None),
                    progress=lambda fraction, label: heeding(0.8 + 0.2 * fraction, label),
                )  # fmt: skip
        if preview is not None:
            progress(1.0, "preview")
            _preview(preview, painting)
        figures = _figures(painting, first, clock)
        if report is not None:
            from btfcore.files.atomic import write_bytes

            write_bytes(report, json.dumps(figures, indent=1, allow_nan=False).encode())
    if not quiet:
        _told(painting, figures, first)
    if verbose:
        say(json.dumps(figures, indent=1))


@project_app.command()
def info(
    file: _File,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Say what a project holds: surface, samples, edits, and which save it is."""
    from btfcore.files.project.read import project_figures

    figures = project_figures(file)
    if as_json:
        typer.echo(json.dumps(figures, indent=1))
        return
    for name, value in figures.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            typer.echo(f"{name}:")
            for each in value:
                typer.echo("  " + ", ".join(f"{key} {item}" for key, item in each.items()))
        else:
            typer.echo(
                f"{name}: {', '.join(map(str, value)) if isinstance(value, list) else value}"
            )


@project_app.command()
def verify(file: _File) -> None:
    """Read all of a project and check every number; exit status 2 where anything is wrong."""
    from btfcore.files.project.read import read_project

    project = read_project(file)
    for note in project.notes:
        typer.echo(note)
    count = len(project.prepared.dense.vertices)
    typer.echo(f"{file}: sound; {count:,} vertices, {len(project.edits)} edits")


def _check_scripts(scripts: list[Script], names: tuple[str, ...] | None) -> None:
    """Refuse files and names that are not there; names: of samples known before, if known."""
    known = list(names or ())
    for script in scripts:
        script.check_files()
        if names is not None:
            script.check_names(known)
        known += [each.name for each in script.sources]


def _check_outputs(
    output: Path | None, save: Path | None, preview: Path | None, report: Path | None
) -> None:
    """Refuse before long work what would be refused after it."""
    from btfcore.files.export import check_output

    if output is None and save is None:
        raise InvalidParameter("nothing to write: name a result with -o, or a project with --save")
    for path, suffixes in (
        (output, (*_MESHES, _PROJECT)), (save, (_PROJECT,)), (preview, (".png",)),
        (report, (".json",)),
    ):  # fmt: skip
        if path is not None:
            check_output(path, suffixes=suffixes)


def _projects(output: Path | None, save: Path | None) -> list[Path]:
    """Projects to be written, each once."""
    given = [path for path in (save, output) if path is not None]
    return list(dict.fromkeys(path for path in given if path.suffix.lower() == _PROJECT))


def _begun(
    source: Path, stored: bool, scripts: list[Script], sample: Path | None, mask: Path | None,
    rate: int | None, seed: int | None, guide: Path | None, clock: Any, progress: Progress,
) -> Painting:  # fmt: skip
    """Open the project, or cover the mesh."""
    from btfcore.painting import new_document, open_project
    from btfcore.progress import between
    from btfcore.quilt.parameters import QuiltParameters

    part = between(progress, 0.0, 0.4)
    if stored:
        with clock.phase("open"):
            return open_project(source, progress=part)
    background = _background(source, scripts, sample, mask)
    if seed is None:
        seed = next((each.seed for each in scripts if each.background is not None), 0)
    return new_document(
        source, background, rate=512 if rate is None else rate,
        parameters=QuiltParameters(seed=seed), guide=guide, clock=clock, progress=part,
    )  # fmt: skip


def _background(
    mesh: Path, scripts: list[Script], sample: Path | None, mask: Path | None
) -> Source:
    from btfcore.files.edits_json import BACKGROUND, Source

    if sample is not None:
        return Source(BACKGROUND, sample, mask)
    given = next((each.background for each in scripts if each.background is not None), None)
    if given is None:
        raise InvalidParameter(
            f"{mesh.name} is a mesh: name its background with --sample, or in the edits file"
        )
    return given


def _part(progress: Progress, at: int, count: int) -> Progress:
    from btfcore.progress import between

    return between(progress, 0.4 + 0.4 * at / count, 0.4 + 0.4 * (at + 1) / count)


def _figures(painting: Painting, first: int, clock: Any) -> dict[str, Any]:
    from btfcore.painting import edit_figures
    from btfcore.report import versions

    document = painting.document
    layers = document.layers
    return {
        "versions": versions(),
        "rate": document.prepared.dense.size,
        "vertices": len(document.prepared.dense.vertices),
        "seed": document.engine.parameters.seed,
        "samples": [
            {"name": each.name, "file": each.file, "scale": each.scale}
            for each in painting.materials
        ],
        "notes": painting.notes,
        "edits_before": first,
        "edits": [edit_figures(layer, painting.names) for layer in layers[first:]],
        "phases": clock.figures,
    }


def _told(painting: Painting, figures: dict[str, Any], first: int) -> None:
    for note in painting.notes:
        say(note)
    for each in figures["edits"]:
        if not each["visible"]:
            say(f"{each['name']}: hidden, not computed")
            continue
        say(
            f"{each['name']}: {each['patches']} patches, {each['reached']:,} of"
            f" {each['area']:,} vertices as wanted, energy {each['energy_before']:.4g} →"
            f" {each['energy']:.4g}"
        )
        for note in each["notes"]:
            say(f"{each['name']}: {note}")
    count = len(painting.document.layers)
    say(f"{count - first} edits made, {count} in all")


def _preview(path: Path, painting: Painting) -> None:
    from app.scene import render_preview
    from btfcore.files.surface import export_input
    from btfcore.render.texture import atlas_texture, vertex_colours

    document = painting.document
    prepared = document.prepared
    colours = vertex_colours(document.quilt(), document.samples)
    surface = export_input(prepared.mesh, prepared.atlas)
    render_preview(path, surface, atlas_texture(prepared.dense, colours), sample=document.samples)
