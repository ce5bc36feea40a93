"""What the Bonn formats share: signature, description of the measurement, directions, size.

Everything is little-endian and packed. Nothing here was held against a file from Bonn, none
being at hand; the layout is that of their own reader, btflib.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from btfcore.btf.bonn.cursor import Cursor
from btfcore.errors import InvalidBtf
from btfcore.types import F8, Frozen

SIGNATURES = {
    b"!DFMF08FC": "DFMF",
    b"!FMF12FCE": "FMF12",
    b"!FMF06FC": "FMF06",
    b"!PVF06FC": "PVF",
    b"!BDIF06R2!": "BDI",
}
OLD_PVF = 301074  # stands where the others have the size of the description
MOST_DIRECTIONS = 1 << 14
MOST_PAIRS = 1 << 22
MOST_SIDE = 1 << 16
MOST_TEXELS = 1 << 28
_MOST_TURNS = 100.0  # radians; an azimuth beyond is no azimuth
_HORIZON = 1e-4  # what may lie below it, as BtfSample has it
_SAME = 1e-5  # radians, likewise
_LISTS_AGREE = 1e-4  # between the same lights in the lists of two views
_WAVELENGTH = re.compile(r"\d+(\.\d+)?( ?nm)?")


@dataclass(frozen=True)
class Description:
    """The measurement's description; channels: numbers a texel has in an image, 1 or 3.

    cosine : the light's cosine is in the values. texel_size : millimetres, or None.
    """

    channels: int = 3
    cosine: bool = False
    texel_size: float | None = None
    words: tuple[str, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class Layout(Frozen):
    """What is known before the values: directions (V, 3) and (L, 3) f8, rows, columns."""

    description: Description
    views: F8
    lights: F8
    height: int
    width: int
    notes: tuple[str, ...] = field(default=())

    @property
    def images(self) -> int:
        """Number of pairs of a view and a light."""
        return len(self.views) * len(self.lights)

    @property
    def texels(self) -> int:
        """Number of texels of an image."""
        return self.height * self.width


def kind_of(head: bytes) -> str | None:
    """Return which of the formats `SIGNATURES` begins with `head`, None for another file."""
    for signature, kind in SIGNATURES.items():
        if head.startswith(signature):
            return kind
    return None


def read_start(cursor: Cursor) -> tuple[Description | None, bool]:
    """Read signature and description; the latter is None for PVF files of the old layout.

    Returns also whether rotations follow the size. The signature's last letter R, which
    announces them, may just as well be the first byte of the description; so what follows
    is tried both ways and the one that adds up is taken, with R first.
    """
    head = bytes(cursor.data[:16])
    signature = next(word for word in SIGNATURES if head.startswith(word))
    starts = [(len(signature), False)]
    if head[len(signature) : len(signature) + 1] == b"R":
        starts.insert(0, (len(signature) + 1, True))
    first: InvalidBtf | None = None
    for start, rotations in starts:
        cursor.position = start
        try:
            return read_description(cursor), rotations
        except InvalidBtf as error:
            first = first or error
        if SIGNATURES[signature] == "PVF":
            cursor.position = start
            if cursor.left >= 4 and cursor.i32("magic number") == OLD_PVF:
                return None, rotations
    assert first is not None
    raise first


def read_description(cursor: Cursor) -> Description:
    """Read the block that tells its own size, which must be right."""
    begin = cursor.position
    size = cursor.u32("size of the description")
    version = cursor.u32("version of the description")
    if not 1 <= version <= 4:
        raise cursor.wrong(
            f"version of the description at byte {begin + 4:,} is {version:,}, but 1 to 4 are known"
        )
    words = tuple(cursor.text(what, 80) for what in ("setup", "image sensor", "light source"))
    ppmm = float(cursor.floats("pixels per mm", 1)[0])
    scale = cursor.floats("RGB scale", 3)
    notes = []
    if version > 1:
        cosine = cursor.u32("cosine flag") != 0
    else:
        cosine = False
        notes.append("the file is too old to say whether the light's cosine is in its values")
    if version > 2:
        cursor.need("measurement XML", cursor.u32("length of the measurement XML"))
    channels = _channels(cursor, notes) if version > 3 else 3
    if cursor.position != begin + size:
        raise cursor.wrong(
            f"size of the description at byte {begin:,} is {size:,}, but its fields take"
            f" {cursor.position - begin:,} bytes"
        )
    texel = None
    if 1e-4 < ppmm < 1e6:
        texel = 1 / ppmm
    else:
        notes.append(f"{ppmm:g} pixels per mm in the file: the texel's size is unknown")
    if not np.array_equal(scale, np.ones(3)) and scale.any():
        # Bonn's own reader hands the factors on without applying them, and so do we.
        notes.append("RGB scale {:g}, {:g}, {:g} in the file, not applied".format(*scale))
    return Description(channels, cosine, texel, words, tuple(notes))


def _channels(cursor: Cursor, notes: list[str]) -> int:
    at, count = cursor.position, cursor.u32("number of channels")
    if count not in (1, 3):
        raise cursor.wrong(
            f"number of channels at byte {at:,} is {count:,}, but only RGB (3) and grey (1)"
            " samples can be read"
        )
    names = []
    for number in range(count):
        length = cursor.u32(f"length of channel name {number}")
        names.append(cursor.text(f"channel name {number}", length)[:20])
    if all(_WAVELENGTH.fullmatch(name) for name in names):
        raise cursor.wrong(
            f"the channels at byte {at:,} are the wavelengths {', '.join(names)}, but spectral"
            " samples cannot be read"
        )
    if count == 3 and [name.upper() for name in names] not in (["R", "G", "B"], ["", "", ""]):
        notes.append(f"channels named {', '.join(names)}, taken as red, green and blue")
    return count


def read_directions(cursor: Cursor) -> tuple[F8, F8]:
    """Read views (V, 3) and lights (L, 3) f8, unit vectors.

    Angles are polar angle and azimuth in radians. Each view has a list of its own of the
    lights; they must agree.
    """
    count = cursor.count("number of views", MOST_DIRECTIONS)
    angles = np.empty((count, 2))
    lights = np.empty((0, 3))
    for view in range(count):
        angles[view] = cursor.floats(f"angles of view {view}", 2)
        at = cursor.position
        number = cursor.count(f"number of lights of view {view}", MOST_DIRECTIONS)
        if view and number != len(lights):
            raise cursor.wrong(
                f"number of lights of view {view} at byte {at:,} is {number:,}, but view 0 has"
                f" {len(lights):,}"
            )
        if count * number > MOST_PAIRS:
            raise cursor.wrong(
                f"{count:,} views times {number:,} lights at byte {at:,} are more than the"
                f" {MOST_PAIRS:,} images that can be read"
            )
        at = cursor.position
        listed = cursor.floats(f"lights of view {view}", 2 * number).reshape(number, 2)
        if view == 0:
            first = listed
            lights = _vectors(cursor, "light", listed)
            _check_repeats(cursor, "light", lights)
        elif not np.array_equal(listed, first):
            _check_agrees(cursor, view, at, listed, lights)
    views = _vectors(cursor, "view", angles)
    _check_repeats(cursor, "view", views)
    return views, lights


def read_size(cursor: Cursor) -> tuple[int, int]:
    """Rows and columns of the images, stored the other way round."""
    at = cursor.position
    width = cursor.count("width", MOST_SIDE)
    height = cursor.count("height", MOST_SIDE)
    if width * height > MOST_TEXELS:
        raise cursor.wrong(
            f"width and height at byte {at:,} are {width:,} x {height:,}, but at most"
            f" {MOST_TEXELS:,} texels can be read"
        )
    return height, width


def skip_rotations(cursor: Cursor) -> tuple[str, ...]:
    """Skip the local frames; returns a note where there are some."""
    count = cursor.u32("number of rotations")
    cursor.need("rotations of local frames", count * 36)
    return (f"rotations of local frames in the file ({count:,}), not applied",) if count else ()


def _check_agrees(cursor: Cursor, view: int, at: int, listed: F8, lights: F8) -> None:
    # The same direction may be told with other angles: azimuths by 360 degrees, or at the pole.
    apart = np.linalg.norm(_vectors(cursor, f"view {view}'s light", listed) - lights, axis=1)
    wrong = np.flatnonzero(apart > _LISTS_AGREE)
    if len(wrong):
        raise cursor.wrong(
            f"the lights of view {view} at byte {at:,} differ from those of view 0 in"
            f" {len(wrong):,} places, first in light {wrong[0]}"
        )


def _vectors(cursor: Cursor, kind: str, angles: F8) -> F8:
    """Unit vectors (n, 3) of polar angles and azimuths (n, 2)."""
    theta, phi = angles.T
    right = (np.abs(theta) <= np.pi / 2 + _HORIZON) & (np.abs(phi) <= _MOST_TURNS)
    if not right.all():  # also where an angle is NaN
        number = int(np.flatnonzero(~right)[0])
        raise cursor.wrong(
            f"{kind} {number} has the polar angle {theta[number]:g} and the azimuth"
            f" {phi[number]:g} radians, but directions above the horizon are needed"
        )
    flat = np.sin(theta)
    return np.stack([flat * np.cos(phi), flat * np.sin(phi), np.cos(theta)], axis=1)


def _check_repeats(cursor: Cursor, kind: str, vectors: F8) -> None:
    """Refuse equal directions; a file may hold many thousands of them, so pair by pair is out."""
    from scipy.spatial import cKDTree

    distinct = len(np.unique(vectors, axis=0))
    if distinct < len(vectors):
        raise cursor.wrong(
            f"{len(vectors):,} {kind}s, but only {distinct:,} different ones: directions are"
            " repeated"
        )
    if len(vectors) > 1:
        near, other = cKDTree(vectors).query(vectors, k=2, distance_upper_bound=_SAME)
        close = np.flatnonzero(np.isfinite(np.asarray(near)[:, 1]))
        if len(close):
            one, two = sorted((int(close[0]), int(np.asarray(other)[close[0], 1])))
            raise cursor.wrong(f"{kind}s {one} and {two} are the same direction")
