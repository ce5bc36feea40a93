"""Which map of a PBR set a file is, told by its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from btfcore.btf.readers.entries import Entry

# Per role the words that a name ends with, the better ones first. "arm" packs occlusion,
# roughness and metalness into red, green and blue.
ROLES: dict[str, tuple[str, ...]] = {
    "normal_gl": ("normal gl", "nor gl", "normal ogl", "normal opengl", "normals gl"),
    "normal_dx": ("normal dx", "nor dx", "normal directx", "normals dx"),
    "arm": ("arm", "orm", "ao rough metal", "occlusion roughness metallic"),
    "albedo": (
        "base color", "base colour", "basecolor", "basecolour", "albedo", "alb", "color",
        "colour", "diffuse", "diff", "col",
    ),
    "normal": ("normal", "normals", "normal map", "normalmap", "nor", "norm", "nrm", "nml"),
    "roughness": ("roughness", "rough", "rgh"),
    "gloss": ("glossiness", "gloss", "smoothness"),
    "metallic": ("metallic", "metalness", "metallness", "metal", "mtl"),
    "ao": ("ambient occlusion", "ambientocclusion", "occlusion", "ao", "occ"),
    "height": ("displacement", "disp", "height", "height map", "heightmap", "bump"),
    "depth": ("depth",),
    "mask": ("mask",),
    "other": (
        "opacity", "alpha", "specular", "spec", "emission", "emissive", "preview", "sphere",
        "cavity", "translucency", "thickness", "idmap", "curvature", "anisotropy",
    ),
}  # fmt: skip
_LETTERS = {
    "d": "albedo", "bc": "albedo", "n": "normal_dx", "r": "roughness", "m": "metallic",
    "h": "height",
}  # fmt: skip
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_ENDING = re.compile(
    r"[\s_.-]*(?:\b|(?<=_))(?:(\d{1,2})k|(\d{3,5})(?:x\d{3,5})?|jpe?g|png|exr|tiff?|\d{1,2}bit)$",
    re.IGNORECASE,
)
_PREFERRED = (".exr", ".tif", ".tiff", ".png", ".webp", ".bmp", ".tga", ".jpg", ".jpeg", ".hdr")


@dataclass(frozen=True)
class Named:
    """A file, the map that it is (a key of `ROLES`, or "" where its name does not say).

    group : folder and the rest of its name, the same for all maps of one set. rank : sorts
    the files of one role, the best first. unreal : named in the manner of Unreal (`T_X_N`).
    label : what the set may be called.
    """

    entry: Entry
    role: str
    group: str
    rank: tuple[int, int, int]
    unreal: bool = False
    label: str = ""


def named(entry: Entry) -> Named:
    """Read a file's name."""
    folder = entry.name[: len(entry.name) - len(entry.base)]
    stem = entry.base[: len(entry.base) - len(entry.suffix)]
    resolution = 0
    while True:
        match = _ENDING.search(stem)
        if match is None or match.start() == 0:
            break
        if match[1] or match[2]:
            resolution = int(match[1]) * 1024 if match[1] else int(match[2])
        stem = stem[: match.start()]
    words = [(found[0].lower(), found.start()) for found in _WORD.finditer(stem)]
    kind = _PREFERRED.index(entry.suffix) if entry.suffix in _PREFERRED else len(_PREFERRED)
    unreal = stem[:2].lower() == "t_"
    if unreal and len(words) > 1 and words[-1][0] in _LETTERS:
        group, label = _group(folder, stem[: words[-1][1]])
        return Named(entry, _LETTERS[words[-1][0]], group, (0, -resolution, kind), True, label)
    best: tuple[int, str, int, int] | None = None  # words, role, place among its words, start
    for role, endings in ROLES.items():
        for place, ending in enumerate(endings):
            parts = ending.split()
            if [word for word, _ in words[-len(parts) :]] == parts and (
                best is None or len(parts) > best[0]
            ):
                best = (len(parts), role, place, words[-len(parts)][1])
    if best is None:
        group, label = _group(folder, stem)
        return Named(entry, "", group, (0, -resolution, kind), False, label)
    _, role, place, start = best
    group, label = _group(folder, stem[:start])
    return Named(entry, role, group, (place, -resolution, kind), unreal, label)


def grouped(entries: Sequence[Entry]) -> dict[str, dict[str, list[Named]]]:
    """Sets by their group, in each the files of a role, the best first.

    A file whose name says nothing is the colour map of the group that is named like it.
    """
    every = [named(entry) for entry in entries]
    sets: dict[str, dict[str, list[Named]]] = {}
    for each in every:
        if each.role:
            sets.setdefault(each.group, {}).setdefault(each.role, []).append(each)
    for each in every:
        if not each.role and each.group in sets and "albedo" not in sets[each.group]:
            sets[each.group]["albedo"] = [each]
    for roles in sets.values():
        for files in roles.values():
            files.sort(key=lambda file: (file.rank, file.entry.name))
    return {
        group: roles
        for group, roles in sorted(sets.items())
        if "albedo" in roles and set(roles) - {"albedo", "other", "mask"}
    }


def _group(folder: str, rest: str) -> tuple[str, str]:
    """Where a set's files belong together, and what the set may be called."""
    trimmed = rest.rstrip(" _.-")
    label = trimmed.removeprefix("T_").removeprefix("t_") or folder.rstrip("/").rpartition("/")[2]
    return (folder + trimmed).casefold(), label
