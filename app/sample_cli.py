"""`patina sample …`: look at, bake, factorise and convert material samples."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.console import reporter, say
from btfcore.errors import InvalidParameter

if TYPE_CHECKING:
    from btfcore.btf.sample import BtfSample

sample_app = typer.Typer(
    help="Look at, bake, factorise and convert material samples (BTFs).", no_args_is_help=True
)
_ENCODINGS = ("auto", "linear", "sqrt", "log", "logluma")
_LEAST_MEMORY = 64
_Input = Annotated[
    Path, typer.Argument(help="Package, Bonn file, zip or folder of images, PTM, PBR set, image.")
]
_Layout = Annotated[
    str,
    typer.Option(
        help="Directions of a baked PBR set, lights of a PTM: ubo81, 12x8x12x8, … or a file."
    ),
]
_Size = Annotated[
    int | None, typer.Option(help="Largest side in texels of a baked PBR set (default 128).")
]
_Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")]
_Json = Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")]
_Memory = Annotated[
    int, typer.Option(help="MiB of memory for the data, besides the program's 200.")
]
_Encoding = Annotated[str, typer.Option(help="auto, linear, sqrt, log or logluma.")]
_Rmse = Annotated[float, typer.Option(help="Wanted sRGB RMSE with --rank auto.")]
_Rank = Annotated[str, typer.Option(help="Number of factors, or auto to meet --rmse.")]


@sample_app.command()
def info(
    path: _Input, layout: _Layout = "ubo81", size: _Size = None, as_json: _Json = False
) -> None:
    """Say what a sample is: size, directions, what is missing, where it comes from."""
    from btfcore.files.samples import kind_of, open_sample
    from btfcore.samples import description

    figures = {"kind": kind_of(path), **description(open_sample(path, layout=layout, size=size))}
    _show(figures, as_json)


@sample_app.command()
def preview(
    paths: Annotated[list[Path], typer.Argument(help="One or more samples.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Picture (PNG).")],
    views: Annotated[
        str | None, typer.Option(help="Views 'theta,phi theta,phi …' in degrees.")
    ] = None,
    lights: Annotated[
        str | None, typer.Option(help="Lights 'theta,phi theta,phi …' in degrees.")
    ] = None,
    cell: Annotated[int, typer.Option(help="Side of a picture in pixels.")] = 192,
    exposure: Annotated[float, typer.Option(help="Stops brighter (+) or darker (-).")] = 0.0,
    layout: _Layout = "ubo81",
    size: _Size = None,
    quiet: _Quiet = False,
) -> None:
    """Write a contact sheet: chosen views as rows, lights as columns."""
    from app.contact import DEFAULT_LIGHTS, DEFAULT_VIEWS, Sheet, contact_sheet, parse_angles
    from btfcore.files.atomic import write_bytes
    from btfcore.files.export import check_output
    from btfcore.files.png import encode_png
    from btfcore.files.samples import open_sample

    check_output(output, suffixes=(".png",))
    _check_other(output, *paths)
    sheet = Sheet(
        parse_angles(views if views is not None else DEFAULT_VIEWS, "view"),
        parse_angles(lights if lights is not None else DEFAULT_LIGHTS, "light"),
        cell,
        exposure,
    )
    with reporter(quiet=quiet) as progress:
        samples = [open_sample(path, layout=layout, size=size) for path in paths]
        page = contact_sheet(samples, sheet, progress=progress)
    write_bytes(output, encode_png(page))
    if not quiet:
        say(f"{output}: {page.shape[1]} x {page.shape[0]} pixels")


@sample_app.command()
def bake(
    path: Annotated[
        Path,
        typer.Argument(help="PBR set: folder, zip or one of its maps; a lone albedo."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help=".btfz, .zip or .btf.")],
    layout: _Layout = "ubo81",
    size: _Size = None,
    depth: Annotated[
        float | None, typer.Option(help="Relief in texels (default: from the normal map).")
    ] = None,
    shadows: Annotated[bool, typer.Option(help="Cast shadows within the relief.")] = True,
    parallax: Annotated[bool, typer.Option(help="Shift and hide by the relief.")] = True,
    bounce: Annotated[bool, typer.Option(help="Add light bounced once by the relief.")] = False,
    rank: Annotated[
        str, typer.Option(help="Factors to keep, auto, or 'none' to keep all images.")
    ] = "40",
    rmse: _Rmse = 0.02,
    encoding: _Encoding = "auto",
    memory: _Memory = 2048,
    quiet: _Quiet = False,
) -> None:
    """Make a BTF of a PBR set: parallax, self-shadowing, occlusion and GGX highlights."""
    from btfcore.files.samples import check_sample_output, directions_of, save_sample
    from btfcore.samples import bake_files, with_factors

    check_sample_output(output)
    _check_other(output, path)
    views, lights = directions_of(layout)
    factors = rank != "none"
    number = _knobs(rank if factors else "1", rmse, encoding, memory)
    with reporter(quiet=quiet) as progress:
        sample = bake_files(
            path, views, lights, size=size, depth=depth, shadows=shadows, parallax=parallax,
            bounce=bounce, memory_mb=memory / 2 if factors else memory, progress=progress,
        )  # fmt: skip
        if factors and not sample.is_image:
            sample = with_factors(
                sample, rank=number, rmse=rmse, encoding=encoding, memory_mb=memory,
                progress=progress,
            )  # fmt: skip
        notes = save_sample(output, sample, progress=progress)
    _written(output, sample, notes, quiet)


@sample_app.command()
def factorize(
    path: _Input,
    output: Annotated[Path, typer.Option("-o", "--output", help="Package (.btfz).")],
    rank: _Rank = "40",
    rmse: _Rmse = 0.02,
    encoding: _Encoding = "auto",
    knee: Annotated[
        str, typer.Option(help="Radiance above which highlights are compressed; auto or none.")
    ] = "auto",
    memory: _Memory = 2048,
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 0,
    layout: _Layout = "ubo81",
    size: _Size = None,
    quiet: _Quiet = False,
) -> None:
    """Factorise a BTF (Zhou's SVD) into a small package."""
    from btfcore.files.export import check_output
    from btfcore.files.samples import open_sample, save_sample
    from btfcore.samples import with_factors

    check_output(output, suffixes=(".btfz",))
    _check_other(output, path)
    number = _knobs(rank, rmse, encoding, memory)
    with reporter(quiet=quiet) as progress:
        sample = with_factors(
            open_sample(path, layout=layout, size=size),
            rank=number, rmse=rmse, encoding=encoding, knee=_knee(knee), memory_mb=memory,
            seed=seed, progress=progress,
        )  # fmt: skip
        notes = save_sample(output, sample, progress=progress)
    _written(output, sample, notes, quiet)


@sample_app.command()
def convert(
    path: _Input,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help=".btfz, .zip (Bonn names) or .btf (Bonn DFMF)."),
    ],
    components: Annotated[
        int, typer.Option(help="Components of each channel of a .btf file.")
    ] = 100,
    images: Annotated[
        str, typer.Option(help="Images in a zip: exr, exr-float, hdr, png, jpeg.")
    ] = "exr",
    raw: Annotated[bool, typer.Option(help="Write a package's images, not its factors.")] = False,
    layout: _Layout = "ubo81",
    size: _Size = None,
    quiet: _Quiet = False,
) -> None:
    """Write a sample in another format."""
    from dataclasses import replace

    from btfcore.files.samples import check_sample_output, open_sample, save_sample

    check_sample_output(output)
    _check_other(output, path)
    with reporter(quiet=quiet) as progress:
        sample = open_sample(path, layout=layout, size=size)
        if raw:
            sample = replace(sample, factors=None)
        notes = save_sample(
            output, sample, components=components, image_kind=images, progress=progress
        )
    _written(output, sample, notes, quiet)


@sample_app.command()
def errors(
    path: _Input,
    against: Annotated[
        Path | None, typer.Option(help="Reference with the same directions and size.")
    ] = None,
    rank: _Rank = "40",
    rmse: _Rmse = 0.02,
    encoding: _Encoding = "auto",
    held_out: Annotated[
        bool, typer.Option("--held-out", help="Also measure on texels that were left out.")
    ] = False,
    memory: _Memory = 2048,
    layout: _Layout = "ubo81",
    size: _Size = None,
    as_json: _Json = False,
    quiet: _Quiet = False,
) -> None:
    """Print how far a factorised sample is from its images, or from another sample."""
    from btfcore.files.samples import open_sample
    from btfcore.samples import error_figures

    number = _knobs(rank, rmse, encoding, memory)
    with reporter(quiet=quiet) as progress:
        sample = open_sample(path, layout=layout, size=size)
        reference = None if against is None else open_sample(against, layout=layout, size=size)
        figures = error_figures(
            sample, reference, rank=number, rmse=rmse, encoding=encoding,
            held_out=held_out, memory_mb=memory, progress=progress,
        )  # fmt: skip
    _show(figures, as_json)


def _check_other(output: Path, *inputs: Path | None) -> None:
    """Refuse to write over what is read: factors do not bring the images back."""
    for path in inputs:
        if path is not None and path.exists() and output.exists() and output.samefile(path):
            raise InvalidParameter(f"{output}: output and input are the same file")


def _knobs(rank: str, rmse: float, encoding: str, memory: int) -> Any:
    """Check knobs before work that takes long, and return the rank as number or "auto"."""
    if not 0 < rmse < 1:
        raise InvalidParameter(f"an RMSE of {rmse}; above 0 and below 1 can be asked for")
    if encoding not in _ENCODINGS:
        raise InvalidParameter(f"encoding {encoding!r}; there are {', '.join(_ENCODINGS)}")
    if memory < _LEAST_MEMORY:
        raise InvalidParameter(f"a memory of {memory} MiB; at least {_LEAST_MEMORY} are needed")
    return _rank(rank)


def _rank(text: str) -> Any:
    if text == "auto":
        return text
    try:
        rank = int(text)
    except ValueError:
        raise InvalidParameter(f"rank {text!r} is neither a whole number nor 'auto'") from None
    if not 1 <= rank <= 4096:
        raise InvalidParameter(f"rank {rank} lies outside 1 … 4096")
    return rank


def _knee(text: str) -> Any:
    if text in ("auto", "none"):
        return "auto" if text == "auto" else None
    try:
        return float(text)
    except ValueError:
        raise InvalidParameter(f"knee {text!r} is no number, 'auto' or 'none'") from None


def _written(output: Path, sample: BtfSample, notes: tuple[str, ...], quiet: bool) -> None:
    if quiet:
        return
    for note in (*sample.notes, *notes):
        say(f"{sample.name}: {note}")
    height, width = sample.shape
    what = f"{width} x {height} texels, {len(sample.views)} views x {len(sample.lights)} lights"
    if sample.factors is not None:
        what += f", {sample.factors.rank} factors"
    say(f"{output}: {what}, {output.stat().st_size / 1e6:.2f} MB")


def _show(figures: dict[str, Any], as_json: bool) -> None:
    if as_json:
        say(json.dumps(figures, indent=1, allow_nan=False))
        return
    width = max(len(key) for key in figures)
    for key, value in figures.items():
        if isinstance(value, list) and not all(isinstance(line, str) for line in value):
            value = ", ".join(str(number) for number in value)
        lines = value if isinstance(value, list) else [value]
        for place, line in enumerate(lines):
            say(f"{key if place == 0 else '':<{width}}  {line}")
