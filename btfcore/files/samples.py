"""One door to every kind of sample: what a path holds is found out, and read as a BTF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidParameter
from btfcore.progress import Progress, silent
from btfcore.types import F8

DEFAULT_LAYOUT = "ubo81"
DEFAULT_SIZE = 128
FITTING_SIZE = 512
LARGEST_SIZE = 8192
WRITABLE = (".btfz", ".zip", ".btf")


def open_sample(
    path: str | Path,
    *,
    layout: str | Path = DEFAULT_LAYOUT,
    size: int | None = None,
    progress: Progress = silent,
) -> BtfSample:
    """Open a sample of any kind; images are read or made only when they are asked for.

    Our packages (.btfz); Bonn binaries (DFMF, FMF, PVF, BDI); folders and zips of images with
    Bonn names; image folders with a directions table (.lp, .csv, or the folder that holds
    one); PTM files and folders, evaluated under the lights of `layout`
    (`btfcore.btf.directions.layout`, or a file of directions); PBR texture sets (folder or
    zip), which are baked at `layout` and at most `size` texels a side; and single images,
    which are BTFs of one view and one light. The kind is told by content and names, see
    `btfcore.files.sample_kind.find_sample`.

    Raises `InvalidBtf`, `InvalidImage`, `GuardedFailure` or `InvalidParameter`; messages begin
    with the file's name.
    """
    from btfcore.files.sample_kind import find_sample

    found = find_sample(Path(path))
    kind, path = found.kind, found.path
    if kind == "package":
        from btfcore.files.package.read import read_package

        return read_package(path)
    if kind == "bonn":
        from btfcore.btf.bonn.reader import read_bonn

        return read_bonn(path)
    if kind == "ptm":
        from btfcore.btf.readers.ptm import read_ptm

        return read_ptm(path, lights=directions_of(layout)[1])
    if kind == "named":
        from btfcore.btf.readers.bonn_names import read_named_images

        return read_named_images(path)
    if kind == "table":
        from btfcore.btf.readers.table import read_table

        return read_table(path)
    if kind == "pbr":
        return open_pbr(path, layout=layout, size=size)
    from btfcore.btf.readers.picture import read_picture

    return read_picture(path, progress=progress)


def open_pbr(
    path: str | Path, *, layout: str | Path = DEFAULT_LAYOUT, size: int | None = None
) -> BtfSample:
    """Open a PBR texture set as a BTF that is baked when its images are asked for."""
    from btfcore.btf.bake.build import baked

    views, lights = directions_of(layout)
    return baked(read_pbr_sized(path, size), views, lights)


def read_pbr_sized(path: str | Path, size: int | None = None) -> PbrSet:
    """Read a PBR set, its longer edge reduced to `size` texels (128 unless told).

    path : a folder, a zip, or one of the maps, which tells which set of its folder is meant; a
    lone image is taken as the albedo map of a flat material. The maps are read at up to 512
    texels first, and the depth of the relief is fitted there: small maps tell less about it.
    Raises `InvalidParameter` for a size out of 1 … 8192.
    """
    from btfcore.btf.bake.maps import resized

    size = DEFAULT_SIZE if size is None else size
    if not 1 <= size <= LARGEST_SIZE:
        raise InvalidParameter(f"a size of {size} texels, outside 1 … {LARGEST_SIZE}")
    found = _read_maps(Path(path), max(size, FITTING_SIZE))
    return found if max(found.shape) <= size else resized(found, size)


def _read_maps(path: Path, size: int) -> PbrSet:
    from btfcore.btf.readers.decode import IMAGES
    from btfcore.btf.readers.entries import Entry
    from btfcore.btf.readers.listing import list_files
    from btfcore.btf.readers.pbr_files import read_pbr
    from btfcore.btf.readers.pbr_names import grouped, named

    single = path.suffix.lower() in IMAGES and path.is_file()
    folder = path.absolute().parent if single else path
    if single or path.is_dir():
        images = list_files(folder).ending(*IMAGES)
        if single:
            group = named(Entry(path.name, 0)).group
            if group in grouped([image for image in images if "/" not in image.name]):
                return read_pbr(folder, size=size, name=group)
            return _flat_set(path, size)
        if len(images) == 1:
            return _flat_set(path / images[0].name, size)
    return read_pbr(path, size=size)


def _flat_set(path: Path, size: int) -> PbrSet:
    """Take one image as the albedo of a flat material."""
    from btfcore.btf.bake.maps import resized
    from btfcore.btf.readers.picture import read_picture

    picture = read_picture(path)
    notes = (*picture.notes, "one map alone was taken as the albedo of a flat material")
    albedo = np.clip(picture.image(0, 0), 0, 1)
    found = PbrSet(picture.name, albedo, tiles=False, origin=path.name, notes=notes)
    return found if max(found.shape) <= size else resized(found, size)


def directions_of(layout: str | Path) -> tuple[F8, F8]:
    """Views and lights of a layout's name or of a file of directions."""
    from btfcore.btf.directions import layout as named
    from btfcore.btf.directions import read_layout

    text = str(layout)
    found = read_layout(text) if Path(text).suffix or Path(text).is_file() else named(text)
    return found.views, found.lights


def kind_of(path: Path) -> str:
    """Return the kind of sample that `path` holds, see `btfcore.files.sample_kind.find_sample`.

    One of "package", "bonn", "ptm", "named", "table", "pbr" and "image".
    """
    from btfcore.files.sample_kind import find_sample

    return find_sample(path).kind


def check_sample_output(path: Path) -> None:
    """Refuse at once a name that `save_sample` cannot write."""
    from btfcore.files.atomic import check_writable

    if path.suffix.lower() not in WRITABLE:
        raise InvalidParameter(
            f"{path.name}: a sample is written as {', '.join(WRITABLE)}: Patina's package, a zip"
            " of images with Bonn names, or a Bonn DFMF file"
        )
    check_writable(path)


def save_sample(
    path: str | Path,
    sample: BtfSample,
    *,
    components: int = 100,
    image_kind: str = "exr",
    progress: Progress = silent,
) -> tuple[str, ...]:
    """Write a sample by its suffix and return notes fit for a user.

    .btfz: our package, with the factors where the sample has some, else with its images;
    .zip: images with Bonn names as `image_kind` ("exr", "png" or "jpeg"); .btf: DFMF with
    `components` a channel. Raises `InvalidParameter`, `OutputFailed`, and what reading raises.
    """
    path = Path(path)
    check_sample_output(path)
    suffix = path.suffix.lower()
    if suffix == ".btfz":
        from btfcore.files.package.write import write_package

        write_package(path, sample, preview=thumbnail(sample), progress=progress)
        return ()
    if suffix == ".zip":
        from btfcore.files.bonn_zip import write_bonn_zip

        return tuple(write_bonn_zip(path, sample, kind=image_kind, progress=progress))
    from btfcore.files.bonn_dfmf import write_dfmf

    write_dfmf(path, sample, components=components, progress=progress)
    return ()


def thumbnail(sample: BtfSample, *, side: int = 256) -> NDArray[np.uint8]:
    """Return a small sRGB picture (h, w, 3) u8 of the sample seen from above, lit obliquely."""
    from btfcore.btf.appearance import frontal_colours

    colours = frontal_colours(sample)
    step = max(1, -(-max(colours.shape[:2]) // side))
    height, width = (colours.shape[0] // step * step, colours.shape[1] // step * step)
    small = colours[:height, :width]
    if min(height, width) and step > 1:
        small = small.reshape(height // step, step, width // step, step, 3).mean(axis=(1, 3))
    return np.round(np.ascontiguousarray(small) * 255).astype(np.uint8)
