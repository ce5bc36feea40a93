"""`patina render …`: pictures and films of a decorated surface under any light, headless."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.console import reporter, say, stoppable
from btfcore.errors import InvalidParameter

if TYPE_CHECKING:
    from btfcore.progress import Progress
    from btfcore.relighting import Renderer
    from btfcore.render.backdrop import Backdrop
    from btfcore.render.environment import Environment
    from btfcore.render.film import Shot

_PICTURES, _FILMS = (".png", ".exr"), (".mp4", ".gif")
_KEY_LIGHT = "camera:-40,40"  # from the upper left, as drawings are lit


def render(
    source: Annotated[
        Path,
        typer.Argument(metavar="PROJECT|GLB", help="Project (.patina), or a decorated .glb."),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help=".png, .exr, .mp4, .gif, or frames_%04d.png / .exr."),
    ],
    sample: Annotated[
        list[Path] | None,
        typer.Option("--sample", help="Sample of a GLB; repeatable, in its quilt's order."),
    ] = None,
    quilt: Annotated[
        Path | None, typer.Option(help="Quilting map (NPZ) of a GLB that holds none.")
    ] = None,
    light: Annotated[
        list[str] | None,
        typer.Option(
            "--light",
            metavar="AZIMUTH,ELEVATION[,INTENSITY[,#RRGGBB]]",
            help="Directional light, in degrees; after 'camera:' it goes along; repeatable.",
        ),
    ] = None,
    view: Annotated[
        str,
        typer.Option(
            metavar="AZIMUTH,ELEVATION[,DISTANCE]",
            help="Where the camera stands, in degrees and radii; it frames the surface.",
        ),
    ] = "30,18",
    turntable: Annotated[
        int, typer.Option(help="Pictures in which the camera goes around once.")
    ] = 0,
    light_sweep: Annotated[int, typer.Option(help="Pictures in which the lights go around.")] = 0,
    light_path: Annotated[
        str, typer.Option(help="Way of the lights: around the surface, or over it and back.")
    ] = "around",
    env: Annotated[
        Path | None, typer.Option(help="Environment map, latitude-longitude: .hdr, .exr, …")
    ] = None,
    env_rotation: Annotated[
        float, typer.Option(help="Degrees by which it is turned about the vertical.")
    ] = 0.0,
    env_intensity: Annotated[float, typer.Option(help="Factor on its radiance.")] = 1.0,
    env_lights: Annotated[int, typer.Option(help="Lights that stand for it.")] = 256,
    background: Annotated[
        str | None,
        typer.Option(help="gradient, transparent (EXR's default), environment, or #rrggbb."),
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.")] = "1200x900",
    samples: Annotated[int, typer.Option(help="Samples along each side of a pixel, 1 to 8.")] = 4,
    exposure: Annotated[float, typer.Option(help="Stops; not for EXR, which is radiance.")] = 0.0,
    curve: Annotated[str, typer.Option(help="clip, reinhard or filmic; not for EXR.")] = "clip",
    fps: Annotated[float, typer.Option(help="Pictures a second of a film.")] = 25.0,
    representation: Annotated[
        str, typer.Option(help="What samples are rendered from: auto, factors, raw, harmonics.")
    ] = "auto",
    interpolation: Annotated[
        str, typer.Option(help="Of directions: auto, grid, barycentric, nearest4, nearest.")
    ] = "auto",
    rank: Annotated[int | None, typer.Option(help="Factors that are kept at most.")] = None,
    shadows: Annotated[bool, typer.Option(help="The surface casts shadows on itself.")] = False,
    per_pixel: Annotated[
        bool, typer.Option(help="Shade every sample of a pixel on its own; slower.")
    ] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Render a decorated surface under any lights and views, without a display."""
    from btfcore.files.light_file import parse_light, read_environment
    from btfcore.progress import between
    from btfcore.relighting import Look, Renderer, open_relightable
    from btfcore.render.backdrop import parse_backdrop
    from btfcore.render.film import shots
    from btfcore.render.raster import check_size

    look = Look(
        size=_size(size), samples=samples, per_pixel=per_pixel, representation=representation,
        interpolation=interpolation, rank=rank, shadows=shadows, exposure=exposure, curve=curve,
    )  # fmt: skip
    check_size(look.size, samples)
    azimuth, elevation, distance = _view(view)
    lights = [parse_light(text) for text in light or ([] if env is not None else [_KEY_LIGHT])]
    frames = max(turntable, light_sweep, 1)
    _check_output(output, look.size, fps, frames)
    notes: list[str] = []
    with reporter(quiet=quiet) as progress, stoppable(progress) as heeding:
        surroundings: Environment | None = None
        if env is not None:
            surroundings, told = read_environment(
                env, rotation=env_rotation, intensity=env_intensity,
                progress=between(heeding, 0.0, 0.05),
            )  # fmt: skip
            notes += [f"{env.name}: {note}" for note in told]
        floats = output.suffix.lower() == ".exr"
        default = "transparent" if floats else "gradient"
        backdrop = parse_backdrop(background or default, surroundings)
        if backdrop.transparent and output.suffix.lower() in _FILMS:
            raise InvalidParameter(f"{output.suffix} films have no alpha; name another background")
        subject = open_relightable(
            source, samples=sample or (), quilt=quilt, progress=between(heeding, 0.05, 0.2)
        )
        notes += subject.notes
        renderer = Renderer(
            subject, look, lights, environment=surroundings, environment_lights=env_lights,
            progress=between(heeding, 0.2, 0.3),
        )  # fmt: skip
        camera = renderer.camera(azimuth, elevation, distance, turns=turntable)
        film = shots(camera, turntable=turntable, light_sweep=light_sweep, path=light_path)
        _write(output, renderer, film, backdrop, fps, between(heeding, 0.3, 1.0))
    if not quiet:
        for note in notes:
            say(note)
        what = f"{frames} pictures" if frames > 1 else "1 picture"
        say(f"{output}: {what} of {look.size[0]} x {look.size[1]} pixels")


def _write(
    output: Path, renderer: Renderer, film: list[Shot], backdrop: Backdrop, fps: float,
    progress: Progress,
) -> None:  # fmt: skip
    """Render all shots into one file, or one each."""
    from btfcore.files.atomic import write_bytes
    from btfcore.files.movie import is_sequence, numbered, write_movie
    from btfcore.files.png import encode_png
    from btfcore.progress import between

    def parts() -> Iterator[tuple[Shot, Progress]]:
        for number, shot in enumerate(film):
            yield shot, between(progress, number / len(film), (number + 1) / len(film))

    suffix = output.suffix.lower()
    if suffix in _FILMS:
        frames = (renderer.picture(shot, backdrop, progress=part) for shot, part in parts())
        write_movie(output, frames, size=renderer.look.size, fps=fps)
        return
    for number, (shot, part) in enumerate(parts()):
        path = numbered(output, number) if is_sequence(output) else output
        if suffix == ".exr":
            from btfcore.files.exr import encode_exr

            data = encode_exr(renderer.radiance(shot, backdrop, progress=part), half=False)
        else:
            data = encode_png(renderer.picture(shot, backdrop, progress=part))
        write_bytes(path, data)


def _check_output(output: Path, size: tuple[int, int], fps: float, frames: int) -> None:
    """Refuse before long work what would be refused after it."""
    from btfcore.files.export import check_output
    from btfcore.files.movie import check_movie, is_sequence, numbered

    check_output(output, suffixes=(*_PICTURES, *_FILMS))
    suffix = output.suffix.lower()
    sequence = is_sequence(output)
    if sequence:
        numbered(output, 0)
    if suffix in _FILMS:
        if sequence:
            raise InvalidParameter(f"{output.name}: a film is one file, without a %d")
        check_movie(output, size, fps, frames)
    elif frames > 1 and not sequence:
        raise InvalidParameter(
            f"{frames} pictures in one {suffix}: name it like frames_%04d{suffix}, or a film"
            f" ({', '.join(_FILMS)})"
        )


def _size(text: str) -> tuple[int, int]:
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal() and len(text) < 20):
        raise InvalidParameter(f"size {text!r} is not of the form 1200x900")
    return int(width), int(height)


def _view(text: str) -> tuple[float, float, float | None]:
    """Azimuth, elevation and distance of "30,18[,4]"."""
    parts = text.split(",")
    try:
        numbers: list[Any] = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if not 2 <= len(numbers) <= 3 or not all(abs(each) < 1e6 for each in numbers):
        raise InvalidParameter(f"view {text!r} is not of the form AZIMUTH,ELEVATION[,DISTANCE]")
    if not -90 <= numbers[1] <= 90:
        raise InvalidParameter(f"view {text!r}: an elevation of {numbers[1]:g}, not -90 to 90")
    if len(numbers) == 3 and not 0.01 <= numbers[2] <= 1000:
        raise InvalidParameter(f"view {text!r}: a distance of {numbers[2]:g}, not 0.01 to 1000")
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else None
