"""Writes a sample as one package file that appears whole or not at all."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.mapped import release
from btfcore.btf.materialize import blocks, halved
from btfcore.btf.sample import BtfFactors, BtfSample, full_index
from btfcore.btf.stack import LARGEST_HALF
from btfcore.errors import InvalidParameter
from btfcore.files.atomic import atomic_output
from btfcore.files.package.container import add_member
from btfcore.files.package.manifest import FORMAT, VERSION, EncodingEntry, Manifest, to_json
from btfcore.files.package.tensors import chunks, header, kinds
from btfcore.files.png import encode_png
from btfcore.progress import Progress, silent

SUFFIX = ".btfz"


@dataclass(frozen=True)
class _Tensors:
    """One safetensors member: header, size and the bytes that follow."""

    head: bytes
    size: int
    pieces: Iterator[bytes]


def write_package(
    path: str | Path,
    sample: BtfSample,
    *,
    contents: str = "auto",
    full_floats: bool = False,
    preview: NDArray[np.uint8] | None = None,
    progress: Progress = silent,
) -> Path:
    """Write `sample` as a package (.btfz) and return its path.

    contents : "factors", "images", or "auto": the factors where the sample has some. Images
    are streamed, so that a sample larger than memory can be written. Half floats are used
    unless `full_floats`; images are scaled one by one and factors kept as f4 where half would
    overflow. preview : (h, w, 3) u8 sRGB picture, or None. The same sample gives the same
    bytes. Raises `InvalidParameter` for other contents, another suffix or factors that are
    not there, `OutputFailed` where the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise InvalidParameter(f"{path.name}: a sample package ends in {SUFFIX}")
    if contents == "auto":
        contents = "images" if sample.factors is None else "factors"
    if contents not in ("factors", "images"):
        raise InvalidParameter(f"contents {contents!r}; there are 'factors' and 'images'")
    if contents == "factors":
        if sample.factors is None:
            raise InvalidParameter(f"{sample.name}: it has no factors to write")
        body = _factor_tensors(sample, sample.factors, full_floats)
    else:
        body = _image_tensors(sample, full_floats, progress)
    manifest = to_json(manifest_of(sample, sample.factors if contents == "factors" else None))
    with atomic_output(path) as handle, zipfile.ZipFile(handle, "w") as archive:
        add_member(archive, handle, "manifest.json", len(manifest), [manifest])
        if preview is not None:
            png = encode_png(preview)
            add_member(archive, handle, "preview.png", len(png), [png])
        size = len(body.head) + body.size
        add_member(archive, handle, f"{contents}.safetensors", size, _joined(body))
    progress(1.0, "writing package")
    return path


def _joined(body: _Tensors) -> Iterator[bytes]:
    yield body.head
    yield from body.pieces


def manifest_of(sample: BtfSample, factors: BtfFactors | None) -> Manifest:
    """Everything about a sample but its tensors; factors: those that are stored, if any."""
    height, width = sample.shape
    encoding = None
    error = None
    if factors is not None:
        code = factors.encoding
        encoding = EncodingEntry(name=code.name, epsilon=code.epsilon, knee=code.knee)  # type: ignore[arg-type]
        error = float(factors.error) if np.isfinite(factors.error) else None
    return Manifest(
        format=FORMAT,  # type: ignore[arg-type]
        version=VERSION,
        name=sample.name[:4096],
        width=width,
        height=height,
        images=sample.images,
        views=sample.views.tolist(),
        lights=sample.lights.tolist(),
        tiles=sample.tiles,
        texel_size_mm=sample.texel_size,
        cosine=sample.cosine,
        licence=sample.licence[:4096],
        citation=sample.citation[:4096],
        origin=sample.origin[:4096],
        notes=[note[:4096] for note in sample.notes[:1000]],
        encoding=encoding,
        error=error,
    )


def _extras(sample: BtfSample) -> dict[str, NDArray[Any]]:
    """Small tensors that both kinds may have: the mask, and the index of an incomplete set."""
    extras: dict[str, NDArray[Any]] = {}
    if sample.mask is not None:
        extras["mask"] = np.round(sample.mask * 65535).astype(np.uint16)
    if not np.array_equal(sample.index, full_index(*sample.index.shape)):
        extras["index"] = sample.index.astype(np.int32)
    return extras


def _factor_tensors(sample: BtfSample, factors: BtfFactors, full: bool) -> _Tensors:
    arrays: dict[str, NDArray[Any]] = {
        "singular": factors.singular.astype(np.float64),
        "mean": factors.mean.astype(np.float32),
        "weights": _short(factors.weights, full),
        # colours before factors, so that one image's row is read in one piece
        "basis": _short(factors.basis, full),
        **_extras(sample),
    }
    size = sum(array.nbytes for array in arrays.values())
    return _Tensors(header(kinds(arrays)), size, iter(chunks(arrays.values())))


def _short(values: NDArray[Any], full: bool) -> NDArray[Any]:
    fits = not full and float(np.abs(values).max(initial=0)) <= LARGEST_HALF
    return values.astype(np.float16 if fits else np.float32)


def _image_tensors(sample: BtfSample, full: bool, progress: Progress) -> _Tensors:
    extras = _extras(sample)
    count = sample.images
    dtype = np.dtype(np.float32 if full else np.float16)
    scale = np.ones(count, np.float32)
    shapes: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]
    shapes = {"images": (dtype, (*sample.stack.shape, 3))}  # first, so that it lies aligned
    if not full:
        shapes["scale"] = (scale.dtype, scale.shape)
    shapes |= kinds(extras)
    size = sum(int(np.prod(shape)) * kind.itemsize for kind, shape in shapes.values())

    def pieces() -> Iterator[bytes]:
        for numbers in blocks(sample.stack):
            block = sample.stack.read(numbers)
            if not full:
                scale[numbers], block = halved(block)
            yield from chunks([block.astype(dtype)])
            release(sample.stack)
            progress(float(numbers[-1] + 1) / count, "writing images")
        if not full:
            yield from chunks([scale])
        yield from chunks(extras.values())

    return _Tensors(header(shapes), size, pieces())
