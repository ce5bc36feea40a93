"""Broken and unusual files that users open, made on the spot for the corpus run and tests."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
# What a run may end in: a decorated mesh, a named error, or either of the two.
RESULT, NAMED, EITHER = "result", "named error", "either"


def sphere_obj(*, rows: int = 12, columns: int = 18, scale: float = 1.0, shift: float = 0.0) -> str:
    """A closed sphere as OBJ text."""
    lines = []
    for row in range(1, rows):
        for column in range(columns):
            theta, phi = np.pi * row / rows, 2 * np.pi * column / columns
            point = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)])
            x, y, z = (*(point * scale + shift).tolist(), float(np.cos(theta)) * scale + shift)
            lines.append(f"v {x!r} {y!r} {z!r}")
    lines += [f"v {shift} {shift} {shift + scale}", f"v {shift} {shift} {shift - scale}"]
    north, south = (rows - 1) * columns + 1, (rows - 1) * columns + 2
    for column in range(columns):
        after = (column + 1) % columns
        lines.append(f"f {north} {column + 1} {after + 1}")
        for row in range(rows - 2):
            a, b = row * columns + column + 1, row * columns + after + 1
            lines.append(f"f {a} {a + columns} {b + columns} {b}")
        last = (rows - 2) * columns
        lines.append(f"f {last + after + 1} {last + column + 1} {south}")
    return "\n".join(lines) + "\n"


def grey_png(width: int, height: int, *, whole: bool = True) -> bytes:
    """A noisy grey PNG; without `whole` it only claims its size."""
    base = np.random.default_rng(0).integers(0, 256, width, np.uint8)
    packer = zlib.compressobj(1)
    rows = (b"\0" + np.roll(base, 7 * row).tobytes() for row in range(height if whole else 0))
    packed = b"".join(packer.compress(row) for row in rows)
    packed += packer.flush()
    out = b"\x89PNG\r\n\x1a\n"
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    for kind, data in ((b"IHDR", head), (b"IDAT", packed), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data
        out += struct.pack(">I", zlib.crc32(kind + data))
    return out


def bad_meshes(folder: Path) -> dict[str, tuple[Path, str]]:
    """Make the meshes in `folder`; per description the file and what a run may end in."""
    folder.mkdir()
    (folder / "a folder.obj").mkdir()
    moebius = _moebius()
    texts: dict[str, tuple[str, bytes | str | None, str]] = {
        "missing file": ("missing.obj", None, NAMED),
        "folder": ("a folder.obj", None, NAMED),
        "zero bytes": ("zero.obj", b"", NAMED),
        "text renamed .glb": ("text.glb", "dear diary\n" * 20, NAMED),
        "Git LFS pointer": ("lfs.ply", "version https://git-lfs.github.com/spec/v1\n", NAMED),
        "index out of range": ("range.obj", TRIANGLE + "f 1 2 9\n", NAMED),
        "one triangle": ("one.obj", TRIANGLE, RESULT),
        "NaN coordinates": ("nan.obj", TRIANGLE.replace("v 1", "v nan"), NAMED),
        "sphere with a NaN vertex": ("hole.obj", _with_nan(sphere_obj()), RESULT),
        "one coordinate of 1e30": ("far.obj", TRIANGLE.replace("v 1", "v 1e30"), NAMED),
        "sphere of radius 1e30": ("1e30.obj", sphere_obj(scale=1e30), NAMED),
        "sphere of radius 1e-30": ("1e-30.obj", sphere_obj(scale=1e-30), NAMED),
        "sphere of radius 1e9": ("1e9.obj", sphere_obj(scale=1e9), RESULT),
        "sphere of radius 1e-9": ("1e-9.obj", sphere_obj(scale=1e-9), RESULT),
        "sphere at 1e7": ("at1e7.obj", sphere_obj(shift=1e7), RESULT),
        "triangle without area": ("flat.obj", TRIANGLE.replace("v 0 1 0", "v 2 0 0"), NAMED),
        "Möbius strip": ("möbius strip.obj", moebius, RESULT),
        "two tetrahedra at one edge": ("edge.obj", _two_tetrahedra(), RESULT),
        "double-sided triangle": ("double.obj", TRIANGLE + "f 3 2 1\n", RESULT),
    }
    found = {}
    for description, (name, content, ending) in texts.items():
        if content is not None:
            data = content if isinstance(content, bytes) else content.encode()
            (folder / name).write_bytes(data)
        found[description] = (folder / name, ending)
    return found


def bad_images(folder: Path) -> dict[str, tuple[Path, str]]:
    """Make the images in `folder`; per description the file and what a run may end in."""
    folder.mkdir()
    (folder / "a folder.png").mkdir()
    y, x = np.mgrid[:96, :128]
    noise = np.random.default_rng(1).integers(0, 60, (96, 128, 3))
    colour = Image.fromarray((noise + np.stack([x, y, x // 2 + y // 2], -1)).astype(np.uint8))
    deep = np.random.default_rng(2).integers(0, 65536, (96, 128)).astype(np.uint16)
    clear = colour.copy()
    clear.putalpha(Image.fromarray((2 * x).astype(np.uint8)))

    def save(image: Image.Image) -> Callable[[Path], None]:
        return image.save

    def write(data: bytes) -> Callable[[Path], int]:
        return lambda path: path.write_bytes(data)

    makers: dict[str, tuple[str, Callable[[Path], object] | None, str]] = {
        "missing image": ("missing.png", None, NAMED),
        "folder as image": ("a folder.png", None, NAMED),
        "image of zero bytes": ("zero.png", write(b""), NAMED),
        "text as image": ("text.png", write(b"no image at all\n" * 9), NAMED),
        "image cut off": ("cut.png", write(grey_png(128, 96)[:-90]), NAMED),
        "1 x 1 image": ("one.png", save(colour.resize((1, 1))), EITHER),
        "3 x 200 image": ("thin.png", save(colour.resize((3, 200))), EITHER),
        "CMYK JPEG": ("cmyk.jpg", save(colour.convert("CMYK")), RESULT),
        "16-bit PNG": ("deep.png", save(Image.fromarray(deep)), RESULT),
        "palette PNG": ("palette.png", save(colour.convert("P")), RESULT),
        "grey PNG": ("grey.png", save(colour.convert("L")), RESULT),
        "grey PNG with alpha": ("la.png", save(clear.convert("LA")), RESULT),
        "PNG with alpha": ("alpha.png", save(clear), RESULT),
        "one-colour image": ("plain.png", save(Image.new("RGB", (64, 64), "teal")), RESULT),
        "30,000 x 40 image": ("long.png", write(grey_png(30_000, 40)), RESULT),
        "claims 30,000 x 30,000": ("huge.png", write(grey_png(30_000, 30_000, whole=False)), NAMED),
    }
    found = {}
    for description, (name, make, ending) in makers.items():
        if make is not None:
            make(folder / name)
        found[description] = (folder / name, ending)
    return found


def _with_nan(text: str) -> str:
    lines = text.split("\n")
    lines[40] = "v nan nan nan"
    return "\n".join(lines)


def _two_tetrahedra() -> str:
    points = "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 1 1 0\nv -1 0 0\nv -1 -1 0\n"
    faces = ["1 3 4", "2 4 3", "1 2 3", "1 4 2", "1 5 6", "2 6 5", "1 2 5", "1 6 2"]
    return points + "".join(f"f {face}\n" for face in faces)


def _moebius(around: int = 40) -> str:
    lines = []
    for side in (-0.3, 0.3):
        for step in range(around):
            s = 2 * np.pi * step / around
            radius = 1 + side * np.cos(s / 2)
            point = radius * np.cos(s), radius * np.sin(s), side * np.sin(s / 2)
            lines.append("v " + " ".join(f"{value:.9f}" for value in point))
    for step in range(around):
        a, b, c, d = step + 1, step + around + 1, step + 2, step + around + 2
        if step == around - 1:
            c, d = around + 1, 1
        lines.append(f"f {a} {c} {d} {b}")
    return "\n".join(lines) + "\n"
