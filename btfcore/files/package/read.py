"""Reads a sample package; images stay in the file and are mapped into memory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.sample import BtfFactors, BtfSample, Encoding, full_index
from btfcore.btf.stack import ArrayStack, ImageStack
from btfcore.errors import InvalidBtf
from btfcore.files.package.container import Member, check_sum, members, read_member
from btfcore.files.package.manifest import LARGEST_MANIFEST, Manifest, from_json
from btfcore.files.package.tensors import LARGEST_HEADER, Tensor, parse
from btfcore.types import F4, I4

KNOWN = ("manifest.json", "factors.safetensors", "images.safetensors", "preview.png")
LARGEST_PREVIEW = 16 << 20
LARGEST_FACTORS = 4 << 30


def is_package(path: Path) -> bool:
    """Whether a file looks like a sample package: a zip whose first member is its manifest."""
    try:
        with path.open("rb") as stream:
            head = stream.read(64)
    except OSError:
        return False
    return head[:4] == b"PK\3\4" and head[30:43] == b"manifest.json"


def read_package(path: str | Path) -> BtfSample:
    """Read a package (.btfz) as a sample.

    Factors are loaded, and compared with their checksum; images are mapped and read when
    asked for. Raises `InvalidBtf`, beginning with the file's name, for anything that does not
    fit: the zip, the manifest's schema, shapes that contradict it, values that are not finite.
    """
    path = Path(path)
    found = members(path)
    if "manifest.json" not in found:
        raise InvalidBtf(f"{path.name}: no manifest.json in it; this is no sample package")
    text = read_member(path, found["manifest.json"], most=LARGEST_MANIFEST)
    manifest, notes = from_json(text, path.name)
    extra = sorted(set(found) - set(KNOWN))
    if extra:
        notes += (f"ignored {len(extra)} unknown members, the first is {extra[0][:80]!r}",)
    tensors = _Tensors(path, found, manifest)
    return tensors.sample(notes)


def read_preview(path: str | Path) -> bytes | None:
    """PNG bytes of a package's preview, None where it has none; raises `InvalidBtf`."""
    path = Path(path)
    found = members(path)
    if "preview.png" not in found:
        return None
    return read_member(path, found["preview.png"], most=LARGEST_PREVIEW)


@dataclass(frozen=True)
class _Tensors:
    """The tensors of an open package, and what its manifest says that they must be."""

    path: Path
    found: dict[str, Member]
    manifest: Manifest

    def sample(self, notes: tuple[str, ...]) -> BtfSample:
        """Put the sample together."""
        manifest = self.manifest
        factors: BtfFactors | None = None
        stack: ImageStack
        if "factors.safetensors" in self.found:
            member, table, start = self._open("factors.safetensors")
            check_sum(self.path, member)
            factors = self._factors(table, start)
            stack = FactorStack(factors)
        elif "images.safetensors" in self.found:
            _, table, start = self._open("images.safetensors")
            stack = self._images(table, start)
        else:
            raise self._wrong("it has neither factors nor images")
        views, lights = manifest.directions()
        index = self._index(table, start, len(views), len(lights))
        mask = self._mask(table, start)
        try:
            return BtfSample(
                manifest.name,
                stack,
                views,
                lights,
                index,
                mask=mask,
                tiles=manifest.tiles,
                texel_size=manifest.texel_size_mm,
                cosine=manifest.cosine,
                licence=manifest.licence,
                citation=manifest.citation,
                origin=manifest.origin,
                notes=(*manifest.notes, *notes),
                factors=factors,
            )
        except InvalidBtf as error:
            raise self._wrong(str(error)) from None

    def _open(self, name: str) -> tuple[Member, dict[str, Tensor], int]:
        member = self.found[name]
        with self.path.open("rb") as stream:
            stream.seek(member.start)
            head = stream.read(min(member.size, LARGEST_HEADER + 8))
        table, start = parse(head, member.size, f"{self.path.name}: {name}")
        return member, table, member.start + start

    def _factors(self, table: dict[str, Tensor], start: int) -> BtfFactors:
        manifest = self.manifest
        if manifest.encoding is None:
            raise self._wrong("factors without an encoding in the manifest")
        if sum(tensor.size for tensor in table.values()) > LARGEST_FACTORS:
            raise self._wrong(f"factors of more than {LARGEST_FACTORS:,} bytes")
        code = manifest.encoding
        rank = table["singular"].shape[0] if "singular" in table else 0
        count = manifest.images
        weights = self._array(table, start, "weights", (manifest.height, manifest.width, rank))
        basis = self._array(table, start, "basis", (count, 3, rank))
        mean = self._array(table, start, "mean", (count, 3))
        singular = self._array(table, start, "singular", (rank,))
        return BtfFactors(
            weights.astype(np.float32),
            basis.astype(np.float32),
            mean.astype(np.float32),
            singular.astype(np.float64),
            Encoding(code.name, code.epsilon, code.knee),
            error=float("nan") if manifest.error is None else manifest.error,
        )

    def _images(self, table: dict[str, Tensor], start: int) -> ImageStack:
        manifest = self.manifest
        shape = (manifest.images, manifest.height, manifest.width, 3)
        images = self._mapped(table, start, "images", shape)
        scale: F4 | None = None
        if "scale" in table:
            scale = self._array(table, start, "scale", shape[:1]).astype(np.float32)
        return ArrayStack(images, scale=scale)

    def _index(self, table: dict[str, Tensor], start: int, views: int, lights: int) -> I4:
        if "index" in table:
            return self._array(table, start, "index", (views, lights)).astype(np.int32)
        if views * lights != self.manifest.images:
            raise self._wrong(
                f"{self.manifest.images} images for {views} views x {lights} lights, and no index"
            )
        return full_index(views, lights)

    def _mask(self, table: dict[str, Tensor], start: int) -> F4 | None:
        if "mask" not in table:
            return None
        shape = (self.manifest.height, self.manifest.width)
        values = self._array(table, start, "mask", shape)
        if values.dtype.kind == "u":
            return values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
        return values.astype(np.float32).clip(0, 1)

    def _array(
        self, table: dict[str, Tensor], start: int, name: str, shape: tuple[int, ...]
    ) -> NDArray[Any]:
        """Load a tensor of the shape that the manifest calls for; its values are finite."""
        values = np.array(self._mapped(table, start, name, shape))
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            wrong = int((~np.isfinite(values)).sum())
            raise self._wrong(f"{wrong} values of tensor {name!r} are not finite")
        return values

    def _mapped(
        self, table: dict[str, Tensor], start: int, name: str, shape: tuple[int, ...]
    ) -> NDArray[Any]:
        tensor = table.get(name)
        if tensor is None:
            raise self._wrong(f"tensor {name!r} is missing")
        if tensor.shape != shape or 0 in shape:
            raise self._wrong(f"tensor {name!r} has shape {tensor.shape}, not {shape}")
        return np.memmap(self.path, tensor.dtype, "r", start + tensor.start, shape)

    def _wrong(self, what: str) -> InvalidBtf:
        return InvalidBtf(f"{self.path.name}: {what}")
