"""What a BTF looks like as one picture, and what the quilting compares it by."""

from __future__ import annotations

import numpy as np

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.sample import BtfSample
from btfcore.errors import InvalidBtf
from btfcore.progress import Progress, silent
from btfcore.types import F4, F8, Sample

# Light for pictures: from the upper left, 40 degrees off the normal.
_THETA, _PHI = np.radians(40), np.radians(135)
OBLIQUE = np.array([np.sin(_THETA) * np.cos(_PHI), np.sin(_THETA) * np.sin(_PHI), np.cos(_THETA)])


def nearest_pair(sample: BtfSample, view: F8, light: F8) -> tuple[int, int]:
    """View and light of the image nearest to a pair of directions (3,), missing ones left out."""
    near = np.arccos(np.clip(sample.views @ view, -1, 1))[:, None]
    lit = np.arccos(np.clip(sample.lights @ light, -1, 1))[None, :]
    # the view decides first: a picture from aside is no picture from above
    distance = np.where(sample.index >= 0, near * 4 + lit, np.inf)
    place = int(np.argmin(distance))
    return place // len(sample.lights), place % len(sample.lights)


def frontal_colours(sample: BtfSample, *, light: F8 = OBLIQUE) -> F4:
    """sRGB-coded colours (H, W, 3) f4 of the sample seen from above under one light."""
    view, lit = nearest_pair(sample, np.array([0.0, 0.0, 1.0]), light)
    return linear_to_srgb(sample.image(view, lit))


def quilting_sample(
    sample: BtfSample, *, rank: int = 40, memory_mb: float = 2048, progress: Progress = silent
) -> Sample:
    """Return what the quilting needs of a BTF: a picture, and channels to compare.

    The channels are the geometry maps times their singular values, so that distances are
    those of the (coded) BTF itself (Zhou §III-B). A sample that came factorised is not
    factorised again; an ordinary picture keeps its three colours.
    """
    colours = frontal_colours(sample)
    if sample.is_image:
        return Sample(sample.name, colours, colours, sample.tiles)
    factors = sample.factors
    if factors is None:
        from btfcore.btf.factor.svd import factorize

        factors = factorize(sample, rank=rank, memory_mb=memory_mb, progress=progress)
    if factors.rank == 0:
        raise InvalidBtf(f"{sample.name}: it looks the same everywhere; there is no pattern")
    # per image, so that seams cost about what they cost in a picture's colours
    scale = np.float32(1 / np.sqrt(sample.images))
    return Sample(sample.name, colours, factors.weights * scale, sample.tiles)
