"""PBR texture sets as artists download them: ambientCG, Poly Haven, Unreal, Blender names."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from btfcore.btf.pbr import PbrSet
from btfcore.btf.readers.decode import IMAGES, MOST_PIXELS, decode_images
from btfcore.btf.readers.listing import FileSet, list_files
from btfcore.btf.readers.pbr_names import Named, grouped
from btfcore.btf.readers.pbr_relief import settled
from btfcore.btf.readers.reduce import area_reduced
from btfcore.errors import InvalidBtf, InvalidParameter, PatinaError
from btfcore.progress import Progress, silent
from btfcore.types import F4

SIDE = 512
_LARGEST = 1 << 28  # 16k maps
_ASPECT = 0.02  # by how much proportions may differ
_BORDER = 2.0
_SMALL = 16  # texels a side up to which a map counts as one value, whatever its proportions
_CHOICES = ("auto", "opengl", "directx")
_INSTEAD = (  # where both are there, the second is not needed
    ("normal_gl", "normal_dx"),
    ("normal_gl", "normal"),
    ("normal_dx", "normal"),
    ("height", "depth"),
    ("roughness", "gloss"),
)
_NORMALS = ("normal_gl", "normal_dx", "normal")
_USED = (
    "albedo", "normal_gl", "normal_dx", "normal", "height", "depth", "roughness", "gloss",
    "metallic", "ao", "arm", "mask",
)  # fmt: skip


def looks_like_pbr(path: str | Path) -> bool:
    """Whether a folder or zip holds a colour map and another map of the same PBR set."""
    try:
        return bool(grouped(list_files(path).ending(*IMAGES)))
    except PatinaError:
        return False


def read_pbr(
    path: str | Path,
    *,
    size: int | None = None,
    name: str | None = None,
    normals: str = "auto",
    progress: Progress = silent,
) -> PbrSet:
    """Read the PBR set of a folder or zip, found by its file names.

    Colours are linearised (floats taken as linear), all other maps are data; 16-bit depth is
    kept. Packed "arm"/"orm" maps are taken apart, gloss becomes roughness. All maps are averaged
    by area to one size with the colour map's proportions, normals made unit again.

    size : the longest side, at most that of the largest map; None is 512. name : which set,
    where there are several (part of its name will do). normals : "opengl", "directx" (green
    points down and is turned), or "auto": by the file's name, else by comparing with the height
    map's slopes, else by the map's own curl, else OpenGL (Unreal's names: DirectX). A height
    map whose slopes run against the normal map's is white in the pits and is inverted;
    without a normal map only those called "depth" are. Notes tell all such decisions.

    Raises `InvalidBtf` where no set or several are found (they are listed), maps differ in
    proportions or hold values that are not finite; `InvalidImage` or `GuardedFailure` where
    one cannot be decoded; `InvalidParameter` for a size below 1 or another `normals`.
    """
    if size is not None and size < 1:
        raise InvalidParameter(f"a size of {size} texels")
    if normals not in _CHOICES:
        raise InvalidParameter(f"normals {normals!r}: it is one of {', '.join(_CHOICES)}")
    files = list_files(path)
    roles = _chosen(files, name)
    notes = list(files.notes)
    maps = _decoded(files, roles, size or SIDE, notes, progress)
    parts = _parts(maps, notes)
    hint, sure = _green(roles, normals)
    file = next((maps[role] for role in _NORMALS if role in maps), None)
    normal = None if file is None else _vectors(file, notes)
    key = next((key for key in ("height", "depth") if key in maps), None)
    height = None if key is None else _heights(maps[key], notes)
    relief = settled(height, normal, green_down=hint, sure=sure, depth=key == "depth")
    colours = np.clip(_three(maps["albedo"]), 0, 1)
    return PbrSet(
        roles["albedo"].label or files.name,
        colours,
        height=relief.height,
        normal=relief.normal,
        roughness=parts.get("roughness"),
        metallic=parts.get("metallic"),
        ao=parts.get("ao"),
        mask=parts.get("mask"),
        tiles=_tiles(colours, notes),
        origin=", ".join(sorted(each.entry.base for each in roles.values())),
        notes=(*notes, *relief.notes),
    )


def _chosen(files: FileSet, name: str | None) -> dict[str, Named]:
    """Pick the set, and the best file of each of its roles."""
    sets = grouped(files.ending(*IMAGES))
    if not sets:
        raise InvalidBtf(
            f"{files.name}: no PBR set: a colour map (`…_Color`, `…_albedo`, `…_diff_1k`) and"
            " another map beside it are needed"
        )
    fitting = list(sets)
    if name is not None:
        wanted = name.casefold()
        fitting = [group for group in sets if group == wanted]
        fitting = fitting or [group for group in sets if wanted in (group or files.name.casefold())]
    if len(fitting) != 1:
        listed = ", ".join(repr(group) for group in list(sets)[:12])
        what = "several PBR sets" if name is None else f"{len(fitting)} PBR sets called {name!r}"
        raise InvalidBtf(f"{files.name}: {what}; choose by name among {listed}")
    found = sets[fitting[0]]
    roles = {role: found[role][0] for role in _USED if role in found}
    for better, worse in _INSTEAD:
        if better in roles:
            roles.pop(worse, None)
    if {"roughness", "metallic", "ao"} <= set(roles):
        roles.pop("arm", None)
    return roles


def _decoded(
    files: FileSet, roles: dict[str, Named], side: int, notes: list[str], progress: Progress
) -> dict[str, F4]:
    """Maps of one size, f4: integers as 0–1, colours linear."""
    entries = [each.entry for each in roles.values()]
    raws = decode_images(
        files,
        entries,
        most=_LARGEST,
        free=MOST_PIXELS,  # maps of one value pack well
        icc=False,
        reduce=[(side, role == "albedo") for role in roles],
        limit_mb=8192,
        progress=progress,
    )
    maps = {}
    for (role, each), raw in zip(roles.items(), raws, strict=True):
        nan, infinite, _ = raw.flaws
        if nan + infinite:
            raise InvalidBtf(f"{each.entry.name}: {nan + infinite} of its values are not finite")
        notes += [f"{each.entry.base}: {note}" for note in raw.notes]
        maps[role] = raw.values.astype(np.float32)
    height, width = maps["albedo"].shape[:2]
    largest = max(max(values.shape[:2]) for values in maps.values())
    factor = largest / max(height, width)
    target = (max(1, round(height * factor)), max(1, round(width * factor)))
    for role, values in maps.items():
        rows, columns = values.shape[:2]
        if max(rows, columns) > _SMALL and abs(rows * width / (columns * height) - 1) > _ASPECT:
            raise InvalidBtf(
                f"{roles[role].entry.name}: {columns} x {rows} texels (reduced) do not have the"
                f" proportions of the colour map, {width} x {height}"
            )
        if (rows, columns) != target:
            maps[role] = area_reduced(values, *target, False)
    return maps


def _parts(maps: dict[str, F4], notes: list[str]) -> dict[str, F4]:
    """Roughness, metallic, ao and mask, as far as they are there."""
    plain = ("roughness", "metallic", "ao", "mask")
    out: dict[str, F4] = {key: _grey(maps[key]) for key in plain if key in maps}
    if "gloss" in maps:
        out["roughness"] = 1 - _grey(maps["gloss"])
        notes.append("roughness is one minus the gloss map")
    if "arm" in maps and maps["arm"].ndim == 3:
        for channel, key in enumerate(("ao", "roughness", "metallic")):
            out.setdefault(key, np.ascontiguousarray(maps["arm"][:, :, channel]))
        notes.append("occlusion, roughness and metalness are the packed map's red, green and blue")
    return {key: np.clip(values, 0, 1) for key, values in out.items()}


def _green(roles: dict[str, Named], normals: str) -> tuple[bool | None, bool]:
    """Whether the normal map's green points down, as far as knob and names say, and surely."""
    if normals != "auto":
        return normals == "directx", True
    for role, down in (("normal_gl", False), ("normal_dx", True)):
        if role in roles:
            return down, not roles[role].unreal
    return None, False


def _vectors(values: F4, notes: list[str]) -> F4:
    """Unit vectors of a normal map's 0–1 colours; blue is made up where it holds nothing."""
    vectors = _three(values) * 2 - 1
    if np.ptp(vectors[..., 2]) < 1e-3 and np.ptp(vectors[..., :2]) > 0.05:
        left = 1 - (vectors[..., :2] ** 2).sum(axis=-1)
        vectors[..., 2] = np.sqrt(np.maximum(left, 0))
        notes.append("the normal map has two channels; the third follows from them")
    np.maximum(vectors[..., 2], 1e-2, out=vectors[..., 2])
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _heights(values: F4, notes: list[str]) -> F4:
    grey = _grey(values)
    low, high = float(grey.min()), float(grey.max())
    if low < -1e-4 or high > 1 + 1e-4:
        notes.append(f"stretched heights of {low:.4g} … {high:.4g} to 0 … 1")
        return (grey - np.float32(low)) / np.float32(high - low)
    return np.clip(grey, 0, 1)


def _tiles(colours: F4, notes: list[str]) -> bool:
    """Whether opposite borders differ little more than neighbouring rows and columns do."""
    grey = np.sqrt(colours.mean(axis=2))
    for axis, what in ((0, "top and bottom"), (1, "left and right")):
        if grey.shape[axis] < 8:
            continue
        steps = np.abs(np.diff(grey, axis=axis)).mean(axis=1 - axis)
        border = float(np.abs(grey.take(0, axis) - grey.take(-1, axis)).mean())
        if border > _BORDER * float(np.percentile(steps, 90)) + 0.01:
            notes.append(f"does not tile: {what} differ")
            return False
    return True


def _grey(values: F4) -> F4:
    return values if values.ndim == 2 else values.mean(axis=2, dtype=np.float32)


def _three(values: F4) -> F4:
    return values.copy() if values.ndim == 3 else np.repeat(values[:, :, None], 3, axis=2)
