"""Small Bonn files made from the description of the formats, with a list of their fields."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

VIEWS, LIGHTS, WIDTH, HEIGHT = 5, 4, 6, 8
KINDS = {2: "<f2", 4: "<f4", 8: "<f8"}
EPSILON = 1e-5


@dataclass
class File:
    """Bytes in the making; `fields` are (name, offset, length, kind of number)."""

    data: bytearray = field(default_factory=bytearray)
    fields: list[tuple[str, int, int, str]] = field(default_factory=list)

    def put(self, name: str, raw: bytes, kind: str = "raw") -> None:
        self.fields.append((name, len(self.data), len(raw), kind))
        self.data += raw

    def u8(self, name: str, value: int) -> None:
        self.put(name, struct.pack("<B", value), "u8")

    def u32(self, name: str, value: int) -> None:
        self.put(name, struct.pack("<I", value), "u32")

    def numbers(self, name: str, values: np.ndarray, scalar: int = 4) -> None:
        with np.errstate(over="ignore"):
            self.put(name, np.asarray(values).astype(KINDS[scalar]).tobytes(), f"f{scalar}")

    def at(self, name: str) -> tuple[int, int]:
        """Offset and length of the first field of that name."""
        return next((start, length) for known, start, length, _ in self.fields if known == name)

    def patched(self, name: str, raw: bytes) -> bytes:
        """The file with the first bytes of a field replaced by `raw`."""
        start, _ = self.at(name)
        return bytes(self.data[:start]) + raw + bytes(self.data[start + len(raw) :])


@dataclass(frozen=True)
class Truth:
    """What a file is made of; directions as (polar angle, azimuth) in radians."""

    views: np.ndarray
    lights: np.ndarray
    rank: int = 3
    seed: int = 0

    def matrix(self, rows: int, columns: int, salt: int) -> tuple[np.ndarray, np.ndarray]:
        """Left (rows, rank) and right (columns, rank) factors, exact as half floats."""
        draw = np.random.default_rng([self.seed, salt])
        left = draw.integers(-16, 17, (rows, self.rank)) / 16
        right = draw.integers(-16, 17, (columns, self.rank)) / 16
        return left, right


def truth(views: int = VIEWS, lights: int = LIGHTS, **knobs: int) -> Truth:
    """Directions on two spirals, the first straight above."""
    pairs = [
        np.stack([np.linspace(0, top, n), 2.4 * np.arange(n)], axis=1)
        for n, top in ((views, 1.2), (lights, 1.3))
    ]
    return Truth(pairs[0], pairs[1], **knobs)


def description(
    file: File,
    *,
    version: int = 4,
    ppmm: float = 12.5,
    scale: tuple[float, ...] = (1, 1, 1),
    cosine: int = 1,
    xml: bytes = b"<a/>",
    names: tuple[bytes, ...] = (b"R", b"G", b"B"),
    words: tuple[bytes, bytes, bytes] = (b"dome", b"sensor", b"lamp"),
) -> None:
    size = 264
    size += 4 if version > 1 else 0
    size += 4 + len(xml) if version > 2 else 0
    size += 4 + sum(4 + len(name) for name in names) if version > 3 else 0
    file.u32("struct_size", size)
    file.u32("version", version)
    for label, word in zip(("setup", "sensor", "light"), words, strict=True):
        file.put(label, word.ljust(80, b"\0")[:80])
    file.numbers("ppmm", np.array([ppmm]))
    file.numbers("rgb_scale", np.array(scale))
    if version > 1:
        file.u32("cosine", cosine)
    if version > 2:
        file.u32("xml_length", len(xml))
        file.put("xml", xml)
    if version > 3:
        file.u32("channels", len(names))
        for number, name in enumerate(names):
            file.u32(f"name_length{number}", len(name))
            file.put(f"name{number}", name)


def directions(file: File, true: Truth) -> None:
    file.u32("nV", len(true.views))
    for number, view in enumerate(true.views):
        file.numbers(f"view{number}", view)
        file.u32(f"nL{number}", len(true.lights))
        file.numbers(f"lights{number}", true.lights)


def layout(file: File, true: Truth, rotations: int | None, **knobs: object) -> None:
    description(file, **knobs)  # type: ignore[arg-type]
    directions(file, true)
    file.u32("width", WIDTH)
    file.u32("height", HEIGHT)
    if rotations is not None:
        turns(file, rotations)


def turns(file: File, rotations: int) -> None:
    file.u32("rotations", rotations)
    file.numbers("frames", np.tile(np.eye(3).ravel(), rotations))


def factors(file: File, left: np.ndarray, right: np.ndarray, scalar: int, tag: str = "") -> None:
    file.u32(f"K{tag}", left.shape[1])
    file.u32(f"rows{tag}", len(left))
    file.u32(f"columns{tag}", len(right))
    file.numbers(f"S{tag}", np.ones(left.shape[1]), scalar)
    file.numbers(f"U{tag}", left, scalar)
    file.numbers(f"SxV{tag}", right, scalar)


def dfmf(
    true: Truth | None = None,
    *,
    model: int = 0,
    scalar: int = 2,
    transposed: bool = False,
    rotations: int | None = 0,
    channels: int = 3,
    mean: tuple[float, ...] = (0.5, 0.25, 0.125),
    transform: np.ndarray | None = None,
    **knobs: object,
) -> tuple[File, np.ndarray]:
    """A DFMF file and the coded values (J, H, W, channels) it stands for."""
    true = true or truth()
    file = File()
    file.put("signature", b"!DFMF08FC" + (b"" if rotations is None else b"R"))
    layout(file, true, rotations, **knobs)
    file.u32("most", true.rank)
    file.put("model", struct.pack("<i", model), "u32")
    file.numbers("mean", np.array(mean))
    file.numbers("transform", np.eye(3) if transform is None else transform)
    images, texels = len(true.views) * len(true.lights), WIDTH * HEIGHT
    coded = np.empty((images, texels, channels))
    for channel in range(channels):
        left, right = true.matrix(images, texels, channel)
        coded[..., channel] = left @ right.T
        file.u8(f"scalar{channel}", scalar)
        pair = (right, left) if transposed else (left, right)
        factors(file, *pair, scalar, str(channel))
    return file, coded.reshape(images, HEIGHT, WIDTH, channels)


def fmf(
    true: Truth | None = None,
    *,
    extension: int | None = 2,
    reduced: int = 0,
    height_map: tuple[int, int] = (3, 2),
    scalar: int = 2,
    transposed: bool = False,
    rotations: int | None = 0,
    **knobs: object,
) -> tuple[File, np.ndarray]:
    """An FMF12 file (FMF06 without `extension`) and its values (J, H, W, 3) before logarithms."""
    true = true or truth()
    file = File()
    start = b"!FMF06FC" if extension is None else b"!FMF12FCE"
    file.put("signature", start + (b"" if rotations is None else b"R"))
    layout(file, true, rotations, **knobs)
    if extension is not None:
        file.u8("extension", extension)
        if extension >= 1:
            file.u32("reduced", reduced)
        if extension >= 2:
            file.u32("map_width", height_map[0])
            file.u32("map_height", height_map[1])
            file.numbers("map", np.ones(height_map[0] * height_map[1]), 2)
    images, texels = len(true.views) * len(true.lights), WIDTH * HEIGHT
    if transposed:
        left, right = true.matrix(3 * texels, images, 7)
        values = (left @ right.T).reshape(texels, 3, images).transpose(2, 0, 1)
    else:
        left, right = true.matrix(3 * images, texels, 7)
        values = (left @ right.T).reshape(images, 3, texels).transpose(0, 2, 1)
    file.u32("announced", true.rank)
    file.u8("scalar", scalar)
    factors(file, left, right, scalar)
    return file, values.reshape(images, HEIGHT, WIDTH, 3)


def pvf(
    true: Truth | None = None,
    *,
    old: bool = False,
    per_light: bool = False,
    scalar: int = 2,
    rotations: int | None = 0,
    **knobs: object,
) -> tuple[File, np.ndarray]:
    """A PVF file and its values (J, H, W, 3); with `per_light` its weights belong to lights."""
    true = true or truth()
    file = File()
    file.put("signature", b"!PVF06FC" + (b"" if rotations is None else b"R"))
    if old:
        file.u32("magic", 301074)
        file.u32("announced", true.rank)
        file.u32("width", WIDTH)
        file.u32("height", HEIGHT)
        file.u32("slots", len(true.views))
        directions(file, true)
    else:
        layout(file, true, rotations, **knobs)
        file.u32("announced", true.rank)
        file.u32("slots", len(true.views))
    lights, texels = len(true.lights), WIDTH * HEIGHT
    values = []
    for view in range(len(true.views)):
        axes, weights = true.matrix(
            3 * (texels if per_light else lights), lights if per_light else texels, 20 + view
        )
        mean = np.random.default_rng(view).integers(0, 64, len(axes)) / 16
        file.u8(f"scalar{view}", scalar)
        file.u32(f"K{view}", true.rank)
        file.u32(f"weights{view}", len(weights))
        file.u32(f"dimension{view}", len(axes))
        file.numbers(f"eigen{view}", np.ones(true.rank), scalar)
        file.numbers(f"mean{view}", mean, scalar)
        file.numbers(f"C{view}", axes, scalar)
        file.numbers(f"W{view}", weights, scalar)
        full = axes @ weights.T + mean[:, None]
        if per_light:
            values.append(full.reshape(texels, 3, lights).transpose(2, 0, 1))
        else:
            values.append(full.reshape(lights, 3, texels).transpose(0, 2, 1))
    return file, np.concatenate(values).reshape(-1, HEIGHT, WIDTH, 3)


def bdi(
    true: Truth | None = None,
    *,
    compression: int = 2,
    lines: int = 3,
    holes: bool = True,
    padded: bool = False,
    channels: int = 3,
    rotations: int = 0,
    **knobs: object,
) -> tuple[File, np.ndarray]:
    """A BDI file and its values (J, H, W, channels), 0 where its mask leaves texels out."""
    true = true or truth()
    file = File()
    file.put("signature", b"!BDIF06R2!")
    layout(file, true, None, **knobs)
    images, texels = len(true.views) * len(true.lights), WIDTH * HEIGHT
    draw = np.random.default_rng(true.seed)
    mask = np.ones(texels, np.uint8)
    if holes:
        mask[draw.permutation(texels)[: texels // 4]] = 0
    values = (draw.integers(0, 4096, (texels, images, channels)) / 256).astype(np.float16)
    file.u32("lines", lines)
    file.u8("compression", compression)
    file.put("mask", mask.tobytes())
    turns(file, rotations)
    stored = values[mask > 0] if compression == 2 else values
    step = WIDTH * lines
    for number, start in enumerate(range(0, len(stored), step)):
        part = stored[start : start + step]
        if padded and len(part) < step:
            part = np.concatenate([part, np.zeros((step - len(part), *part.shape[1:]), "f2")])
        file.u32(f"chunk_size{number}", part.size * 2)
        file.put(f"chunk{number}", part.tobytes(), "f2")
    if compression == 2:
        values = values * (mask > 0)[:, None, None]
    shaped = values.reshape(HEIGHT, WIDTH, images, channels).transpose(2, 0, 1, 3)
    return file, shaped.astype(np.float64)


def every() -> dict[str, Callable[[], tuple[File, np.ndarray]]]:
    """Makers of one file of each form."""
    return {
        "dfmf": lambda: dfmf(model=11),
        "dfmf transposed": lambda: dfmf(transposed=True, scalar=4, rotations=2),
        "dfmf double": lambda: dfmf(scalar=8, version=1, rotations=None),
        "fmf06": lambda: fmf(extension=None, version=2),
        "fmf06 short": lambda: fmf(extension=None, version=3, rotations=None),
        "fmf12": lambda: fmf(reduced=1),
        "fmf12 transposed": lambda: fmf(transposed=True, scalar=4, extension=1),
        "pvf": lambda: pvf(),
        "pvf per light": lambda: pvf(per_light=True, scalar=4, rotations=None),
        "pvf old": lambda: pvf(old=True, rotations=None),
        "bdi sparse": lambda: bdi(),
        "bdi full": lambda: bdi(compression=0, rotations=1, padded=True, lines=5),
    }
