"""Which faces of an OBJ file belong to which material, object and group."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.types import I4


@dataclass(frozen=True, eq=False)
class ObjGroups:
    """An OBJ file as one list of triangles, in the file's order.

    text: the file with its polygons cut into fans and without statements that part it;
    face, material, part (T,) i4: face of the file, material and object or group of every
    triangle, -1 before the first; faces: how many faces the file has.
    """

    text: bytes
    face: I4
    material: I4
    part: I4
    material_names: tuple[str, ...]
    part_names: tuple[str, ...]
    faces: int


def obj_groups(text: bytes, *, always: bool = False) -> ObjGroups | None:
    """Read the groups of an OBJ file that went through `tidy_obj`.

    None where it names no more than one and `always` is false, or where a face has less than
    three corners: then the parser shall read it as it is.
    """
    starts = (b"usemtl", b"g ", b"o ")
    if not always and not any(text.startswith(s) or b"\n" + s in text for s in starts):
        return None
    materials: dict[str, int] = {}
    parts: dict[str, int] = {}
    owner, group = "", ""
    material = part = -1
    out: list[bytes] = []
    rows: list[tuple[int, int, int]] = []
    faces = 0
    for line in text.split(b"\n"):
        word = line[: line.find(b" ")] if b" " in line else line
        if word == b"f":
            corners = line.split()[1:]
            if len(corners) < 3:
                return None
            for index in range(len(corners) - 2):
                # the second half of a quad begins where the parser lets it begin
                one, two, three = corners[0], corners[index + 1], corners[index + 2]
                ring = (two, three, one) if index and len(corners) == 4 else (one, two, three)
                out.append(b"f " + b" ".join(ring))
                rows.append((faces, material, part))
            faces += 1
        elif word == b"usemtl":
            material = materials.setdefault(_name(line, 6), len(materials))
        elif word in (b"o", b"g"):
            owner, group = (_name(line, 1), "") if word == b"o" else (owner, _name(line, 1))
            name = "/".join(dict.fromkeys(each for each in (owner, group) if each))
            part = parts.setdefault(name, len(parts))
        elif word != b"s":
            out.append(line)
    table = np.array(rows, np.int32).reshape(-1, 3)
    if not always and len(np.unique(table[:, 1:], axis=0)) < 2:
        return None
    return ObjGroups(
        b"\n".join(out), table[:, 0], table[:, 1], table[:, 2],
        tuple(materials), tuple(parts), faces,
    )  # fmt: skip


def _name(line: bytes, skip: int) -> str:
    return line[skip:].strip().decode("utf-8", "replace")
