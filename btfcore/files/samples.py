"""One door to every kind of sample: what a path holds is found out, and read as a BTF."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from btfcore.btf.pbr import PbrSet
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf, InvalidParameter
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
    one); PTM files and folders; PBR texture sets (folder or zip), which are baked at `layout`
    (`btfcore.btf.directions.layout`, or a file of directions) and at most `size` texels a
    side; and single images, which are BTFs of one view and one light. The kind is told by
    content and names, see `kind_of`.

    Raises `InvalidBtf`, `InvalidImage`, `GuardedFailure` or `InvalidParameter`; messages begin
    with the file's name.
    """
    path = Path(path)
    kind = kind_of(path)
    if kind == "package":
        from btfcore.files.package.read import read_package

        return read_package(path)
    if kind == "bonn":
        from btfcore.btf.bonn.reader import read_bonn

        return read_bonn(path)
    if kind == "ptm":
        from btfcore.btf.readers.ptm import read_ptm

        return read_ptm(path)
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

    The maps are read at up to 512 texels first, and the depth of the relief is fitted there:
    small maps tell less about it. Raises `InvalidParameter` for a size out of 1 … 8192.
    """
    from btfcore.btf.bake.maps import resized
    from btfcore.btf.readers.pbr_files import read_pbr

    size = DEFAULT_SIZE if size is None else size
    if not 1 <= size <= LARGEST_SIZE:
        raise InvalidParameter(f"a size of {size} texels, outside 1 … {LARGEST_SIZE}")
    found = read_pbr(Path(path), size=max(size, FITTING_SIZE))
    return found if max(found.shape) <= size else resized(found, size)


def directions_of(layout: str | Path) -> tuple[F8, F8]:
    """Views and lights of a layout's name or of a file of directions."""
    from btfcore.btf.directions import layout as named
    from btfcore.btf.directions import read_layout

    text = str(layout)
    found = read_layout(text) if Path(text).suffix or Path(text).is_file() else named(text)
    return found.views, found.lights


def kind_of(path: Path) -> str:
    """Return the kind of sample that `path` holds.

    One of "package", "bonn", "ptm", "named", "table", "pbr" and "image". Raises `InvalidBtf`
    where there is nothing, or a folder or zip that holds no sample.
    """
    try:
        if not path.exists():
            raise InvalidBtf(f"{path.name}: there is no such file or folder in {path.parent}")
        head = b"" if path.is_dir() else _head(path)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise InvalidBtf(f"{path.name!r}: cannot be opened: {error}") from error
    from btfcore.btf.readers.bonn_names import looks_like_named_images
    from btfcore.btf.readers.pbr_files import looks_like_pbr
    from btfcore.btf.readers.ptm import looks_like_ptm
    from btfcore.btf.readers.table import looks_like_table

    if head[:1] == b"!":
        from btfcore.btf.bonn.reader import is_bonn

        if is_bonn(head):
            return "bonn"
    if looks_like_ptm(path):
        return "ptm"
    if path.is_dir() or head[:4] in (b"PK\3\4", b"PK\5\6") or path.suffix.lower() == ".zip":
        return _container(path, looks_like_named_images, looks_like_table, looks_like_pbr)
    if looks_like_table(path):
        return "table"
    return "image"


def _container(
    path: Path,
    named: Callable[[Path], bool],
    table: Callable[[Path], bool],
    pbr: Callable[[Path], bool],
) -> str:
    """Kind of a folder or zip."""
    from btfcore.files.package.read import is_package

    if not path.is_dir() and (path.suffix.lower() == ".btfz" or is_package(path)):
        return "package"
    for kind, test in (("named", named), ("table", table), ("pbr", pbr)):
        if test(path):
            return kind
    what = "folder" if path.is_dir() else "zip"
    raise InvalidBtf(
        f"{path.name}: the {what} holds no sample: no images named by their angles"
        " (tl… pl… tv… pv…), no table of directions (.lp, .csv), and no albedo or colour map"
        " of a PBR set"
    )


def _head(path: Path) -> bytes:
    if not path.is_file():
        raise InvalidBtf(f"{path.name}: this is no regular file")
    with path.open("rb") as stream:
        head = stream.read(64)
    if not head:
        raise InvalidBtf(f"{path.name}: the file is empty (0 bytes)")
    if head.startswith(b"version https://git-lfs"):
        raise InvalidBtf(
            f"{path.name}: this is a Git LFS pointer, not the sample itself: run `git lfs pull`"
        )
    return head


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
