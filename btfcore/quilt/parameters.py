"""Every knob of the quilting, with what it does to the picture."""

from __future__ import annotations

from dataclasses import dataclass

from btfcore.errors import InvalidParameter


@dataclass(frozen=True)
class QuiltParameters:
    """Knobs of `btfcore.quilt.synthesize`; the defaults are the measured knee.

    scale : 2 makes the pattern twice as large; at 1 a sample texel spans one dense-mesh step.
    seed : of everything random.
    work_patch : r_w, radius of a work patch in breadth-first levels; None ties it to the
        sample's size (48 for 128 texels). Larger copies more of the sample, with fewer seams.
    max_distortion : T_d, bound on a patch's area distortion (Zhou §III-B).
    max_seam : T_c, bound on the seam cost per seam edge over the sample's mean texel
        difference; None keeps the best of the placements tried without a bound.
    max_bend : median angle in degrees between the field and a patch's texture above which the
        patch shrinks (never below 8 levels).
    near_field : degrees within which half of the texture shall follow the field; while it does
        not, patches shrink until they do.
    placements : candidate placements that are cut, the cheapest being kept.
    bend : by how much lengths at a patch's rim may change so that its texture follows a
        turning field; 0 keeps patches as isometric as they were flattened.
    sway : degrees within which registration may turn a placement besides shifting it by
        fractions of a texel; 0 leaves whole texels.
    give : by how much registration may stretch, shear and bend a placement, as a share of
        its lengths; 0 keeps placements rigid.
    carry_on : vertices up to which a patch first tries to carry on the patches around it, and
        searches the sample only where that is dear; 0 always searches.
    swing : orientations of the sample tried around the field's, in degrees.
    ahead : how many levels ahead of the frontier a patch is centred; None: half of r_w.
    band : width in levels of the overlap that may be cut.
    match_band : width in levels of the overlap that is matched: where the seam may run.
    beside : texels on each side of a seam that its cost looks at; 0 looks at the texels that
        it parts only, as the paper does. 2 leaves less to see and takes a fifth more time.
    reuse : how strongly a place of the sample is avoided that was taken before, in units of
        the difference between the best match and the last of `placements`. 4 repeats visibly
        less in a regular pattern, and leaves more seams to see.
    overlap : share of the known part of the work image that a placement must cover.
    border : levels that a sample may reach across a soft border into its neighbour's region.
    margin : distance in texels of the patch's centre to the sample's border.
    match_channels : principal channels used in matching, at most.
    features : whether features (see `btfcore.types.Sample.mask`) are synthesised like all else;
        without them only the background S_b of every sample is.
    literal : the paper's way in every step.
    """

    scale: float = 1.0
    seed: int = 0
    work_patch: int | None = None
    max_distortion: float = 4.0
    max_seam: float | None = None
    max_bend: float = 25.0
    near_field: float = 4.8
    bend: float = 0.15
    placements: int = 4
    carry_on: int = 700
    swing: tuple[float, ...] = (0.0,)
    sway: float = 2.0
    give: float = 0.08
    ahead: int | None = None
    band: int = 20
    match_band: int = 14
    beside: int = 0
    reuse: float = 0.0
    overlap: float = 0.8
    margin: float = 24.0
    match_channels: int = 4
    border: int = 12
    features: bool = True
    literal: bool = False

    def __post_init__(self) -> None:
        """Check every range, naming the knob and its value."""
        _within("scale", self.scale, 0.01, 100.0)
        _within("max_distortion", self.max_distortion, 1.01, 1e6)
        _within("placements", self.placements, 1, 64)
        _within("bend", self.bend, 0.0, 0.5)
        _within("sway", self.sway, 0.0, 45.0)
        _within("carry_on", self.carry_on, 0, 10**6)
        _within("give", self.give, 0.0, 0.3)
        _within("beside", self.beside, 0, 8)
        _within("reuse", self.reuse, 0.0, 1e3)
        _within("overlap", self.overlap, 0.0, 1.0)
        _within("border", self.border, 0, 1000)
        _within("seed", self.seed, 0, 2**32 - 1)
        if self.work_patch is not None:
            _within("work_patch", self.work_patch, 4, 200)
        if self.max_seam is not None:
            _within("max_seam", self.max_seam, 1e-6, 1e6)


def _within(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:  # also false for NaN
        raise InvalidParameter(f"{name} is {value:g}, outside {low:g} … {high:g}")
