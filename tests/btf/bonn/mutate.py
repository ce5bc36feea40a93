"""Broken Bonn files in any number, made of the small whole ones, and what they must end in.

`for what, data in mutants(seed, count): check(data)` raises where a file is read into a
sample that breaks its promises, or refused otherwise than by an error of Patina's own.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from btfcore.btf.bonn.reader import bonn_sample, read_bonn
from btfcore.btf.sample import BtfSample
from btfcore.errors import PatinaError
from tests.btf.bonn.synthetic import File, every

ABSURD = (0, 1, 2, 3, 255, 65535, 65536, 1 << 24, 1 << 31, (1 << 32) - 1, 1431655766, 0x52)
FLOATS = (np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e-40, 3e38, 1e30, 2 * np.pi)


def mutants(seed: int, count: int) -> Iterator[tuple[str, bytes]]:
    """Descriptions and bytes of `count` mutants, the same for the same seed."""
    draw = np.random.default_rng(seed)
    files = {name: make()[0] for name, make in every().items()}
    names = list(files)
    for _ in range(count):
        name = names[draw.integers(len(names))]
        data = bytes(files[name].data)
        words = [name]
        for _ in range(int(draw.choice([1, 1, 1, 2, 3]))):
            word, data = _mutate(draw, files[name], data, files[names[draw.integers(len(names))]])
            words.append(word)
        yield ", ".join(words), data


def check(file: bytes | str | Path) -> BtfSample | None:
    """Read `file`; returns the sample, or None where it was refused by name."""
    try:
        sample = bonn_sample("mutant", file) if isinstance(file, bytes) else read_bonn(file)
    except PatinaError as error:
        name = "mutant" if isinstance(file, bytes) else Path(file).name
        assert str(error).startswith(name), f"the error does not name the file: {error}"
        return None
    count, height, width = sample.stack.shape
    assert (count, height, width) == (sample.images, *sample.shape)
    images = sample.stack.read([0, count - 1])
    assert images.shape == (2, height, width, 3) and images.dtype == np.float32
    assert np.isfinite(images).all() and (images >= 0).all()
    assert np.isfinite(sample.views).all() and np.isfinite(sample.lights).all()
    assert sample.origin.isprintable() and all(note.isprintable() for note in sample.notes)
    return sample


def _mutate(draw: np.random.Generator, file: File, data: bytes, other: File) -> tuple[str, bytes]:
    way = draw.integers(10) if data else 5
    at = int(draw.integers(max(1, len(data))))
    if way <= 2:  # most of a file is payload, in which nothing can go wrong
        return _overwrite(draw, file, data)
    if way == 3:
        places = draw.integers(0, min(len(data), 500 if draw.random() < 0.7 else 1 << 30), 4)
        changed = bytearray(data)
        for place in places[: draw.integers(1, 5)]:
            changed[place] ^= 1 << int(draw.integers(8))
        return f"bits flipped at {places}", bytes(changed)
    if way == 4:
        return f"cut off at {at}", data[:at]
    if way == 5:
        added = draw.bytes(int(draw.integers(1, 64)))
        return f"{len(added)} bytes put in at {at}", data[:at] + added + data[at:]
    if way == 6:
        length = int(draw.integers(1, 64))
        return f"{length} bytes taken out at {at}", data[:at] + data[at + length :]
    if way >= 8:  # the values themselves
        begin = file.at("height")[0]
        places = draw.integers(begin, max(begin + 1, len(data)), draw.integers(1, 40))
        changed = bytearray(data)
        for place in places[places < len(data)]:
            changed[place] = int(draw.choice([0, 0x7B, 0x7C, 0x7F, 0x80, 0xFC, 0xFF]))
        return f"{len(places)} bytes of values changed", bytes(changed)
    place = other.fields[draw.integers(len(other.fields))][1]
    here = file.fields[draw.integers(len(file.fields))][1]
    return f"another's end from {place} put on at {here}", data[:here] + other.data[place:]


def _overwrite(draw: np.random.Generator, file: File, data: bytes) -> tuple[str, bytes]:
    numbers = [item for item in file.fields if item[3] in ("u8", "u32")]
    chosen = numbers if draw.random() < 0.7 else file.fields
    name, start, length, kind = chosen[draw.integers(len(chosen))]
    if start + length > len(data) or length == 0:
        return f"{name} is gone", data
    if kind == "u32":
        (old,) = struct.unpack_from("<I", data, start)
        near = (old + int(draw.integers(-2, 3)), old * 2, old << 16, old - 1, len(data))
        raw = struct.pack("<I", int(draw.choice(ABSURD + near)) % (1 << 32))
    elif kind == "u8":
        raw = bytes([int(draw.choice([0, 1, 2, 3, 4, 8, 16, 255]))])
    elif kind.startswith("f"):
        with np.errstate(over="ignore"):
            raw = np.array([FLOATS[draw.integers(len(FLOATS))]], f"<{kind}").tobytes()
        start += int(draw.integers(length // len(raw))) * len(raw)
    else:
        raw = draw.bytes(min(length, 16))
    return f"{name} at {start} made {raw.hex()}", data[:start] + raw + data[start + len(raw) :]
