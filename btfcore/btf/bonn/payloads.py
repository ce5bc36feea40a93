"""What follows the layout in DFMF, FMF and PVF files: matrices, viewed where they lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.bonn.cursor import Cursor
from btfcore.btf.bonn.factors import Plane
from btfcore.btf.bonn.header import Layout
from btfcore.btf.bonn.models import GREY_MODELS, NAMES, PCA, SPECTRAL, ColourModel

MOST_COMPONENTS = 1 << 16
_SCALARS = {2: "<f2", 4: "<f4", 8: "<f8"}


@dataclass(frozen=True)
class Payload:
    """Planes per slot, how their values are coded, and what else was found."""

    slots: tuple[tuple[Plane, ...], ...]
    model: ColourModel
    notes: tuple[str, ...] = ()


def read_dfmf(cursor: Cursor, layout: Layout, components: int | None) -> Payload:
    """One factorisation for each channel of a colour model (`models.NAMES`).

    components : take only so many of each channel's components, the largest.
    """
    most = cursor.u32("largest number of components")
    model = _read_model(cursor, layout)
    planes: list[Plane] = []
    counts: list[int] = []
    kinds: list[str] = []
    for channel in range(layout.description.channels):
        where = f" of channel {channel}"
        at, kind = cursor.position, _scalar(cursor, where)
        kinds.append(kind)
        if kind != kinds[0]:
            raise cursor.wrong(
                f"size of a number{where} at byte {at:,} is {kind[-1]}, but channel 0 has"
                f" {kinds[0][-1]}"
            )
        count = cursor.count(f"number of components{where}", MOST_COMPONENTS)
        left, right = _pair(cursor, where, kind, count)
        counts.append(count)
        shapes = (len(left), len(right))
        if shapes == (layout.images, layout.texels):
            images, texels = left, right
        elif shapes == (layout.texels, layout.images):
            images, texels = right, left
        else:
            raise _misfit(cursor, where, shapes, layout.images, layout.texels)
        planes.append(Plane(images[:, :components], texels[:, :components]))
    cursor.finish()
    notes = [f"colour model {model.number} ({NAMES[model.number]})"]
    if max(counts) > most:
        notes.append(f"{max(counts)} components, where the file announces at most {most}")
    notes.append(_taken(counts, components))
    return Payload((tuple(planes),), model, tuple(notes))


def read_fmf(cursor: Cursor, layout: Layout, components: int | None, *, extended: bool) -> Payload:
    """One factorisation of all channels; `extended` files (FMF12) may hold logarithms."""
    reduced, notes = _read_extension(cursor) if extended else (False, [])
    at = cursor.position
    announced = cursor.count("number of components", MOST_COMPONENTS)
    kind = _scalar(cursor, "")
    count = cursor.count("repeated number of components", MOST_COMPONENTS)
    if count != announced:
        raise cursor.wrong(
            f"number of components at byte {at:,} is {announced:,}, but repeated as {count:,}"
        )
    left, right = _pair(cursor, "", kind, count)
    cursor.finish()
    channels, images, texels = layout.description.channels, layout.images, layout.texels
    shapes = (len(left), len(right))
    left, right = left[:, :components], right[:, :components]
    if shapes == (channels * images, texels):
        planes = [Plane(left[channel::channels], right) for channel in range(channels)]
    elif shapes == (channels * texels, images):
        planes = [Plane(right, left[channel::channels]) for channel in range(channels)]
    else:
        raise _misfit(cursor, "", shapes, images, texels, channels)
    notes.append(_taken([count], components))
    return Payload((tuple(planes),), ColourModel(reduced=reduced), tuple(notes))


def read_pvf(
    cursor: Cursor, layout: Layout, components: int | None, *, announced: int, slots: int
) -> Payload:
    """One principal component analysis for each view, with its mean."""
    if slots != len(layout.views):
        raise cursor.wrong(f"{slots:,} slots before byte {cursor.position:,}, but one for each of"
                           f" the {len(layout.views):,} views is needed")  # fmt: skip
    taken = tuple(_read_slot(cursor, layout, components, view) for view in range(slots))
    cursor.finish()
    counts = [slot[1] for slot in taken]
    notes = [_taken(counts, components)]
    if max(counts) > announced:
        notes.append(f"{max(counts)} components, where the file announces {announced}")
    return Payload(tuple(slot[0] for slot in taken), ColourModel(), tuple(notes))


def _read_slot(
    cursor: Cursor, layout: Layout, components: int | None, view: int
) -> tuple[tuple[Plane, ...], int]:
    where = f" of view {view}"
    kind = _scalar(cursor, where)
    count = cursor.count(f"number of components{where}", MOST_COMPONENTS)
    at = cursor.position
    weights = cursor.u32(f"number of weights{where}")
    dimension = cursor.u32(f"dimension{where}")
    cursor.array(f"eigenvalues{where}", (count,), kind)
    mean = cursor.array(f"mean{where}", (dimension,), kind)
    axes = cursor.array(f"components{where}", (dimension, count), kind)[:, :components]
    weight = cursor.array(f"weights{where}", (weights, count), kind)[:, :components]
    channels, lights, texels = layout.description.channels, len(layout.lights), layout.texels
    every = range(channels)
    if (dimension, weights) == (channels * lights, texels):
        planes = [Plane(axes[c::channels], weight, image_mean=mean[c::channels]) for c in every]
    elif (dimension, weights) == (channels * texels, lights):
        planes = [Plane(weight, axes[c::channels], texel_mean=mean[c::channels]) for c in every]
    else:
        raise cursor.wrong(
            f"weights and dimension{where} at byte {at:,} are {weights:,} and {dimension:,}, but"
            f" {channels} channels, {lights:,} lights and {texels:,} texels ask for {texels:,} and"
            f" {channels * lights:,}, or for {lights:,} and {channels * texels:,}"
        )
    return tuple(planes), count


def _read_model(cursor: Cursor, layout: Layout) -> ColourModel:
    at, number = cursor.position, cursor.i32("colour model")
    mean = cursor.floats("colour mean", 3)
    transform = cursor.floats("colour transform", 9).reshape(3, 3)
    if number not in NAMES:
        what = SPECTRAL.get(number, "unknown")
        raise cursor.wrong(
            f"colour model at byte {at:,} is {number} ({what}), but only"
            f" {', '.join(map(str, sorted(NAMES)))} can be read"
        )
    if layout.description.channels == 1 and number not in GREY_MODELS:
        raise cursor.wrong(
            f"colour model at byte {at:,} is {number} ({NAMES[number]}), but the sample is grey"
        )
    if number == PCA and not (np.isfinite(mean).all() and np.isfinite(transform).all()):
        raise cursor.wrong(f"colour mean or transform after byte {at:,} is not finite")
    return ColourModel(number, mean, transform)


def _read_extension(cursor: Cursor) -> tuple[bool, list[str]]:
    at, version = cursor.position, cursor.u8("version of the extension")
    if version > 2:
        raise cursor.wrong(
            f"version of the extension at byte {at:,} is {version}, but 0 to 2 are known"
        )
    reduction = 0
    notes = []
    if version >= 1:
        at, reduction = cursor.position, cursor.u32("dynamic range reduction")
        if reduction > 1:
            raise cursor.wrong(
                f"dynamic range reduction at byte {at:,} is {reduction:,}, but 0 and 1 are known"
            )
    if version >= 2:
        width = cursor.u32("width of the height map")
        height = cursor.u32("height of the height map")
        cursor.need("height map", width * height * 2)
        if width * height:
            notes.append(f"a height map of {width:,} x {height:,} texels in the file, not used")
    return reduction == 1, notes


def _scalar(cursor: Cursor, where: str) -> str:
    at, size = cursor.position, cursor.u8(f"size of a number{where}")
    if size not in _SCALARS:
        raise cursor.wrong(
            f"size of a number{where} at byte {at:,} is {size}, but 2, 4 or 8 bytes are needed"
        )
    return _SCALARS[size]


def _pair(cursor: Cursor, where: str, kind: str, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Left factors (rows, count) and right ones (columns, count), singular values in these."""
    rows = cursor.u32(f"rows{where}")
    columns = cursor.u32(f"columns{where}")
    cursor.array(f"singular values{where}", (count,), kind)
    left = cursor.array(f"left factors{where}", (rows, count), kind)
    return left, cursor.array(f"right factors{where}", (columns, count), kind)


def _misfit(
    cursor: Cursor, where: str, shapes: tuple[int, int], images: int, texels: int, channels: int = 1
) -> Exception:
    times = f"{channels} x " if channels > 1 else ""
    return cursor.wrong(
        f"rows and columns{where} before byte {cursor.position:,} are {shapes[0]:,} and"
        f" {shapes[1]:,}, but {times}{images:,} and {texels:,} are needed, or {times}{texels:,}"
        f" and {images:,}"
    )


def _taken(counts: list[int], components: int | None) -> str:
    low, high = min(counts), max(counts)
    words = f"{low}" if low == high else f"{low} to {high}"
    if components is None or components >= high:
        return f"{words} components"
    return f"the first {components} of {words} components"
