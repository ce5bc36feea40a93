"""The only door to Pillow's decoders; runs in a guarded child, never in the program itself."""

from __future__ import annotations

import importlib
import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms, ImageOps, UnidentifiedImageError

from btfcore.errors import InvalidImage
from btfcore.guard import Arrays, Options

_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "PNG", "PngImagePlugin"),
    (b"\xff\xd8\xff", "JPEG", "JpegImagePlugin"),
    (b"II*\0", "TIFF", "TiffImagePlugin"),
    (b"MM\0*", "TIFF", "TiffImagePlugin"),
    (b"II+\0", "TIFF", "TiffImagePlugin"),
    (b"MM\0+", "TIFF", "TiffImagePlugin"),
    (b"BM", "BMP", "BmpImagePlugin"),
    (b"RIFF", "WEBP", "WebPImagePlugin"),
)
_MIDDLE = 128
_DEEP = ("I", "F", "I;16", "I;16L", "I;16B", "I;16N")


def decode(arrays: Arrays, options: Options) -> tuple[Arrays, Options]:
    """Guarded task: decode options["paths"] one by one.

    options: "most" pixels that are decoded at all, "working" pixels above which an image is
    reduced, "max_side" or None, "ground" or not: the value 0–255 that transparent parts are laid
    over, instead of mid-grey. Returns arrays "0", "1", … for the images that could be read,
    (H, W, 3) or grey (H, W), u1 or u2 or f4 in 0–1, and options["images"]: a dictionary per
    path with "notes" or "error".
    """
    warnings.simplefilter("ignore")
    Image.MAX_IMAGE_PIXELS = None  # checked against "most" before anything is decoded
    out: Arrays = {}
    entries: list[dict[str, Any]] = []
    for place, name in enumerate(options["paths"]):
        notes: list[str] = []
        try:
            out[str(place)] = _decode(Path(name), options, notes)
            entries.append({"notes": notes})
        except InvalidImage as error:
            entries.append({"error": str(error)})
        except MemoryError:
            raise
        except Exception as error:  # decoders meet broken files with any exception there is
            reason = f"{type(error).__name__}: {error}".replace("\n", " ")[:300]
            entries.append({"error": f"the image is broken or cut off ({reason})"})
    return out, {"images": entries}


def _decode(path: Path, options: Options, notes: list[str]) -> NDArray[Any]:
    image = _open(path, path.suffix)
    width, height = image.size
    if width * height > options["most"]:
        raise InvalidImage(
            f"{width:,} x {height:,} = {width * height:,} pixels; up to {options['most']:,}"
            " can be read"
        )
    pictures = getattr(image, "n_frames", 1)
    if pictures > 1:
        notes.append(f"took the first of {pictures} pictures")
        image.seek(0)
    profile = image.info.get("icc_profile")
    image.load()
    image = ImageOps.exif_transpose(image)
    if image.mode in _DEEP:
        return _shrunk_deep(_deep(image, notes), options, notes)
    image = _opaque(image, notes, options.get("ground", _MIDDLE))
    grey = image.mode in ("1", "L")
    image = _shrunk(image.convert("L") if image.mode == "1" else image, options, notes)
    if profile:
        image = _to_srgb(image, profile, notes)
    if grey:
        return np.asarray(image.convert("L"))
    return np.asarray(image.convert("RGB"))


def raw_picture(data: bytes, suffix: str, options: Options, notes: list[str]) -> NDArray[Any]:
    """Pixels as they are stored: (H, W, 3) or grey (H, W), u1, or u2 for deep grey images.

    options: "most" pixels, "icc": bring colours to sRGB by the image's own profile, "size":
    the only [width, height] that will do, or None. Palettes are resolved, alpha is left out,
    the camera's turn is undone. suffix : the file's ending, which tells TGA files, as they have
    no mark. Raises `InvalidImage`, or whatever Pillow makes of a broken file.
    """
    warnings.simplefilter("ignore")
    Image.MAX_IMAGE_PIXELS = None  # checked by `check_size` before anything is decoded
    image = _open(data, suffix)
    check_size(*image.size, options)
    profile = image.info.get("icc_profile") if options["icc"] else None
    image.load()
    image = ImageOps.exif_transpose(image)
    if image.mode in _DEEP:
        values = np.asarray(image)
        if image.mode == "F":
            return values
        if values.size and not 0 <= int(values.min()) <= int(values.max()) <= 65535:
            raise InvalidImage(f"its values reach from {values.min()} to {values.max()}")
        return values.astype(np.uint16)
    if image.mode in ("P", "PA"):
        image = image.convert("RGB")
    if image.mode in ("RGBA", "LA", "RGBa", "La"):
        notes.append("left out its alpha channel")
        image = image.convert("RGB" if image.mode.startswith("RGB") else "L")
    if image.mode in ("1", "L") and not profile:
        return np.asarray(image.convert("L"))
    return np.asarray((_to_srgb(image, profile, notes) if profile else image).convert("RGB"))


def check_size(width: int, height: int, options: Options) -> None:
    """Refuse what an image's header announces: too many pixels, or not the one size that fits."""
    if width < 1 or height < 1 or width * height > options["most"]:
        raise InvalidImage(
            f"{width:,} x {height:,} = {width * height:,} pixels; 1 to {options['most']:,}"
            " can be read from a file of its kind and size"
        )
    wanted = options["size"]
    if wanted is not None and sorted((width, height)) != sorted(wanted):
        raise InvalidImage(
            f"its size is {width} x {height}, that of the first image {wanted[0]} x {wanted[1]}"
        )


def _open(source: Path | bytes, suffix: str) -> Image.Image:
    """Open with the one decoder that the first bytes, or a .tga ending, call for."""
    if isinstance(source, Path):
        with source.open("rb") as stream:
            head = stream.read(32)
    else:
        head = source[:32]
    kind = next(((form, plugin) for magic, form, plugin in _MAGIC if head.startswith(magic)), None)
    if kind is None and suffix.lower() == ".tga":
        kind = ("TGA", "TgaImagePlugin")
    if kind is None:
        raise InvalidImage(
            f"this is no PNG, JPEG, TIFF, BMP, WebP or TGA image: it begins with {head[:8]!r}"
        )
    importlib.import_module(f"PIL.{kind[1]}")
    try:
        return Image.open(
            source if isinstance(source, Path) else io.BytesIO(source), formats=[kind[0]]
        )
    except UnidentifiedImageError as error:
        raise InvalidImage(f"its {kind[0]} header makes no sense") from error


def _opaque(image: Image.Image, notes: list[str], value: int) -> Image.Image:
    """Resolve palettes, and lay transparent parts over the grey `value`."""
    if image.mode in ("P", "PA"):
        image = image.convert("RGBA" if "transparency" in image.info else "RGB")
    elif "transparency" in image.info and image.mode in ("1", "L", "RGB"):
        image = image.convert("LA" if image.mode == "L" else "RGBA")
    if image.mode in ("RGBa", "La"):
        image = image.convert("RGBA" if image.mode == "RGBa" else "LA")
    if image.mode not in ("RGBA", "LA"):
        return image
    alpha = image.getchannel("A")
    plain = image.convert("RGB" if image.mode == "RGBA" else "L")
    if alpha.getextrema()[0] == 255:
        notes.append("ignored its alpha channel, which is opaque everywhere")
        return plain
    named = "mid-grey" if value == _MIDDLE else f"the grey {value}"
    notes.append(f"laid its transparent parts over {named}")
    ground = Image.new(plain.mode, plain.size, (value,) * len(plain.getbands()))
    return Image.composite(plain, ground, alpha)


def _deep(image: Image.Image, notes: list[str]) -> NDArray[Any]:
    """Grey values of more than 8 bits, as u2 or as f4 in 0–1."""
    values = np.asarray(image)
    if image.mode not in ("I", "F"):
        return values.astype(np.uint16)
    if not np.isfinite(values).all():
        raise InvalidImage(f"{int((~np.isfinite(values)).sum())} of its pixels are not finite")
    low, high = float(values.min()), float(values.max())
    full = 65535.0 if image.mode == "I" and high > 255 else 255.0 if image.mode == "I" else 1.0
    if low < 0 or high > full:
        notes.append(f"stretched its values {low:g} … {high:g} to black … white")
        low, full = min(low, 0.0), max(high, full)
        return ((values - low) / (full - low)).astype(np.float32).clip(0, 1)
    return (values / full).astype(np.float32).clip(0, 1)


def _target(width: int, height: int, options: Options) -> tuple[int, int]:
    """Size to work at: within the pixel budget and the longest side, at least 1 x 1."""
    factor = min(1.0, (options["working"] / (width * height)) ** 0.5)
    if options["max_side"] is not None:
        factor = min(factor, options["max_side"] / max(width, height))
    return max(1, int(width * factor)), max(1, int(height * factor))


def _shrunk(image: Image.Image, options: Options, notes: list[str]) -> Image.Image:
    size = _target(*image.size, options)
    if size == image.size:
        return image
    notes.append(f"reduced from {image.width} x {image.height} to {size[0]} x {size[1]} pixels")
    return image.resize(size, Image.Resampling.BOX)


def _shrunk_deep(values: NDArray[Any], options: Options, notes: list[str]) -> NDArray[Any]:
    size = _target(values.shape[1], values.shape[0], options)
    if size == values.shape[::-1]:
        return values
    scale = 65535 if values.dtype == np.uint16 else 1
    image = Image.fromarray(values.astype(np.float32) / np.float32(scale))
    return np.asarray(_shrunk(image, options, notes)).clip(0, 1)


def _to_srgb(image: Image.Image, profile: bytes, notes: list[str]) -> Image.Image:
    """Convert from the image's own colour profile; a profile that does not fit is ignored."""
    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        converted = ImageCms.profileToProfile(
            image, source, ImageCms.createProfile("sRGB"), outputMode="RGB"
        )
    except (ImageCms.PyCMSError, OSError, ValueError) as error:
        notes.append(f"ignored its colour profile, which does not fit: {error}")
        return image
    return image if converted is None else converted
