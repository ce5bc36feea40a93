"""A quilt carried to another dense mesh of the same surface: the same picture, finer or coarser.

Every vertex of the new mesh lies on a triangle of the old one. Within a patch positions in the
sample are interpolated; across a seam each patch is continued by its ghosts, so that nothing is
ever interpolated between patches. The seam runs through the middles of the old edges, or where
`recut_seams` puts it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter, InvalidQuilt
from btfcore.patch.connectivity import Connectivity
from btfcore.progress import Progress, between, blocks, silent
from btfcore.quilt.sheet import Sheet
from btfcore.quilt.state import QuiltState
from btfcore.quilt.transfer_locate import locate, surface
from btfcore.quilt.transfer_place import Carried, Target, candidates, choose, headings, place
from btfcore.quilt.transfer_seams import recut_seams
from btfcore.types import DenseMesh, Field, Quilt

_LABEL = "carrying the quilt over"
_MANY = 1 << 18  # vertices between two calls of progress


def transfer(
    old: DenseMesh,
    old_field: Field,
    net: Connectivity,
    quilt: Quilt | QuiltState,
    sheet: Sheet,
    new: DenseMesh,
    new_field: Field,
    *,
    seams: Sheet | None = None,
    allowed: NDArray[np.bool_] | None = None,
    progress: Progress = silent,
) -> Quilt:
    """Quilt of the dense mesh `new` that shows what `quilt` shows on `old`.

    Both dense meshes sample one input mesh, at any two rates. net and sheet: connectivity of
    `old` and the samples at its scale, as the quilt was made with; a stored `Quilt` has its
    ghosts extrapolated (see `QuiltState.from_quilt`, whose errors it raises). seams: the
    same samples at the new scale; where given, each seam is cut again within the old triangles
    that it crosses. allowed (R, N) bool: which sample each new vertex may have; where no patch
    nearby has one of these, the nearest counts all the same.

    Patch and sample ids stay; a patch thinner than the new mesh's step may vanish. Angles are
    told from the new field's tangents. Where the new mesh is the old one, source, sample and
    patch are the same bits. Raises `InvalidQuilt` where quilt or net do not belong to `old`,
    `InvalidParameter` where a field, `seams` or `allowed` have other counts.
    """
    _check(old, old_field, net, quilt, sheet, new, new_field, seams, allowed)
    count, width = len(new.vertices), len(sheet.grids)
    progress(0.0, _LABEL)
    given = _prepared(old, old_field, net, quilt, sheet)
    face, weight = locate(given.on, new, progress=between(progress, 0.05, 0.5))
    if allowed is None:
        allowed = np.ones((width, 0), bool)
    mine = Target(new.vertices, new.normals, new_field.tangents, face, weight, allowed)
    source, angle = np.zeros((count, 2), np.float32), np.zeros(count, np.float32)
    sample, patch = np.zeros(count, np.uint16), np.full(count, -1, np.int32)
    mixed = np.zeros(count, np.bool_)
    for begin, end in blocks(count, _MANY, progress, _LABEL, 0.5, 0.75):
        choose(begin, end, given, mine, patch, mixed)
        part = np.arange(begin, end, dtype=np.int32)
        place(part, given, mine, patch, source, angle, sample)
    if seams is not None and mixed.any():
        band = np.flatnonzero(mixed).astype(np.int32)
        found = candidates(band, given, mine)
        label = recut_seams(
            new.faces, band, found, patch, seams, progress=between(progress, 0.75, 1.0)
        )
        turned = band[label != patch[band]]
        patch[band] = label
        place(turned, given, mine, patch, source, angle, sample)
    progress(1.0, _LABEL)
    return Quilt(source, angle, sample, patch)


def _check(
    old: DenseMesh, old_field: Field, net: Connectivity, quilt: Quilt | QuiltState, sheet: Sheet,
    new: DenseMesh, new_field: Field, seams: Sheet | None, allowed: NDArray[np.bool_] | None,
) -> None:  # fmt: skip
    """Check that all counts fit."""
    count, width = len(new.vertices), len(sheet.grids)
    for dense, field in ((old, old_field), (new, new_field)):
        if len(field.tangents) != len(dense.vertices):
            raise InvalidParameter(
                f"a field of {len(field.tangents)} tangents, the mesh has"
                f" {len(dense.vertices)} vertices"
            )
    if seams is not None and len(seams.grids) != width:
        raise InvalidParameter(f"{len(seams.grids)} samples at the new scale, {width} at the old")
    if allowed is not None and allowed.shape != (width, count):
        raise InvalidParameter(
            f"allowed has shape {allowed.shape}, there are {width} samples and {count} vertices"
        )
    for what, found in (("a quilt", len(quilt.patch)), ("a net", len(net.indptr) - 1)):
        if found != len(old.vertices):
            raise InvalidQuilt(f"{what} of {found} vertices, the mesh has {len(old.vertices)}")
    most = int(quilt.sample[quilt.patch >= 0].max(initial=0))
    if most >= width:
        raise InvalidQuilt(f"the quilt names sample {most}, only {width} given")


def _prepared(
    old: DenseMesh, field: Field, net: Connectivity, quilt: Quilt | QuiltState, sheet: Sheet
) -> Carried:
    """Bring everything into sample texels and world directions."""
    if isinstance(quilt, Quilt):
        state, plain = QuiltState.from_quilt(net, sheet, quilt), quilt
    else:
        state, plain = quilt, quilt.quilt(sheet)
    ghost = state.ghost
    if any(grid.shrink != 1.0 for grid in sheet.grids):
        owner, ghost = np.repeat(plain.sample, np.diff(net.indptr)), ghost.copy()
        for index, grid in enumerate(sheet.grids):
            ghost[owner == index] = grid.to_sample(ghost[owner == index])
    heading = headings(old.normals, field.tangents, plain.angle)
    on = surface(old)
    rate = np.array([1.0 / (each.unit * each.shrink * on.step) for each in sheet.grids])
    limit = np.zeros((len(rate), 4))
    for index, grid in enumerate(sheet.grids):
        height, width = grid.cut.shape[:2]
        ends = grid.to_sample(np.array([[0, 0], [width - 1, height - 1]], np.float64))
        limit[index] = ends.T.ravel()
    return Carried(
        on, old.normals, plain.source, plain.patch, plain.sample, heading, net.indptr, net.indices,
        ghost, rate, limit,
    )  # fmt: skip
