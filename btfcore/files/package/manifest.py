"""The manifest of a sample package: a versioned schema, checked before anything is believed."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from btfcore.errors import InvalidBtf

FORMAT = "patina-btf-sample"
VERSION = 1
LARGEST_MANIFEST = 8 << 20
MOST_DIRECTIONS = 1 << 14
CONVENTIONS = (
    "Row 0 is on top. Directions are unit vectors away from the surface in the frame s = +column,"
    " t = -row, n = normal. Radiance is linear Rec. 709, HDR. Tensors are safetensors, stored"
    " uncompressed. View v under light l is image index[v, l] (-1: there is none), or without that"
    " tensor v * (number of lights) + l. An image is images[image, row, column, colour], times"
    " scale[image] where there is that tensor; or, factorised, decode(sum over k of"
    " weights[row, column, k] * basis[image, colour, k] + mean[image, colour]). decode undoes the"
    " encoding of this manifest, e being its epsilon and c a code: linear: x = max(c, 0); sqrt:"
    " x = max(c, 0)^2; log: x = max(exp(c) - e, 0); logluma: the three codes are log Y, R / Y and"
    " B / Y, where Y = 0.2126 R + 0.7152 G + 0.0722 B, and the colours x are R - e, G - e and"
    " B - e, at least 0. Then, where there is a knee k, any x > k becomes k * exp(x / k - 1)."
    " mask: the feature, 65535 where it is whole."
)


def _written(value: Any) -> Any:
    """Replace halves of characters, which names of files may have and no text file holds."""
    return value.encode("utf-8", "replace").decode() if isinstance(value, str) else value


Text = Annotated[str, BeforeValidator(_written), Field(max_length=4096)]
_Count = Annotated[int, Field(ge=1, le=1 << 31)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Direction = Annotated[list[_Finite], Field(min_length=3, max_length=3)]
_Directions = Annotated[list[_Direction], Field(min_length=1, max_length=MOST_DIRECTIONS)]


class EncodingEntry(BaseModel):
    """How radiance was coded before factorising."""

    model_config = ConfigDict(strict=True, extra="ignore")

    name: Literal["linear", "sqrt", "log", "logluma"]
    epsilon: Annotated[float, Field(gt=0, lt=1e6)]
    knee: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None


class Manifest(BaseModel):
    """Everything about a sample but its tensors."""

    model_config = ConfigDict(strict=True, extra="ignore")

    format: Literal["patina-btf-sample"]
    version: Annotated[int, Field(ge=1)]
    name: Text
    width: _Count
    height: _Count
    images: _Count
    views: _Directions
    lights: _Directions
    tiles: bool = False
    texel_size_mm: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    cosine: bool = True
    licence: Text = ""
    citation: Text = ""
    origin: Text = ""
    notes: Annotated[list[Text], Field(max_length=1000)] = []
    encoding: EncodingEntry | None = None
    error: _Finite | None = None
    conventions: Text = CONVENTIONS

    def directions(self) -> tuple[Any, Any]:
        """Views (V, 3) and lights (L, 3) f8."""
        return np.array(self.views, np.float64), np.array(self.lights, np.float64)


def to_json(manifest: Manifest) -> bytes:
    """Return the manifest as indented JSON."""
    return json.dumps(manifest.model_dump(), indent=1, allow_nan=False).encode()


def from_json(text: bytes, where: str) -> tuple[Manifest, tuple[str, ...]]:
    """Read a manifest, and notes about keys that this version does not know.

    Raises `InvalidBtf`, beginning with `where`, for anything that does not fit the schema.
    """
    try:
        value = json.loads(text.decode("utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InvalidBtf(f"{where}: its manifest is no JSON: {error}") from None
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise InvalidBtf(f"{where}: its manifest does not say that it is a {FORMAT}")
    version = value.get("version")
    if isinstance(version, int) and version > VERSION:
        raise InvalidBtf(
            f"{where}: version {version} of the package format is newer than {VERSION}, the"
            " newest that this Patina reads"
        )
    try:
        manifest = Manifest.model_validate(value)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InvalidBtf(f"{where}: manifest field {place}: {first['msg']}") from None
    unknown = sorted(set(value) - set(Manifest.model_fields))
    notes = (f"ignored unknown manifest fields: {', '.join(unknown)[:200]}",) if unknown else ()
    return manifest, notes
