"""Broken packages: every part changed in turn, and random changes of bytes."""

import json
import struct
import zipfile

import numpy as np

from btfcore.errors import PatinaError
from btfcore.files.package.read import read_package
from btfcore.files.package.write import write_package
from tests.btf.bricks import factors, sample


def originals(folder):
    """Bytes of a factorised and of a raw package with every optional part."""
    mask = np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8)
    whole = sample(factors=factors(), mask=mask, texel_size=0.5)
    return [
        write_package(folder / f"{kind}.btfz", whole, contents=kind).read_bytes()
        for kind in ("factors", "images")
    ]


def check(path):
    """Read a package, all of it; a result of finite images or a named error are both right."""
    try:
        found = read_package(path)
        block = found.stack.read(np.arange(min(found.images, 64)))
    except PatinaError as error:
        assert path.name in str(error)
        return False
    assert np.isfinite(block).all() and (block >= 0).all()
    return True


def repacked(data, folder, *, manifest=None, header=None, names=None, method=zipfile.ZIP_STORED):
    """Bytes of a package with its manifest, tensor header or member names changed by functions."""
    path = folder / "repacked.btfz"
    source = folder / "source.zip"
    source.write_bytes(data)
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w", method) as new:
        for name in old.namelist():
            body = old.read(name)
            if name == "manifest.json" and manifest:
                body = json.dumps(manifest(json.loads(body))).encode()
            if name.endswith(".safetensors") and header:
                (length,) = struct.unpack("<Q", body[:8])
                text = json.dumps(header(json.loads(body[8 : 8 + length]))).encode()
                body = struct.pack("<Q", len(text)) + text + body[8 + length :]
            new.writestr(names(name) if names else name, body)
    return path.read_bytes()


def mutants(data, count, seed):
    """Yield `count` damaged copies: bytes changed, spans cut, repeated or zeroed, ends cut off."""
    generator = np.random.default_rng(seed)
    interesting = np.array([0, 1, 0x7F, 0x80, 0xFF], np.uint8)
    # headers and the central directory are small beside the tensors: aim at them half the time
    ends = np.r_[0 : min(4096, len(data)), max(0, len(data) - 600) : len(data)]
    for _ in range(count):
        body = bytearray(data)
        for _ in range(int(generator.integers(1, 4))):
            place = int(
                generator.choice(ends)
                if generator.random() < 0.5
                else generator.integers(len(data))
            )
            place = min(place, len(body) - 1)
            kind = int(generator.integers(6))
            size = int(generator.integers(1, 64))
            if kind <= 1:
                body[place] = int(generator.integers(256))
            elif kind == 2:
                body[place : place + 4] = bytes([int(generator.choice(interesting))] * 4)
            elif kind == 3:
                del body[place : place + size]
            elif kind == 4:
                body[place:place] = body[place : place + size]
            else:
                del body[max(place, 1) :]
        yield bytes(body or b"\0")
