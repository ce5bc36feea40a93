"""The command line: decorate a mesh headless, open the window, run a benchmark."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from app.console import reporter, say, stoppable
from app.paint_cli import paint, project_app
from app.render_cli import render
from app.sample_cli import sample_app
from btfcore import __version__
from btfcore.errors import Cancelled, PatinaError

app = typer.Typer(
    name="patina",
    help="Decorate meshes with real materials by graphcut quilting.",
    add_completion=False,
    no_args_is_help=False,
    pretty_exceptions_enable=False,
)
app.add_typer(sample_app, name="sample")
app.add_typer(project_app, name="project")
app.command()(paint)
app.command()(render)


@app.callback(invoke_without_command=True)
def root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Decorate meshes with real materials; without a command, open the window."""
    if version:
        typer.echo(f"patina {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        gui(None, None, None)


@app.command()
def decorate(
    mesh: Annotated[Path, typer.Argument(help="OBJ, PLY, STL, OFF, GLB or glTF file.")],
    sample: Annotated[Path, typer.Argument(help="Sample: an image, a PBR set, a BTF of any kind.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Result, ending in .glb, .obj or .ply.")
    ],
    rate: Annotated[int, typer.Option(help="Side of the dense mesh's atlas in texels.")] = 512,
    scale: Annotated[float, typer.Option(help="2 makes the pattern twice as large.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    guide: Annotated[
        Path | None, typer.Option(help="JSON list of {position, direction} for the field.")
    ] = None,
    work_patch: Annotated[
        int | None, typer.Option(help="Radius r_w of a work patch in steps (default: sample's).")
    ] = None,
    max_distortion: Annotated[
        float, typer.Option(help="T_d, bound on a patch's area distortion.")
    ] = 4.0,
    max_seam: Annotated[
        float | None,
        typer.Option(help="T_c, bound on a patch's seam cost per edge in texel differences."),
    ] = None,
    view_weights: Annotated[
        str,
        typer.Option(help="What a BTF's views count: uniform, solid-angle, frontal, or a file."),
    ] = "uniform",
    light_weights: Annotated[
        str,
        typer.Option(help="What a BTF's lights count: uniform, solid-angle, frontal, or a file."),
    ] = "uniform",
    samples: Annotated[
        list[str] | None,
        typer.Option("--sample", help="REGION=FILE: another sample for a region; repeatable."),
    ] = None,
    regions: Annotated[
        str, typer.Option(help="Regions: auto, materials, parts, components, or a labels file.")
    ] = "auto",
    border: Annotated[
        list[str] | None,
        typer.Option(help="soft or hard, for all borders; or REGION|REGION=soft; repeatable."),
    ] = None,
    border_width: Annotated[
        int, typer.Option(help="Steps that a sample may reach across a soft border.")
    ] = 12,
    region_scale: Annotated[
        list[str] | None,
        typer.Option(help="REGION=2: the pattern twice as large there; repeatable."),
    ] = None,
    literal: Annotated[bool, typer.Option(help="The paper's way in every step.")] = False,
    refine: Annotated[
        float | None,
        typer.Option(help="Seconds in which the worst seams are cut again with fresh placements."),
    ] = None,
    dense: Annotated[bool, typer.Option(help="Export the dense mesh's shape.")] = False,
    relightable: Annotated[
        bool, typer.Option(help="The .glb also holds what `patina render` needs of it.")
    ] = False,
    preview: Annotated[Path | None, typer.Option(help="Picture of the result (PNG).")] = None,
    save_quilt: Annotated[
        Path | None, typer.Option(help="The quilting map (NPZ), also where the run is cancelled.")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option("--continue", help="Quilting map (NPZ) of a cancelled run, to go on with."),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Figures of the run (JSON).")] = None,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
    verbose: Annotated[bool, typer.Option("-v", "--verbose", help="Print all figures.")] = False,
) -> None:
    """Cover MESH with the material of SAMPLE and write a mesh that other programs open."""
    from btfcore.files.export import SUFFIXES, check_output
    from btfcore.pipeline import decorate as run
    from btfcore.pipeline import export_decorated
    from btfcore.quilt.parameters import QuiltParameters
    from btfcore.regions import RegionSamples

    check_output(output, suffixes=(".glb",) if relightable else SUFFIXES)
    for extra, suffix in ((preview, ".png"), (save_quilt, ".npz"), (report, ".json")):
        if extra is not None:
            check_output(extra, suffixes=(suffix,))
    parameters = QuiltParameters(
        scale=scale,
        seed=seed,
        work_patch=work_patch,
        max_distortion=max_distortion,
        max_seam=max_seam,
        border=border_width,
        literal=literal,
    )
    asked = RegionSamples(regions, samples or (), region_scale or (), border or ())
    with reporter(quiet=quiet) as progress:
        with stoppable(progress) as heeding:
            done = run(
                mesh, sample, rate=rate, parameters=parameters, guide=guide, start=resume,
                view_weights=view_weights, light_weights=light_weights,
                partial=save_quilt is not None, refine_s=refine, regions=asked,
                progress=heeding,
            )  # fmt: skip
            if save_quilt is not None:  # before anything else, so that nothing can lose it
                from btfcore.files.quilt_npz import write_quilt_npz

                write_quilt_npz(save_quilt, done.prepared.dense, done.prepared.field, done.quilt)
            if done.complete:
                progress(1.0, "export")
                export_decorated(
                    output, done, dense_shape=dense, relightable=relightable,
                    progress=lambda fraction, label: heeding(1.0, label),
                )  # fmt: skip
        if not done.complete:
            share = float((done.quilt.patch >= 0).mean())
            say(
                f"patina: cancelled with {share:.0%} covered; {save_quilt} holds that,"
                f" go on with --continue {save_quilt}",
                error=True,
            )
            raise typer.Exit(130)
        if preview is not None:
            progress(1.0, "preview")
            from app.preview import preview_decorated

            preview_decorated(preview, done)
        figures = None
        if report is not None or verbose:
            progress(1.0, "report")
            from btfcore.report import run_report

            figures = run_report(done)
        if report is not None:
            from btfcore.files.atomic import atomic_output

            with atomic_output(report) as handle:
                handle.write(json.dumps(figures, indent=1, allow_nan=False).encode())
    if not quiet:
        for note in done.imported.notes:
            say(f"{mesh.name}: {note}")
        for note in done.sample_notes:
            say(f"{sample.name}: {note}")
        counts = done.engine.statistics
        say(f"{output}: {counts.patches} patches on {len(done.quilt.patch):,} vertices")
    if verbose:
        say(json.dumps(figures, indent=1))


@app.command("regions")
def list_regions(
    mesh: Annotated[Path, typer.Argument(help="OBJ, PLY, STL, OFF, GLB or glTF file.")],
    by: Annotated[
        str, typer.Option(help="auto, materials, parts, components, or a labels file.")
    ] = "auto",
) -> None:
    """List the regions of MESH, to which `decorate --sample` can give samples."""
    from btfcore.pipeline import load_mesh
    from btfcore.regions import region_table

    for row in region_table(load_mesh(mesh, regions=by)[0]):
        typer.echo(f"{row['name']}\t{row['faces']:,} faces\t{row['area']:.1%} of the surface")


@app.command()
def gui(
    file: Annotated[Path | None, typer.Argument(help="Mesh to open.")] = None,
    screenshot: Annotated[
        Path | None, typer.Option(help="Save a picture of the window and quit.")
    ] = None,
    script: Annotated[
        str | None, typer.Option(help="Drive the window by a script, for example 'demo'.")
    ] = None,
) -> None:
    """Open the window, with FILE where one is given."""
    from app.gui import run_gui

    raise typer.Exit(run_gui(file, screenshot=screenshot, script=script))


@app.command()
def bench(
    stage: Annotated[
        str, typer.Argument(help="dense, quilt, peers, bake, factorize, harmonics, …")
    ],
    write: Annotated[bool, typer.Option(help="Write the table into docs/benchmarks.md.")] = False,
    quick: Annotated[bool, typer.Option(help="Fewer meshes, samples and rates.")] = False,
    peer: Annotated[
        list[str] | None,
        typer.Option(
            metavar="'NAME=COMMAND {in} {out}'",
            help="peers: also run this program, which reads one PNG and writes another;"
            " {size} and {seed} are filled in too. May be given again.",
        ),
    ] = None,
    python: Annotated[
        Path | None, typer.Option(help="peers: interpreter with OpenCV, scikit-image, …")
    ] = None,
) -> None:
    """Print run time and error of a stage against its reference, in one run."""
    from app.benches import run_bench

    run_bench(stage, write=write, quick=quick, peers=peer, python=python)


def main() -> None:
    """Run the command line; a named error is one line on stderr and exit status 2."""
    try:
        app()
    except PatinaError as error:
        say(f"patina: {error}", error=True)
        sys.exit(2)
    except (KeyboardInterrupt, Cancelled):
        say("patina: cancelled; nothing half-written is left", error=True)
        sys.exit(130)
