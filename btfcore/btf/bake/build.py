"""Makes a BTF from a PBR texture set: a relief seen and lit from everywhere (design §8).

Geometry. The height map is a relief, bilinear between texel centres. A texel of an image is
the line of sight through it on the reference plane, so views are rectified as measured BTFs
are: what lies on the plane stays where it is, what stands out leans away from the viewer. Lines
of sight and the horizon towards each light are exact (see `trace`, `horizon`); shadows are
hard. A set that tiles repeats for ever, another is continued by its mirror images.

Shading. The normal map's normals, or the relief's by central differences; see `shade`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from btfcore.btf.bake.relief import Plane, relief
from btfcore.btf.bake.stack import BakedStack
from btfcore.btf.materialize import materialize
from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample, full_index
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, between, silent
from btfcore.types import F8


def baked(
    pbr: PbrSet,
    views: ArrayLike,
    lights: ArrayLike,
    *,
    depth: Literal["auto"] | float = "auto",
    shadows: bool = True,
    parallax: bool = True,
    bounce: bool = False,
    plane: Plane = "mean",
    integrate: bool = False,
    roughness: float = 0.7,
    reflectance: float = 0.04,
    threads: int | None = None,
) -> BtfSample:
    """Return a PBR set as a BTF whose images are rendered whenever they are read.

    views (V, 3), lights (L, 3): unit vectors. Radiance includes the light's cosine and is
    that under a light of irradiance π: a white Lambertian texel facing the light has 1.

    depth : height of the map's value 1 above 0 in texels; "auto" takes the set's own, else the
    one that fits the normal map best, else 1/50 of the longer edge, and the notes say which.
    shadows : cast shadows. parallax : trace lines of sight; without, all views see the same
    points. bounce : add light scattered once by the relief itself (diffuse, see `bounce`).
    plane : height at which views are registered, the relief's "mean", which moves texels the
    least, or its "top". integrate : where there are normals but no height map, make one from
    them. roughness : for sets without such a map. reflectance : of dielectrics at normal
    incidence; 0 makes them purely Lambertian. threads : at most; None for one per core.

    The occlusion map is used only where there is no relief to trace, and then darkens all
    light. Steps of 8-bit heights are taken out (`depth.dequantized`). Height and normals are used
    as they are; where they contradict each other a note says so. Cosines of grazing views and
    lights are floored at 0.05 when tracing.

    Raises `InvalidParameter` for knobs out of range (see `relief.relief`), and `InvalidBtf` for
    directions that are not unit vectors above the horizon, or are repeated.
    """
    if threads is not None and threads < 1:
        raise InvalidParameter(f"{pbr.name}: {threads} threads, where at least 1 is needed")
    seen, lit = _directions(pbr.name, "views", views), _directions(pbr.name, "lights", lights)
    field = relief(
        pbr,
        depth=depth,
        plane=plane,
        integrate=integrate,
        roughness=roughness,
        reflectance=reflectance,
    )
    stack = BakedStack(
        field, seen, lit, shadows=shadows, parallax=parallax, bounce=bounce, threads=threads
    )
    return BtfSample(
        pbr.name,
        stack,
        seen,
        lit,
        full_index(len(seen), len(lit)),
        mask=pbr.mask,
        tiles=pbr.tiles,
        texel_size=pbr.texel_size,
        licence=pbr.licence,
        citation=pbr.citation,
        origin=pbr.origin,
        notes=(*pbr.notes, *field.notes),
    )


def bake(
    pbr: PbrSet,
    views: ArrayLike,
    lights: ArrayLike,
    *,
    depth: Literal["auto"] | float = "auto",
    shadows: bool = True,
    parallax: bool = True,
    bounce: bool = False,
    plane: Plane = "mean",
    integrate: bool = False,
    roughness: float = 0.7,
    reflectance: float = 0.04,
    threads: int | None = None,
    memory_mb: float = 1024,
    progress: Progress = silent,
) -> BtfSample:
    """Return a PBR set as a BTF with all images rendered: `baked`, kept by `materialize`.

    memory_mb : above which the images are half floats, and twice that a mapped temporary file.
    The other knobs, and the errors, are those of `baked`. The bits do not depend on `threads`.
    """
    sample = baked(
        pbr,
        views,
        lights,
        depth=depth,
        shadows=shadows,
        parallax=parallax,
        bounce=bounce,
        plane=plane,
        integrate=integrate,
        roughness=roughness,
        reflectance=reflectance,
        threads=threads,
    )
    first = 0.0
    if bounce and isinstance(sample.stack, BakedStack):
        first = 0.3
        sample.stack.prepare(progress=between(progress, 0, first))
    return materialize(sample, memory_mb=memory_mb, progress=between(progress, first, 1))


def _directions(name: str, kind: str, directions: ArrayLike) -> F8:
    out = np.array(directions, np.float64)
    if out.ndim != 2 or out.shape[1] != 3 or not np.isfinite(out).all():
        raise InvalidParameter(f"{name}: {kind} of shape {out.shape}, not finite (n, 3)")
    return out
