"""A small decorated mesh for tests, its quilt laid out by hand: patches in bands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from btfcore.pipeline import load_mesh, prepare
from btfcore.render.gutter import gutter_source
from btfcore.render.surfels import Placement, Surfels, placement, surfels
from btfcore.types import I4, Prepared, Quilt

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Scene:
    """A mesh with its quilt, ready to be shaded."""

    prepared: Prepared
    quilt: Quilt
    surfels: Surfels
    place: Placement
    gutter: I4


@lru_cache
def scene(name: str = "spot.obj", rate: int = 96) -> Scene:
    """Prepare a shipped mesh; its quilt has four patches, turned against each other."""
    mesh, _ = load_mesh(ROOT / "resources" / "meshes" / name)
    prepared = prepare(mesh, rate=rate)
    dense = prepared.dense
    height = dense.vertices[:, 1]
    patch = np.searchsorted(np.quantile(height, [0.25, 0.5, 0.75]), height).astype(np.int32)
    source = (dense.texel[:, ::-1] * 0.37).astype(np.float32)
    angle = (0.4 * patch).astype(np.float32)
    quilt = Quilt(source, angle, np.zeros(len(patch), np.uint16), patch)
    place = placement(mesh.vertices)
    return Scene(
        prepared, quilt, surfels(dense, prepared.field, quilt, place), place, gutter_source(dense)
    )
