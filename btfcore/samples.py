"""The verbs for samples that command line, window and notebooks share."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from btfcore.btf.appearance import quilting_sample
from btfcore.btf.colour import srgb_to_linear
from btfcore.btf.directions import to_angles
from btfcore.btf.feature import check_mask, flat_fielded, prepared
from btfcore.btf.image import read_mask
from btfcore.btf.sample import BtfSample, Encoding, from_picture
from btfcore.btf.stack import ArrayStack
from btfcore.btf.weights import Weights
from btfcore.errors import InvalidBtf
from btfcore.files.samples import DEFAULT_LAYOUT, open_sample, read_pbr_sized
from btfcore.progress import Progress, between, silent
from btfcore.types import F4, F8, Sample


def description(sample: BtfSample) -> dict[str, Any]:
    """Everything worth knowing about a sample that can be told without its images; plain JSON."""
    height, width = sample.shape
    out: dict[str, Any] = {
        "name": sample.name,
        "width": width,
        "height": height,
        "views": len(sample.views),
        "lights": len(sample.lights),
        "images": sample.images,
        "missing": sample.missing,
        "view_rings": _rings(sample.views),
        "light_rings": _rings(sample.lights),
        "raw_megabytes": round(sample.images * height * width * 6 / 1e6, 3),
        "feature_share": None if sample.mask is None else round(float(sample.mask.mean()), 4),
        "tiles": sample.tiles,
        "texel_size_mm": sample.texel_size,
        "cosine_included": sample.cosine,
        "factors": None,
        "licence": sample.licence,
        "citation": sample.citation,
        "origin": sample.origin,
        "notes": list(sample.notes),
    }
    if sample.factors is not None:
        factors = sample.factors
        out["factors"] = factors.rank
        out["encoding"] = factors.encoding.name
        out["knee"] = factors.encoding.knee
        out["coded_error"] = round(factors.error, 6) if np.isfinite(factors.error) else None
    return out


def _rings(directions: F8) -> str:
    """Polar angles in degrees and how many directions each has: "0x1 15x6 30x12"."""
    theta = np.round(np.degrees(to_angles(directions)[0]), 1)
    values, counts = np.unique(theta, return_counts=True)
    if len(values) > 24:
        return f"{len(values)} polar angles from {values[0]:g} to {values[-1]:g} degrees"
    pairs = zip(values, counts, strict=True)
    return " ".join(f"{value:g}x{count}" for value, count in pairs)


def bake_files(
    path: str | Path,
    views: F8,
    lights: F8,
    *,
    size: int | None = None,
    depth: float | None = None,
    shadows: bool = True,
    parallax: bool = True,
    bounce: bool = False,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> BtfSample:
    """Read a PBR set and bake it; see `btfcore.btf.bake.build.bake` for the knobs."""
    from btfcore.btf.bake.build import bake

    return bake(
        read_pbr_sized(path, size), views, lights, depth="auto" if depth is None else depth,
        shadows=shadows, parallax=parallax, bounce=bounce, memory_mb=memory_mb,
        progress=between(progress, 0.0, 0.5),
    )  # fmt: skip


def with_factors(
    sample: BtfSample,
    *,
    rank: int | str = 40,
    rmse: float = 0.02,
    encoding: str = "auto",
    knee: float | str | None = "auto",
    memory_mb: float = 2048,
    seed: int = 0,
    progress: Progress = silent,
) -> BtfSample:
    """Return the sample with its factorisation, and notes about what was mended in its values.

    memory_mb : of all that is held, images that are in memory already included. Raises
    `InvalidParameter` for knobs out of range, `InvalidBtf` for an ordinary picture.
    """
    from btfcore.btf.factor.svd import factorize
    from btfcore.btf.materialize import flaws, held_mb

    if sample.is_image:
        raise InvalidBtf(f"{sample.name}: one image has nothing to factorise")
    factors = factorize(
        sample, rank=rank, rmse=rmse, encoding=encoding, knee=knee,
        memory_mb=memory_mb - held_mb(sample.stack), seed=seed, progress=progress,
    )  # fmt: skip
    notes, found = (*sample.notes, *factors.notes), flaws(sample.stack)
    if found.total:
        notes += (
            f"took {found.nan} NaN and {found.negative} negative values as 0, and"
            f" {found.infinite} infinite ones as 65504",
        )
    return replace(sample, factors=factors, notes=notes)


def error_figures(
    sample: BtfSample,
    reference: BtfSample | None = None,
    *,
    rank: int | str = 40,
    rmse: float = 0.02,
    encoding: str = "auto",
    held_out: bool = False,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Errors of a sample's factors against a reference's images; plain JSON.

    Without a reference the sample's own images are factorised and compared. Raises
    `InvalidBtf` where the two have other sizes or directions, or where a factorised package
    is given without the images that it was made from.
    """
    from btfcore.btf.factor.errors import factor_errors, held_out_errors
    from btfcore.btf.materialize import held_mb, materialize

    if reference is None:
        if sample.factors is not None:
            raise InvalidBtf(
                f"{sample.name}: a factorised package no longer has its images; name the sample"
                " that it was made from with --against"
            )
        # its images are read several times over
        reference = sample = materialize(
            sample, memory_mb=memory_mb / 2, progress=between(progress, 0.0, 0.3)
        )
    else:
        _check_alike(sample, reference)
    if sample.factors is None:
        sample = with_factors(
            sample, rank=rank, rmse=rmse, encoding=encoding, memory_mb=memory_mb,
            progress=between(progress, 0.3, 0.6),
        )  # fmt: skip
    factors = sample.factors
    assert factors is not None
    out: dict[str, Any] = {"rank": factors.rank, "encoding": _code(factors.encoding)}
    found = factor_errors(reference, factors, progress=between(progress, 0.6, 0.8))
    out |= _plain(asdict(found))
    if held_out:
        left = held_out_errors(
            reference, rank=factors.rank, encoding=factors.encoding,
            memory_mb=memory_mb - held_mb(reference.stack),
            progress=between(progress, 0.8, 1.0),
        )  # fmt: skip
        out |= {f"held_out_{key}": value for key, value in _plain(asdict(left)).items()}
    return out


def _code(encoding: Encoding) -> str:
    return encoding.name if encoding.knee is None else f"{encoding.name}, knee {encoding.knee:g}"


def _plain(figures: dict[str, Any]) -> dict[str, Any]:
    """JSON values of figures: rounded floats, None for what is not finite."""
    out: dict[str, Any] = {}
    for key, value in figures.items():
        if isinstance(value, (float, np.floating)):
            out[key] = round(float(value), 6) if np.isfinite(value) else None
        elif isinstance(value, (tuple, list, np.ndarray)):
            out[key] = [part.item() if hasattr(part, "item") else part for part in value]
        else:
            out[key] = value.item() if hasattr(value, "item") else value
    return out


def _check_alike(sample: BtfSample, reference: BtfSample) -> None:
    pairs = (
        ("images", sample.images, reference.images),
        ("texels", sample.shape, reference.shape),
        ("views", len(sample.views), len(reference.views)),
        ("lights", len(sample.lights), len(reference.lights)),
    )
    for what, one, two in pairs:
        if one != two:
            raise InvalidBtf(f"{sample.name} has {one} {what}, {reference.name} has {two}")
    for what, a, b in (
        ("view", sample.views, reference.views),
        ("light", sample.lights, reference.lights),
    ):
        apart = float(np.abs(a - b).max())
        if apart > 1e-3:
            raise InvalidBtf(
                f"{sample.name} and {reference.name} have other {what} directions: they differ"
                f" by up to {apart:.3f}"
            )
    if not np.array_equal(sample.index, reference.index):
        raise InvalidBtf(f"{sample.name} and {reference.name} lack other images")


def load_quilting_sample(
    path: str | Path,
    *,
    view_weights: Weights = None,
    light_weights: Weights = None,
    progress: Progress = silent,
) -> tuple[Sample, tuple[str, ...]]:
    """Open a sample of any kind for quilting, and the notes that reading it left.

    See `btfcore.btf.appearance.quilting_sample` for the weights.
    """
    sample = open_sample(path)
    ready = quilting_sample(
        sample, view_weights=view_weights, light_weights=light_weights, progress=progress
    )
    return ready, sample.notes


@dataclass(frozen=True, eq=False)
class LoadedMaterial:
    """A sample read once for both ends: `picture` to quilt with, `btf` to be lit.

    btf : comes with its factors unless it is an ordinary picture. notes: sentences for a user
    about what was changed in reading.
    """

    picture: Sample
    btf: BtfSample
    notes: tuple[str, ...] = ()


def load_material(
    path: str | Path,
    *,
    rank: int = 40,
    view_weights: Weights = None,
    light_weights: Weights = None,
    memory_mb: float = 2048,
    progress: Progress = silent,
) -> LoadedMaterial:
    """Open a sample of any kind for quilting and for rendering, read and factorised once.

    An image file is read as a texture always is, and rendered as Lambertian. Raises
    `InvalidImage`, `InvalidBtf`, `InvalidParameter` or `GuardedFailure`.
    """
    from btfcore.btf.image import SUFFIXES, read_image_notes

    path = Path(path)
    if path.suffix.lower() in SUFFIXES or not path.exists():
        picture, notes = read_image_notes(path, progress=progress)
        btf = from_picture(
            picture.name, srgb_to_linear(picture.colour), tiles=picture.tiles, mask=picture.mask
        )
        return LoadedMaterial(picture, btf, notes)
    btf = open_sample(path, progress=between(progress, 0.0, 0.2))
    if btf.factors is None and not btf.is_image:
        from btfcore.btf.factor.svd import factorize

        factors = factorize(
            btf, rank=rank, memory_mb=memory_mb, progress=between(progress, 0.2, 0.9)
        )
        btf = replace(btf, factors=factors)
    picture = quilting_sample(
        btf, view_weights=view_weights, light_weights=light_weights, memory_mb=memory_mb,
        progress=between(progress, 0.9, 1.0),
    )  # fmt: skip
    return LoadedMaterial(picture, btf, btf.notes)


def load_paint_sample(
    path: str | Path,
    mask: str | Path | F4 | None = None,
    *,
    flat: bool = False,
    layout: str | Path = DEFAULT_LAYOUT,
    size: int | None = None,
    progress: Progress = silent,
) -> tuple[BtfSample, tuple[str, ...]]:
    """Open a sample of any kind for painting, its feature's mask prepared, and notes.

    mask : an image file (grey, colours or with alpha; above ½ is feature) of the sample's size,
    or the mask itself, (H, W) f4; None takes the one that the sample came with, if any. It is
    made ready as `btfcore.btf.feature.prepared` says. flat : take slow gradients of the lighting
    out of an ordinary picture (`flat_fielded`). layout, size : see
    `btfcore.files.samples.open_sample`.

    Raises as `open_sample` does, and `InvalidImage` for a mask that cannot be read, has another
    size than the sample (both are named), or is empty or full (with its share).
    """
    sample = open_sample(path, layout=layout, size=size, progress=between(progress, 0.0, 0.8))
    notes = list(sample.notes)
    drawn, name = sample.mask, sample.name
    if isinstance(mask, np.ndarray):
        drawn = mask
    elif mask is not None:
        name = Path(mask).name
        drawn = read_mask(mask, progress=between(progress, 0.8, 1.0))
    if drawn is not None:
        check_mask(name, drawn, sample.shape)
        feature = prepared(drawn, name=name)
        notes += feature.notes
        sample = replace(sample, mask=feature.mask)
    if flat and sample.is_image:
        even = flat_fielded(sample.image(0, 0), sample.mask)
        sample = replace(sample, stack=ArrayStack(even[None], sound=True), factors=None)
    elif flat:
        notes.append("lighting is evened out in ordinary pictures only")
    sample = replace(sample, notes=tuple(notes))
    return sample, sample.notes
