"""Mutants of small sound files, and what every reader owes them: a result or a named error.

`run(count)` is what `make fuzz` calls; no native decoder is reached from here, so that it all
happens in one process, thousands of times.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from btfcore.btf.readers import bonn_names, rti_folder, table_text
from btfcore.btf.readers.conditions import arrange
from btfcore.btf.readers.listing import list_files
from btfcore.btf.readers.members import read_bytes
from btfcore.btf.readers.ptm import looks_like_ptm, read_ptm
from btfcore.btf.readers.snap import snapped
from btfcore.errors import PatinaError
from tests.btf.readers.hostile import Member, archive

_EXTREME = (0, 1, 0x7F, 0x80, 0xFF)
_WORDS = (b"-1", b"0", b"1e309", b"nan", b"99999999999999999999", b"..", b"/", b"\0", b"\n", b",")


def seeds() -> dict[str, bytes]:
    """A small sound file of every kind."""
    images = [Member(b"a/tl%03d pl000 tv000 pv000.png" % n, bytes(20 + n)) for n in range(3)]
    images[1].method = 8
    plain = archive(images[:1])
    start = plain.index(b"PK\x01\x02")
    length = plain.index(b"PK\x05\x06") - start
    ptm = b"PTM_1.2\nPTM_FORMAT_LRGB\n4\n3\n1 1 1 1 1 1\n0 0 0 0 0 0\n" + bytes(range(108))
    info = {"PTM": {"type": "LRGB_PTM", "scale": [1, 2, 1, 1, 1, 2], "bias": [0, 1, 2, 3, 4, 5]}}
    return {
        "zip": archive([*images, Member(b"directions.csv", b"file,lx,ly,lz\na,0,0,1\n")]),
        "zip64": archive(images[:1], zip64=(1, length, start)),
        "ptm": ptm,
        "lp": b"3\na.png 0 0 1\nsub/b c.png 0.6 0 0.8\nd.png 0 -0.6 0.8\n",
        "csv": b"file,theta_view,phi_view,theta_light,phi_light\na.png,0,0,0,0\nb.png,0,0,75,345\n",
        "info": json.dumps(info).encode(),
    }


def mutants(data: bytes, count: int, seed: int) -> Iterator[bytes]:
    """`count` files near `data`: bits flipped, numbers blown up, parts cut, doubled, swapped."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        out = bytearray(data)
        for _ in range(int(rng.integers(1, 4))):
            at = int(rng.integers(0, len(out) + 1))
            span = int(rng.integers(1, 9))
            way = int(rng.integers(0, 7))
            if way == 0 and at < len(out):
                out[at] ^= 1 << int(rng.integers(0, 8))
            elif way == 1:
                out[at : at + span] = bytes([int(rng.choice(_EXTREME))]) * span
            elif way == 2:
                del out[at : at + span]
            elif way == 3:
                out[at:at] = out[at : at + span]
            elif way == 4:
                out = out[:at]
            elif way == 5:
                out[at : at + span] = _WORDS[int(rng.integers(0, len(_WORDS)))]
            else:
                out[at:at] = bytes(rng.integers(0, 256, span, dtype=np.uint8))
        yield bytes(out)


def check(kind: str, data: bytes, folder: Path) -> bool:
    """Whether `data` was read; a named error is as good, any other exception is a bug."""
    try:
        _READERS[kind](data, folder)
    except PatinaError as error:
        assert str(error), kind
        return False
    return True


def _zip(data: bytes, folder: Path) -> None:
    path = folder / "mutant.zip"
    path.write_bytes(data)
    files = list_files(path)
    for entry in files.entries:
        assert ".." not in entry.name.split("/")
        assert not entry.name.startswith("/")
        content = read_bytes(files.place, entry, most=1 << 20)
        assert len(content) == entry.size
    found = [(entry.name, bonn_names._stated(entry)) for entry in files.ending(".png")]
    stated = np.array([angles for _, angles in found if angles])
    if len(stated):
        views = bonn_names.from_angles(stated[:, 0], stated[:, 1])
        lights = bonn_names.from_angles(stated[:, 2], stated[:, 3])
        snapped(arrange(views, lights, [name for name, angles in found if angles]))


def _ptm(data: bytes, folder: Path) -> None:
    path = folder / "mutant.ptm"
    path.write_bytes(data)
    assert looks_like_ptm(path) in (True, False)
    sample = read_ptm(path, lights=[[0, 0, 1], [0.6, 0, 0.8]])
    image = sample.stack.read([1])
    assert image.min() >= 0
    assert np.isfinite(image).all()


def _table(parse: Callable[[str, bytes], table_text.Table]) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        found = parse("mutant", data)
        for vectors in (found.views, found.lights):
            assert np.abs(np.linalg.norm(vectors, axis=1) - 1).max() < 1e-9
        for name in found.names:
            assert (folder / name).resolve().is_relative_to(folder.resolve())
        arrange(found.views, found.lights, found.names)

    return read


def _info(data: bytes, folder: Path) -> None:
    count, scale, bias = rti_folder._numbers("mutant", rti_folder._parsed("mutant", data))
    assert count in (3, 6)
    assert scale.shape == bias.shape == (6,)


_READERS: dict[str, Callable[[bytes, Path], None]] = {
    "zip": _zip,
    "zip64": _zip,
    "ptm": _ptm,
    "lp": _table(table_text.parse_lp),
    "csv": _table(table_text.parse_csv),
    "info": _info,
}


def run(count: int, folder: Path, seed: int = 0) -> dict[str, tuple[int, int]]:
    """Check `count` mutants of each kind; returns read and refused ones by kind."""
    out = {}
    for kind, data in seeds().items():
        assert check(kind, data, folder), kind
        read = sum(check(kind, mutant, folder) for mutant in mutants(data, count, seed))
        out[kind] = (read, count - read)
    return out
