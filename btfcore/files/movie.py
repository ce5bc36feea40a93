"""Films out: MP4 (H.264) through PyAV, GIF through Pillow, or one PNG for each picture.

The same pictures give the same bytes with one release of the encoder: it runs in one thread,
and nothing of the clock is written down.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter, OutputFailed
from btfcore.files.atomic import atomic_output, write_bytes
from btfcore.files.png import encode_gif, encode_png, palette_of

U1 = NDArray[np.uint8]
Frames = Callable[[], Iterator[U1]]

SUFFIXES = (".mp4", ".gif")
_LARGEST = 8192  # a side of an MP4
_GIF_PIXELS = 1 << 28  # of all pictures of a GIF
_BT709 = 1  # colour primaries, transfer and matrix of ITU-T H.273
_LIMITED = 1  # range of FFmpeg's enumeration: 16 to 235


def check_movie(path: str | Path, size: tuple[int, int], fps: float, count: int) -> None:
    """Refuse before long work what would be refused after it; raises `InvalidParameter`.

    An MP4 has even sides of at most 8192 pixels; a GIF at most 2^28 pixels in all its pictures.
    """
    if not 0.1 <= fps <= 240:
        raise InvalidParameter(f"{fps:g} pictures a second, 0.1 to 240 can be")
    width, height = size
    suffix = Path(path).suffix.lower()
    if suffix == ".mp4" and (width % 2 or height % 2 or max(size) > _LARGEST or min(size) < 2):
        raise InvalidParameter(
            f"an MP4 of {width} x {height} pixels; both must be even, 2 to {_LARGEST}"
        )
    if suffix == ".gif" and width * height * count > _GIF_PIXELS:
        raise InvalidParameter(
            f"a GIF of {count} pictures of {width} x {height} pixels; an MP4 has room for that"
        )
    if suffix == ".gif" and fps > 50:
        raise InvalidParameter(f"a GIF of {fps:g} pictures a second; viewers show at most 50")


def write_movie(
    path: str | Path, frames: Iterable[U1], *, size: tuple[int, int], fps: float = 25.0
) -> None:
    """Write pictures (H, W, 3) u8, sRGB-coded, as .mp4 or .gif, or as PNGs where `path` has a %d.

    size : width and height of all of them. The file appears when it is whole; PNGs one by one.
    Raises `InvalidParameter` as `check_movie` does and for a wrong picture, `OutputFailed` where
    the encoder fails or is not there, or the system refuses.
    """
    given = Path(path)
    if is_sequence(given):
        for number, frame in enumerate(_checked(frames, size)):
            write_bytes(numbered(given, number), encode_png(frame))
        return
    check_movie(given, size, fps, 1)
    suffix = given.suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidParameter(f"a film in {given.suffix!r}; there are {', '.join(SUFFIXES)}")
    with atomic_output(given) as handle:
        if suffix == ".mp4":
            _write_mp4(handle, _checked(frames, size), size, fps)
        else:
            handle.write(gif(list(_checked(frames, size)), fps))


def is_sequence(path: str | Path) -> bool:
    """Whether a name stands for many, one for each picture: it holds %d or %04d."""
    return re.search(r"%(0\d)?d", Path(path).name) is not None


def numbered(path: str | Path, number: int) -> Path:
    """Name of picture `number` of a sequence; raises `InvalidParameter` for more than one %d."""
    given = Path(path)
    found = re.findall(r"%(?:0(\d))?d", given.name)
    if len(found) != 1:
        raise InvalidParameter(f"{given.name!r} must have one %d (or %04d) for the number")
    digits = str(number).zfill(int(found[0] or 0))
    return given.with_name(re.sub(r"%(0\d)?d", digits, given.name))


def gif(frames: list[U1], fps: float) -> bytes:
    """GIF of pictures (H, W, 3) u8 that plays for ever, all with one palette of their own.

    One palette for all: with one for each picture what stands still would flicker.
    """
    if not frames:
        raise InvalidParameter("a film without pictures")
    # spread evenly over the film, and few enough to be counted
    chosen = frames[:: max(1, len(frames) // 16)]
    thin = max(1, int(np.sqrt(sum(each.shape[0] * each.shape[1] for each in chosen) / 2e6)))
    palette = palette_of([each[::thin, ::thin] for each in chosen])
    return encode_gif(frames, palette, durations(len(frames), fps))


def durations(count: int, fps: float) -> list[int]:
    """Milliseconds of each picture of a GIF, in whole hundredths of a second, right in sum."""
    ends = [round(100 * (each + 1) / fps) for each in range(count)]
    return [10 * (end - begin) for begin, end in zip([0, *ends], ends, strict=False)]


# --- inside


def _checked(frames: Iterable[U1], size: tuple[int, int]) -> Iterator[U1]:
    for number, frame in enumerate(frames):
        if frame.shape != (size[1], size[0], 3) or frame.dtype != np.uint8:
            raise InvalidParameter(
                f"picture {number} is {frame.shape} {frame.dtype}, where"
                f" ({size[1]}, {size[0]}, 3) uint8 is needed"
            )
        yield frame


def _write_mp4(handle: BinaryIO, frames: Iterator[U1], size: tuple[int, int], fps: float) -> None:
    """H.264, yuv420p, marked and converted as BT.709 in limited range."""
    try:
        import av
    except ImportError as error:
        raise OutputFailed(f"MP4 needs the library PyAV (pip install av): {error}") from error
    rate = Fraction(fps).limit_denominator(1001)
    try:
        with av.open(handle, "w", format="mp4", options={"fflags": "+bitexact"}) as container:
            stream = _stream(av, container, size, rate)
            for number, picture in enumerate(frames):
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
                coded = frame.reformat(
                    format="yuv420p", dst_colorspace="ITU709", src_color_range="JPEG",
                    dst_color_range="MPEG",
                )  # fmt: skip
                coded.pts, coded.time_base = number, 1 / rate
                coded.colorspace = coded.color_primaries = coded.color_trc = _BT709
                container.mux(stream.encode(coded))
            container.mux(stream.encode(None))
    except av.FFmpegError as error:
        raise OutputFailed(f"the film could not be encoded: {error}") from error


def _stream(av: Any, container: Any, size: tuple[int, int], rate: Fraction) -> Any:
    try:
        stream = container.add_stream("libx264", rate=rate)
    except (av.FFmpegError, ValueError) as error:
        raise OutputFailed(f"this build of PyAV has no H.264 encoder: {error}") from error
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    stream.options = {"crf": "16", "preset": "medium", "threads": "1", "bf": "2"}
    context = stream.codec_context
    context.thread_count = 1
    context.flags |= av.codec.context.Flags.bitexact
    context.color_primaries = context.color_trc = context.colorspace = _BT709
    context.color_range = _LIMITED
    context.time_base = 1 / rate
    return stream
