"""Which sample covers which region of a mesh, as a user words it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from btfcore.errors import InvalidRegions
from btfcore.progress import Progress, silent
from btfcore.types import I4, DenseMesh, Field, Mesh

if TYPE_CHECKING:
    from btfcore.quilt.layout import Borders, Layout

SOFT, HARD = "soft", "hard"
_SHOWN = 12  # names that an error lists


@dataclass(frozen=True)
class RegionSamples:
    """What a user asks for, in words; `SAMPLE` covers the regions that no entry names.

    way : what the regions are, see `btfcore.mesh.reader.read_mesh`. samples : entries
    "REGION=FILE"; scales : "REGION=2", which multiplies the pattern's size there; borders :
    "soft" or "hard" for all borders, and "REGION|REGION=soft" for one. Raises
    `InvalidRegions` where an entry lacks its "=".
    """

    way: str = "auto"
    samples: Sequence[str] = ()
    scales: Sequence[str] = ()
    borders: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check what can be checked before the mesh is there."""
        for option, entries in (("--sample", self.samples), ("--region-scale", self.scales)):
            for entry in entries:
                name, equals, value = entry.partition("=")
                if not (name and equals and value):
                    what = "FILE" if option == "--sample" else "NUMBER"
                    raise InvalidRegions(f"{option} {entry!r} is not REGION={what}")
        for entry in self.borders:
            head, equals, kind = entry.rpartition("=")
            known = kind in (SOFT, HARD)
            if not known or (equals and "|" not in head):
                raise InvalidRegions(
                    f"--border {entry!r} is neither soft, hard, nor REGION|REGION=soft or =hard"
                )

    @property
    def plain(self) -> bool:
        """Nothing but one sample everywhere is asked for."""
        return self.way == "auto" and not (self.samples or self.scales or self.borders)


@dataclass(frozen=True, eq=False)
class Plan:
    """Samples of a mesh's regions, numbered as the regions come.

    files, scales: the samples; sample: index into them for each region; names: the regions;
    borders: which are hard.
    """

    names: tuple[str, ...]
    files: tuple[Path, ...]
    scales: tuple[float, ...]
    sample: tuple[int, ...]
    borders: Borders
    notes: tuple[str, ...] = field(default=())

    def layout(
        self,
        mesh: Mesh,
        dense: DenseMesh,
        orientation: Field,
        width: int,
        *,
        progress: Progress = silent,
    ) -> Layout:
        """Lay the samples out on a dense mesh of `mesh`; see `btfcore.quilt.layout`."""
        from btfcore.patch.connectivity import connect
        from btfcore.quilt.layout import lay_out

        net = connect(dense, orientation, progress=progress)
        return lay_out(net, vertex_regions(mesh, dense), self.sample, self.borders, width)


def vertex_regions(mesh: Mesh, dense: DenseMesh) -> I4:
    """Region (N,) i4 of every vertex of the dense mesh: that of the face it lies on."""
    if mesh.region is None:
        return np.zeros(len(dense.face), np.int32)
    return np.ascontiguousarray(mesh.region[dense.face], np.int32)


def plan_samples(mesh: Mesh, sample: str | Path, asked: RegionSamples) -> Plan:
    """Find the regions that `asked` names on `mesh`; `sample` covers all others.

    The order of the entries does not matter. Raises `InvalidRegions` for names that the mesh
    does not have, listing those that it has, for a region named twice and for scales that
    are no positive numbers.
    """
    from btfcore.quilt.layout import Borders

    names = mesh.region_names or ("all",)
    files = dict.fromkeys(names, Path(sample))
    scales = dict.fromkeys(names, 1.0)
    files |= {name: Path(value) for name, value in _entries("--sample", asked.samples, names)}
    for name, value in _entries("--region-scale", asked.scales, names):
        scales[name] = _scale(name, value)
    wanted = [(files[name], scales[name]) for name in names]
    kinds = list(dict.fromkeys(wanted))
    index = {kind: place for place, kind in enumerate(kinds)}
    hard, pairs, flags = True, [], []
    for entry in asked.borders:
        if entry in (SOFT, HARD):
            hard = entry == HARD
            continue
        head, _, kind = entry.rpartition("=")
        pairs.append(_pair(head, names))
        flags.append(kind == HARD)
    notes = []
    if asked.samples and Path(sample) not in files.values():
        notes.append(f"covers no region: each of the {len(names)} has a sample of its own")
    return Plan(
        names,
        tuple(kind[0] for kind in kinds),
        tuple(kind[1] for kind in kinds),
        tuple(index[kind] for kind in wanted),
        Borders(hard, np.array(pairs, np.int32).reshape(-1, 2), np.array(flags, bool)),
        tuple(notes),
    )


def region_table(mesh: Mesh) -> list[dict[str, object]]:
    """Name, number of faces and share of the surface of every region; plain JSON."""
    corner = mesh.vertices[mesh.faces]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    names = mesh.region_names or ("all",)
    label = np.zeros(len(mesh.faces), np.int32) if mesh.region is None else mesh.region
    faces = np.bincount(label, minlength=len(names))
    share = np.bincount(label, area, len(names)) / max(float(area.sum()), 1e-300)
    return [
        {"name": name, "faces": int(faces[each]), "area": round(float(share[each]), 6)}
        for each, name in enumerate(names)
    ]


def _entries(
    option: str, entries: Sequence[str], names: Sequence[str]
) -> Iterator[tuple[str, str]]:
    seen: set[str] = set()
    for entry in entries:
        # a name may hold "=" itself: the longest one that the mesh knows counts
        cuts = [place for place, letter in enumerate(entry) if letter == "="]
        name = next((entry[:cut] for cut in reversed(cuts) if entry[:cut] in names), None)
        if name is None:
            raise InvalidRegions(f"{option} {entry!r}: {_unknown(entry[: cuts[0]], names)}")
        if name in seen:
            raise InvalidRegions(f"{option} names region {name!r} twice")
        seen.add(name)
        yield name, entry[len(name) + 1 :]


def _pair(head: str, names: Sequence[str]) -> tuple[int, int]:
    cuts = [place for place, letter in enumerate(head) if letter == "|"]
    for cut in cuts:
        if head[:cut] in names and head[cut + 1 :] in names:
            one, two = names.index(head[:cut]), names.index(head[cut + 1 :])
            if one == two:
                raise InvalidRegions(f"--border {head!r}: region {names[one]!r} twice")
            return one, two
    left, right = head.split("|", 1)
    name = right if left in names else left
    raise InvalidRegions(f"--border {head!r}: {_unknown(name, names)}")


def _unknown(name: str, names: Sequence[str]) -> str:
    shown = ", ".join(repr(each) for each in names[:_SHOWN])
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"the mesh has no region {name!r}; it has {shown}{more}"


def _scale(name: str, value: str) -> float:
    try:
        scale = float(value)
    except ValueError:
        scale = 0.0
    if not 0.01 <= scale <= 100:
        raise InvalidRegions(f"--region-scale {name}={value}: not a number from 0.01 to 100")
    return scale
