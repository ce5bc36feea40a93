"""Decodes many images of one set in one guarded child process: raw numbers go in and out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.readers.entries import Entry
from btfcore.btf.readers.listing import FileSet
from btfcore.btf.readers.members import read_bytes
from btfcore.btf.readers.reduce import area_reduced
from btfcore.errors import Cancelled, GuardedFailure, InvalidImage, PatinaError
from btfcore.guard import Arrays, Options, run_guarded
from btfcore.progress import Progress, silent

IMAGES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tif", ".tiff", ".bmp", ".webp", ".tga")
LARGEST_FILE = 1 << 30
MOST_PIXELS = 1 << 26
FREE_PIXELS = 1 << 22
_PIXELS_PER_BYTE = 100  # photographs need a byte for 20 pixels; only bombs promise more than 100
_WORTH_TWO = 24  # images from which on a second child pays for its start


@dataclass(frozen=True, eq=False)
class Raw:
    """One decoded image: values (H, W, 3) or grey (H, W), u1, u2, f2 or f4, as stored.

    meaning : "xyz" or "rec709" where the file says so, else "". flaws : NaN, infinite and
    negative values.
    """

    values: NDArray[Any]
    meaning: str
    notes: tuple[str, ...]
    flaws: tuple[int, int, int]


def decode_images(
    files: FileSet,
    entries: Sequence[Entry],
    *,
    size: tuple[int, int] | None = None,
    most: int = MOST_PIXELS,
    free: int = FREE_PIXELS,
    icc: bool = True,
    reduce: Sequence[tuple[int, bool]] | None = None,
    limit_mb: int = 4096,
    progress: Progress = silent,
) -> list[Raw]:
    """Decode `entries` of `files`, in their order.

    size : (H, W) that every image must have. most : pixels of one image; beyond `free` only
    100 for each byte of its file. icc : bring 8-bit colours to sRGB by their profiles.
    reduce : per image (side, coded): average it down by area until no side is longer, and
    return f4, in 0–1 where integers are stored; those that are sRGB-`coded` are linearised
    before.
    Raises `InvalidImage` or `InvalidBtf`, beginning with the name of the first file that is
    broken or too large or of another size; `GuardedFailure`, with its name, for the one that
    brings the child down.
    """
    wanted = None if size is None else [size[1], size[0]]
    settings = {"most": most, "free": free, "icc": icc, "size": wanted}
    jobs = [
        {**asdict(entry), "reduce": None if reduce is None else list(reduce[number])}
        for number, entry in enumerate(entries)
    ]
    half = len(jobs) // 2
    if len(jobs) < _WORTH_TWO:
        return _run(files, jobs, settings, limit_mb, progress)
    stop = Event()

    def watched(fraction: float, label: str) -> None:
        if stop.is_set():
            raise Cancelled

    with ThreadPoolExecutor(2) as pool:  # each thread only waits for a child
        second = pool.submit(_run, files, jobs[half:], settings, limit_mb, watched)
        try:
            first = _run(files, jobs[:half], settings, limit_mb, progress)
            return first + second.result()
        finally:
            stop.set()  # an error, Cancelled or Ctrl-C here ends the other child too


def _run(
    files: FileSet,
    jobs: list[dict[str, Any]],
    settings: dict[str, Any],
    limit_mb: int,
    progress: Progress,
) -> list[Raw]:
    if not jobs:
        return []
    first = jobs[0]["name"]
    label = f"reading {first}" if len(jobs) == 1 else f"reading {len(jobs)} images of {files.name}"
    megapixels = sum(job["size"] for job in jobs) / 2**20
    try:
        with TemporaryDirectory(prefix="patina-") as scratch:  # outlives a child that is killed
            arrays, answer = run_guarded(
                "btfcore.btf.readers.decode:decode",
                {},
                {**settings, "place": str(files.place), "jobs": jobs, "scratch": scratch},
                limit_s=30 + len(jobs) + megapixels,
                limit_mb=limit_mb,
                progress=progress,
                label=label,
            )
    except GuardedFailure as error:
        if len(jobs) == 1:
            raise GuardedFailure(f"{first}: {error}") from error
        half = len(jobs) // 2  # find the one that did it
        return _run(files, jobs[:half], settings, limit_mb, progress) + _run(
            files, jobs[half:], settings, limit_mb, progress
        )
    except OSError as error:
        raise GuardedFailure(f"{files.name}: no room for temporary files: {error}") from error
    return [
        Raw(arrays[str(number)], entry["meaning"], tuple(entry["notes"]), tuple(entry["flaws"]))
        for number, entry in enumerate(answer["images"])
    ]


def decode(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Guarded task: decode options["jobs"] (the fields of `Entry`, and "reduce").

    Further options: "place" of the folder or archive, an empty folder "scratch", "free" pixels,
    and those of `btfcore.btf.pillow_door.raw_picture`. Returns arrays "0", "1", … and
    options["images"].
    """
    out: Arrays = {}
    images = []
    for number, job in enumerate(options["jobs"]):
        reduce = job.pop("reduce")
        entry = Entry(**job)
        notes: list[str] = []
        try:
            values, meaning = _decoded(Path(options["place"]), entry, options, notes)
        except PatinaError as error:
            text = str(error)
            named = text if text.startswith(entry.name) else f"{entry.name}: {text}"
            raise type(error)(named) from error
        except MemoryError:
            raise
        except Exception as error:  # decoders meet broken files with any exception there is
            reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:300]
            raise InvalidImage(f"{entry.name}: the image is broken or cut off ({reason})") from None
        if options["size"] is not None and list(values.shape[1::-1]) != options["size"]:
            wanted = options["size"]
            raise InvalidImage(
                f"{entry.name}: its size is {values.shape[1]} x {values.shape[0]}, that of the"
                f" first image {wanted[0]} x {wanted[1]}"
            )
        flaws = _flaws(values)
        if reduce is not None:
            values = _reduced(values, *reduce)
        out[str(number)] = values
        images.append({"meaning": meaning, "notes": notes, "flaws": flaws})
    return out, {"images": images}


def _decoded(
    place: Path, entry: Entry, options: Options, notes: list[str]
) -> tuple[NDArray[Any], str]:
    from btfcore.btf import pillow_door

    data = read_bytes(place, entry, most=LARGEST_FILE)
    most = min(options["most"], max(options["free"], _PIXELS_PER_BYTE * len(data)))
    options = {**options, "most": most}
    kind = _deep_kind(data[:32])
    if kind is not None:
        from btfcore.btf import oiio_door  # only where it is needed: it takes longer to start

        path = Path(options["scratch"]) / f"image{oiio_door.KINDS[kind][0]}"
        path.write_bytes(data)
        found = oiio_door.raw_picture(path, kind, options, notes)
        if found is not None:
            return found
    return pillow_door.raw_picture(data, entry.suffix, options, notes), ""


def _deep_kind(head: bytes) -> str | None:
    """`btfcore.btf.oiio_door.kind_of`, without loading the library for what is Pillow's."""
    if head.startswith((b"\xff\xd8\xff", b"BM", b"RIFF")):
        return None
    if head.startswith(b"\x89PNG") and head[24:25] != b"\x10":
        return None
    from btfcore.btf import oiio_door

    return oiio_door.kind_of(head)


def _reduced(values: NDArray[Any], side: int, coded: bool) -> NDArray[Any]:
    height, width = values.shape[:2]
    factor = min(1.0, side / max(height, width))
    size = (max(1, round(height * factor)), max(1, round(width * factor)))
    return area_reduced(values, *size, coded and values.dtype.kind == "u")


def _flaws(values: NDArray[Any]) -> tuple[int, int, int]:
    """Numbers of NaN, infinite and negative values."""
    if values.dtype.kind != "f" or (values.min() >= 0 and values.max() < np.inf):
        return 0, 0, 0
    finite = np.isfinite(values)
    nan = int(np.isnan(values).sum())
    return nan, int(values.size - finite.sum()) - nan, int((values[finite] < 0).sum())
