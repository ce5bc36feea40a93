"""Reads the University of Bonn's BTF files: DFMF, FMF, PVF and BDI."""

from __future__ import annotations

import mmap
from pathlib import Path
from typing import Any

from btfcore.btf.bonn.bdi import read_bdi
from btfcore.btf.bonn.cursor import Cursor
from btfcore.btf.bonn.factors import FactorStack
from btfcore.btf.bonn.header import (
    MOST_DIRECTIONS,
    Description,
    Layout,
    kind_of,
    read_directions,
    read_size,
    read_start,
    skip_rotations,
)
from btfcore.btf.bonn.payloads import MOST_COMPONENTS, read_dfmf, read_fmf, read_pvf
from btfcore.btf.sample import BtfSample, full_index
from btfcore.btf.stack import ImageStack
from btfcore.errors import InvalidBtf, InvalidParameter

HEAD = 10  # bytes that tell the format
_POINTER = b"version https://git-lfs"
_OLD = "the old PVF layout: no description of the measurement, texel size unknown"


def is_bonn(head: bytes) -> bool:
    """Whether a file whose first `HEAD` bytes (or more) are `head` is one of Bonn's."""
    return kind_of(head) is not None


def read_bonn(
    path: str | Path,
    *,
    components: int | None = None,
    flip: bool = False,
    memory_mb: float = 512,
) -> BtfSample:
    """Read a DFMF, FMF (06, 12), PVF or BDI file as a sample.

    The file is mapped, not loaded, and must stay as it is for as long as the sample is used.
    Image j is that of view j // L under light j % L. Radiance is linear and unclamped above.

    components : use only the first so many components (of each channel); more are no error;
    BDI files have none. flip : the file's first row is the lowest; whether it is the top one,
    as we take it, the sources disagree about. memory_mb : what reading the images may keep in
    memory (the mapped file aside).

    `cosine` of the sample is the file's flag: the values are as stored, never divided by the
    light's cosine, unlike those of Bonn's own reader. Files older than the flag, and the old
    PVF layout, are taken as without cosine, as there. The factors of the "RGB scale" and the
    rotations of local frames are not applied (nor are they there); `notes` tells of them.

    Raises `InvalidBtf` for what is no such file, contradicts itself, ends early or goes on, is
    spectral or compressed; messages begin with the file's name and give the byte.
    Raises `InvalidParameter` for knobs outside their range.
    """
    file = Path(path)
    _check_knobs(components, memory_mb)
    data = _mapped(file)
    return bonn_sample(
        file.name, data, components=components, flip=flip, memory_mb=memory_mb, stem=file.stem
    )


def bonn_sample(
    name: str,
    data: Any,
    *,
    components: int | None = None,
    flip: bool = False,
    memory_mb: float = 512,
    stem: str | None = None,
) -> BtfSample:
    """Read a sample out of a file's bytes or another buffer; see `read_bonn`.

    name : begins the messages; stem : the sample's name, `name` where none is given.
    """
    _check_knobs(components, memory_mb)
    cursor = Cursor(name, data)
    kind = kind_of(bytes(data[:16]))
    if kind is None:
        begin = bytes(data[:8])
        raise cursor.wrong(f"the file begins with {begin!r}, but no Bonn BTF file does")
    description, rotations = read_start(cursor)
    announced = 0, 0
    if description is None:
        layout, announced = _old_layout(cursor)
    else:
        layout = _layout(cursor, description, rotations, kind)
        if kind == "PVF":
            announced = _announced(cursor)
    stack: ImageStack
    if kind == "BDI":
        stack, notes = read_bdi(cursor, layout, flip=flip, memory_mb=memory_mb)
    else:
        if kind == "DFMF":
            payload = read_dfmf(cursor, layout, components)
        elif kind == "PVF":
            payload = read_pvf(
                cursor, layout, components, announced=announced[0], slots=announced[1]
            )
        else:
            payload = read_fmf(cursor, layout, components, extended=kind == "FMF12")
        size = layout.height, layout.width
        factors = FactorStack(
            payload.slots, *size, model=payload.model, flip=flip, memory_mb=memory_mb
        )
        stack, notes = factors, payload.notes
        if factors.flaws is None:
            notes += ("too many factors to look for those that are not finite, which count as 0",)
        elif factors.flaws:
            notes += (f"{factors.flaws:,} factors are not finite and count as 0",)
    words = [word for word in layout.description.words if word]
    return BtfSample(
        stem or name,
        stack,
        layout.views,
        layout.lights,
        full_index(len(layout.views), len(layout.lights)),
        texel_size=layout.description.texel_size,
        cosine=layout.description.cosine,
        origin="; ".join([f"Bonn {kind} file {name}", *words]),
        notes=layout.description.notes + layout.notes + notes,
    )


def _layout(cursor: Cursor, description: Description, rotations: bool, kind: str) -> Layout:
    views, lights = read_directions(cursor)
    height, width = read_size(cursor)
    notes = skip_rotations(cursor) if rotations and kind != "BDI" else ()
    return Layout(description, views, lights, height, width, notes)


def _old_layout(cursor: Cursor) -> tuple[Layout, tuple[int, int]]:
    components = cursor.count("number of components", MOST_COMPONENTS)
    height, width = read_size(cursor)
    slots = cursor.count("number of slots", MOST_DIRECTIONS)
    views, lights = read_directions(cursor)
    layout = Layout(Description(), views, lights, height, width, (_OLD,))
    return layout, (components, slots)


def _announced(cursor: Cursor) -> tuple[int, int]:
    components = cursor.count("number of components", MOST_COMPONENTS)
    return components, cursor.count("number of slots", MOST_DIRECTIONS)


def _check_knobs(components: int | None, memory_mb: float) -> None:
    if components is not None and components < 1:
        raise InvalidParameter(f"components is {components}, at least 1 is needed")
    if not memory_mb >= 0:
        raise InvalidParameter(f"memory_mb is {memory_mb}, at least 0 is needed")


def _mapped(file: Path) -> mmap.mmap:
    """Map `file` into memory, read-only."""
    try:
        if not file.exists():
            raise InvalidBtf(f"{file.name}: there is no such file in {file.absolute().parent}")
        if not file.is_file():
            raise InvalidBtf(f"{file.name}: this is no regular file")
        size = file.stat().st_size
        if size < HEAD:
            raise InvalidBtf(f"{file.name}: {size} bytes are no Bonn BTF file")
        with file.open("rb") as stream:
            head = stream.read(len(_POINTER))
            if head == _POINTER:
                raise InvalidBtf(
                    f"{file.name}: this is a Git LFS pointer, not the file: run `git lfs pull`"
                )
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidBtf(f"{file.name}: the file cannot be opened: {error}") from error
