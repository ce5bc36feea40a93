"""Writes BTF samples as DFMF files, the University of Bonn's factorised format."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.bonn.header import MOST_DIRECTIONS, MOST_PAIRS
from btfcore.btf.bonn.models import NAMES, RGB, YLOG_RATIOS, encode
from btfcore.btf.bonn.svd import Factors, Matrices, factorise
from btfcore.btf.materialize import materialize
from btfcore.btf.sample import BtfSample
from btfcore.btf.stack import block_size
from btfcore.errors import InvalidBtf, InvalidParameter
from btfcore.files.atomic import atomic_output, check_writable
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8

SCALARS = {"half": "<f2", "float": "<f4", "double": "<f8"}
LARGEST_HALF = 65504.0
_BLOCK_MB = 16.0
_NUMBERS = 1 << 20  # written at a time
_WORD = 80
_SMALL = 2.0**-6  # a peak below leaves many a factor without its 11 bits


def write_dfmf(
    path: str | Path,
    sample: BtfSample,
    *,
    components: int | Sequence[int] = 40,
    scalar: str = "half",
    colour_model: int = YLOG_RATIOS,
    version: int = 4,
    seed: int = 0,
    memory_mb: float = 1024,
    progress: Progress = silent,
) -> tuple[float, ...]:
    """Factorise a sample and write it as a DFMF file; returns each channel's relative L2 error.

    The errors are those of the coded values by truncation; the rounding of `scalar` comes on
    top: half floats change log-luminance by up to some 5e-3, which is half a per cent of the
    radiance.

    components : of each channel, or of the three; no more than images or texels are written.
    scalar : "half", as Bonn's own writer has it, "float" or "double". colour_model : 11
    (log Y, U/Y, V/Y) or 0 (RGB). version : of the file's description, 1 to 4; 1 cannot tell
    of the light's cosine, 3 and 4 carry name, licence and citation as XML. seed : draws the
    randomised decomposition that large samples need. memory_mb : for reading the images,
    besides some times (images + texels) × components numbers.

    The mask, whether the sample tiles, and notes are not part of the format. Raises
    `InvalidBtf` where pairs of view and light are missing or there are too many,
    `InvalidParameter` for knobs outside their range, `OutputFailed` as
    `btfcore.files.atomic.atomic_output` does; nothing is left under `path` then.
    """
    ranks = _check(sample, components, scalar, colour_model, version)
    check_writable(path)
    ready = materialize(sample, memory_mb=memory_mb / 2, progress=between(progress, 0, 0.3))
    height, width = sample.shape
    order = sample.index.ravel()  # the light runs fastest, as the format wants it

    def read(where: slice) -> F4:
        radiance = ready.stack.read(order[where])
        return encode(colour_model, radiance.reshape(len(radiance), height * width, 3))

    step = block_size(ready.stack, budget_mb=min(_BLOCK_MB, memory_mb / 8))
    matrices = Matrices(read, sample.images, height * width, ranks, step)
    channels = factorise(matrices, seed=seed, progress=between(progress, 0.3, 0.95))
    with atomic_output(path) as handle:
        _write_layout(handle, sample, version)
        handle.write(struct.pack("<Ii", max(len(item.singular) for item in channels), colour_model))
        handle.write(np.r_[np.zeros(3), np.eye(3).ravel()].astype("<f4").tobytes())
        for item in channels:
            _write_channel(handle, sample.name, item, scalar)
            progress(0.95, f"writing {Path(path).name}")
    progress(1.0, f"writing {Path(path).name}")
    return tuple(item.error for item in channels)


def _check(
    sample: BtfSample,
    components: int | Sequence[int],
    scalar: str,
    colour_model: int,
    version: int,
) -> list[int]:
    """Components to be written of each channel."""
    wanted = [components] * 3 if isinstance(components, int) else list(components)
    if len(wanted) != 3 or min(wanted) < 1:
        raise InvalidParameter(f"components is {components}, one or three numbers from 1 on serve")
    if scalar not in SCALARS:
        raise InvalidParameter(f"scalar is {scalar!r}, one of {', '.join(SCALARS)} is needed")
    if colour_model not in (RGB, YLOG_RATIOS):
        raise InvalidParameter(
            f"colour_model is {colour_model}, {RGB} ({NAMES[RGB]}) or {YLOG_RATIOS}"
            f" ({NAMES[YLOG_RATIOS]}) can be written"
        )
    if not 1 <= version <= 4 or (version == 1 and sample.cosine):
        least = 2 if sample.cosine else 1
        raise InvalidParameter(f"version is {version}, {least} to 4 can be written")
    if sample.missing:
        raise InvalidBtf(
            f"{sample.name}: {sample.missing:,} pairs of view and light have no image, but a DFMF"
            " file holds all"
        )
    if sample.images > MOST_PAIRS or max(sample.index.shape) > MOST_DIRECTIONS:
        raise InvalidBtf(
            f"{sample.name}: {sample.index.shape[0]:,} views and {sample.index.shape[1]:,} lights"
            f" are too many, up to {MOST_DIRECTIONS:,} each and {MOST_PAIRS:,} pairs are read"
        )
    most = min(sample.images, sample.shape[0] * sample.shape[1])
    return [min(number, most) for number in wanted]


def _write_layout(handle: BinaryIO, sample: BtfSample, version: int) -> None:
    handle.write(b"!DFMF08FCR")
    words = [sample.name.encode("ascii", "replace")[: _WORD - 1], b"", b"Patina"]
    fixed = b"".join(word.ljust(_WORD, b"\0") for word in words)
    rest = struct.pack("<4f", 1 / sample.texel_size if sample.texel_size else 0, 1, 1, 1)
    if version > 1:
        rest += struct.pack("<I", sample.cosine)
    if version > 2:
        xml = _xml(sample)
        rest += struct.pack("<I", len(xml)) + xml
    if version > 3:
        rest += struct.pack("<I", 3) + b"".join(struct.pack("<I", 1) + name for name in _RGB)
    handle.write(struct.pack("<II", 8 + len(fixed) + len(rest), version) + fixed + rest)
    lights = struct.pack("<I", len(sample.lights)) + _angles(sample.lights).tobytes()
    handle.write(struct.pack("<I", len(sample.views)))
    for angles in _angles(sample.views):
        handle.write(angles.tobytes() + lights)
    height, width = sample.shape
    handle.write(struct.pack("<III", width, height, 0))  # no rotations


_RGB = (b"R", b"G", b"B")


def _xml(sample: BtfSample) -> bytes:
    """What must not get lost, for people: Bonn's readers skip it."""
    parts = {"name": sample.name, "licence": sample.licence, "citation": sample.citation}
    inner = "".join(f"<{tag}>{escape(text)}</{tag}>" for tag, text in parts.items() if text)
    return f"<patina>{inner}</patina>".encode("utf-8", "replace")


def _angles(directions: F8) -> NDArray[np.float32]:
    """Polar angle and azimuth (n, 2) f4 in radians."""
    x, y, z = directions.T
    return np.stack(
        [np.arctan2(np.hypot(x, y), np.maximum(z, 0)), np.arctan2(y, x)], axis=1
    ).astype("<f4")


def _write_channel(handle: BinaryIO, name: str, factors: Factors, scalar: str) -> None:
    left, right, singular = factors.left, factors.right, factors.singular
    if scalar == "half":
        left, right, singular = _halved(name, factors)
    kind = SCALARS[scalar]
    size = np.dtype(kind).itemsize
    handle.write(struct.pack("<BIII", size, len(singular), len(left), len(right)))
    handle.write(singular.astype(kind).tobytes())
    for matrix in (left, right):
        step = max(1, _NUMBERS // matrix.shape[1])
        for start in range(0, len(matrix), step):
            handle.write(np.ascontiguousarray(matrix[start : start + step], kind).tobytes())


def _halved(name: str, factors: Factors) -> tuple[Any, Any, Any]:
    """Factors that half floats can hold: powers of two move between the right and the left.

    That is done for components whose right factors are too large, or so small that they would
    lose digits; the products stay. The singular values, which readers do without, end at 65504.
    """
    peak = np.abs(factors.right).max(axis=0)
    other = np.abs(factors.left).max(axis=0)
    moved = ((peak > LARGEST_HALF) | (peak < _SMALL)) & (peak > 0) & (other > 0)
    ratio = np.where(moved, peak, 1) / np.where(moved, other, 1)
    powers = np.round(np.log2(ratio) / 2).astype(np.int64)
    left, right = np.ldexp(factors.left, powers), np.ldexp(factors.right, -powers)
    if max(np.abs(left).max(), np.abs(right).max()) > LARGEST_HALF:
        raise InvalidParameter(
            f"{name}: factors up to {peak.max():g} do not fit half floats, scalar must be"
            " 'float' or 'double'"
        )
    return left, right, np.minimum(factors.singular, LARGEST_HALF)
