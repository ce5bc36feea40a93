"""The planar work that peers share: samples of 128 x 128 pixels, and a flat grid to cover."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from btfcore.types import F4, DenseMesh, Field, Sample
from tests.bench.inputs import find

SIDE = 128
U1 = NDArray[np.uint8]
NAMES = ("brick", "gravel")


def pictures() -> tuple[dict[str, Image.Image], str]:
    """Return the grey samples by name, and where they come from.

    The top-left 256 pixels of scikit-image's CC0 pictures, halved, as in the figures that are
    quoted; where neither that package nor a copy of its pictures is here, pictures of ours, to
    which those figures do not apply.
    """
    found = {}
    for name in NAMES:
        grey = _scikit_image(name)
        if grey is None and (path := find(f"{name}_gray512.png")) is not None:
            grey = np.asarray(Image.open(path))
        if grey is not None:
            top = np.repeat(grey[: 2 * SIDE, : 2 * SIDE, None], 3, axis=2)
            found[name] = Image.fromarray(top).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    if len(found) == len(NAMES):
        return found, "scikit-image's brick and gravel"
    ours = {"brick": "brick_grey.png", "gravel": "gravel.png"}
    for name, file in ours.items():
        path = find(file)
        if path is not None:
            whole = Image.open(path).convert("RGB")
            found[name] = whole.resize((SIDE, SIDE), Image.Resampling.LANCZOS)
    return found, "pictures of resources/textures, to which the quoted figures do not apply"


def _scikit_image(name: str) -> U1 | None:
    try:
        data = importlib.import_module("skimage.data")
    except ImportError:
        return None
    return np.asarray(getattr(data, name)())


def load(path: Path) -> F4:
    """Read a picture as (H, W, 3) f4, 0…1."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB"), np.float32) / np.float32(255)


def save(path: Path, colour: F4) -> None:
    """Write (H, W, 3), 0…1, as 8 bits a channel."""
    Image.fromarray(np.round(255 * np.clip(colour, 0, 1)).astype(np.uint8)).save(path)


def sample_of(name: str, colour: F4) -> Sample:
    """Sample whose distances are those of its colours."""
    return Sample(name, colour, colour.copy())


def flat_grid(side: int) -> tuple[DenseMesh, Field]:
    """Plane of side² vertices in one chart, the field along the rows."""
    row, column = np.indices((side, side))
    vertices = np.stack([column, -row, 0 * row], axis=-1).reshape(-1, 3).astype(np.float64)
    count = side * side
    a = (row[:-1, :-1] * side + column[:-1, :-1]).ravel()
    b, c, d = a + 1, a + side, a + side + 1
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    normals = np.zeros((count, 3), np.float32)
    normals[:, 2] = 1
    tangents = np.zeros((count, 3), np.float32)
    tangents[:, 0] = 1
    dense = DenseMesh(
        vertices=vertices,
        normals=normals,
        faces=faces.astype(np.int32),
        texel=np.stack([row, column], axis=-1).reshape(-1, 2).astype(np.int32),
        chart=np.zeros(count, np.int32),
        face=np.zeros(count, np.int32),
        bary=np.zeros((count, 3), np.float32),
        size=side,
        grid_faces=len(faces),
    )
    return dense, Field(tangents, np.zeros((0, 3)))
