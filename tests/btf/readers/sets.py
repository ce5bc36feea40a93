"""Small image sets to read: folders and zips with names of several labs."""

import io
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

from btfcore.files.exr import encode_exr, encode_hdr

UBO = "tv{tv:03d}_pv{pv:03d}/{n:05d} tl{tl:03d} pl{pl:03d} tv{tv:03d} pv{pv:03d}"
UTIA = "tv{tv:03d}_pv{pv:03d}/tl{tl:03d}_pl{pl:03d}_tv{tv:03d}_pv{pv:03d}"
RINGS = [(0, 0), (30, 0), (30, 120), (30, 240), (75, 0), (75, 180)]


def png(values):
    """PNG of an (H, W[, 3]) u1 or grey u2 image."""
    stream = io.BytesIO()
    Image.fromarray(values).save(stream, "PNG")
    return stream.getvalue()


def picture(number, size=(6, 8)):
    """u1 image that tells its number: (number, row, column)."""
    rows, columns = np.mgrid[: size[0], : size[1]]
    return np.stack([np.full(size, number), rows, columns], axis=2).astype(np.uint8)


def encoded(number, suffix):
    """Image `number` as a file: its values are those of `picture`, or its 1/50 as radiance."""
    values = picture(number)
    if suffix == ".png":
        return png(values)
    if suffix in (".jpg", ".jpeg"):
        stream = io.BytesIO()
        Image.fromarray(np.full((6, 8, 3), number, np.uint8)).save(stream, "JPEG", quality=100)
        return stream.getvalue()
    radiance = values.astype(np.float32) / 50
    return encode_exr(radiance) if suffix == ".exr" else encode_hdr(radiance)


def named(pattern, suffix, views=RINGS, lights=RINGS):
    """Files of every view and light, as a dictionary from names to bytes; numbered in order."""
    files = {}
    for n, (view, light) in enumerate((view, light) for view in views for light in lights):
        name = pattern.format(n=n, tv=view[0], pv=view[1], tl=light[0], pl=light[1])
        files[name + suffix] = encoded(n, suffix)
    return files


def to_folder(folder: Path, files):
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return folder


def to_zip(path: Path, files, compression=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path
