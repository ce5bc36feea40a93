"""What each shortcut of the quilting costs and what it buys, one knob changed at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, field, fields, replace
from typing import Any

import numpy as np

from btfcore.phases import PhaseClock
from btfcore.pipeline import load_mesh, load_sample, prepare
from btfcore.quilt.measure import measure_seams
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.refine import refine
from btfcore.quilt.synthesize import Synthesizer
from btfcore.types import Prepared, Sample
from tests.bench.inputs import find, found, present, warm_up
from tests.bench.measures import isometry
from tests.bench.optimum import Change, audited, crop, excess, untouched
from tests.bench.table import machine, markdown, publish

MESH, RATE, SAMPLES, SEEDS = "bunny.obj", 512, ("linen.btfz", "brick_red.png"), (0, 1)
QUICK_MESH, QUICK_RATE, QUICK_SAMPLES, QUICK_SEEDS = "spot.obj", 128, ("brick_red.png",), (0,)
SMALL, MARGIN = 24, 6.0  # texels: the sample whose placements are all tried
SECONDS = (1.0, 2.0, 4.0, 8.0)
ALL = 10_000
CPU, ERROR = 1.03, 0.98  # what counts as no slower and as better
SEARCHED = tuple(float(angle) for angle in np.arange(-10, 10.1, 2.5))
NOTE = f"""*: the default. Means of two seeds; CPU seconds of the quilting alone, warm. *per
vertex*: seam cost per vertex over the cost of random pairs; *per edge*: per seam edge over the
sample's mean texel difference; *angle*: median deviation from the field in degrees; *in 1.3*:
triangles whose singular values lie within a factor 1.3; *optimum*: seam cost about a patch of
about 90 vertices, as chosen over the least of all placements (whole texels × five orientations,
each cut optimally) of a {SMALL}² piece of the sample that cover as much, not carrying on;
*beaten by*: a value of the same knob that costs no more CPU time (+3 %) and at least 2 % less per
vertex. *LSCM*: for every patch that leaves its chart. *72 copies*: the paper's matching, the
sample turned by whole multiples of five degrees, and the whole overlap cut. *literal*: the
paper's way in every step."""


def lscm(engine: Synthesizer) -> None:
    """Flatten every patch that leaves its chart by LSCM."""
    engine._flattener.literal = True


def copies(engine: Synthesizer) -> None:
    """Match against 72 rotated copies of the sample, and cut the whole overlap."""
    engine._finder.parameters = replace(engine.parameters, literal=True)


@dataclass(frozen=True)
class Variant:
    """One value of one shortcut."""

    shortcut: str
    value: str
    knobs: dict[str, Any] = field(default_factory=dict)
    change: Change = untouched

    @property
    def default(self) -> bool:
        """Whether this is what a run does unless told otherwise."""
        plain = QuiltParameters()
        return self.change is untouched and replace(plain, **self.knobs) == plain


def values(shortcut: str, knob: str, *tried: Any) -> list[Variant]:
    """Variants of one numeric knob."""
    names = ["all" if value == ALL else f"{value:g}" for value in tried]
    return [
        Variant(shortcut, name, {knob: value}) for name, value in zip(names, tried, strict=True)
    ]


VARIANTS = (
    *values("channels matched", "match_channels", 1, 2, 4, 8, ALL),
    *values("placements cut", "placements", 1, 2, 4, 8, 16),
    Variant("flattening", "exponential map"),
    Variant("flattening", "LSCM", {}, lscm),
    Variant("orientation", "the field's"),
    Variant("orientation", "±10°", {"swing": (-10.0, 0.0, 10.0)}),
    Variant("orientation", "searched, 2.5°", {"swing": SEARCHED}),
    Variant("orientation", "72 copies", {}, copies),
    *values("registration, degrees", "sway", 0.0, 2.0, 4.0),
    *values("giving", "give", 0.0, 0.04, 0.08, 0.15),
    *values("carrying on, vertices", "carry_on", 0, 700, 2000),
    *values("bend", "bend", 0.0, 0.1, 0.15, 0.2),
    *values("band cut", "band", 8, 12, 20, 40),
    Variant("everything", "Patina's way"),
    Variant("everything", "literal", {"literal": True}),
)


@dataclass(frozen=True)
class Row:
    """Time and errors of one variant on one sample."""

    shortcut: str
    value: str
    cpu_s: float
    per_vertex: float
    per_edge: float
    angle: float
    in_1_3: float
    optimum: float
    beaten_by: str = ""


def measure(prepared: Prepared, sample: Sample, variant: Variant, seeds: tuple[int, ...]) -> Row:
    """Quilt with each seed and average; the small case beside it."""
    small, got = crop(sample, SMALL), []
    for seed in seeds:
        knobs = QuiltParameters(seed=seed, **variant.knobs)
        clock = PhaseClock()
        with clock.phase("quilt"):
            engine = Synthesizer(prepared.dense, prepared.field, sample, knobs)
            variant.change(engine)
            quilt = engine.run()
        seams = measure_seams(engine.net, engine.state, engine.grid)
        picks = audited(small, replace(knobs, margin=MARGIN, carry_on=0), change=variant.change)
        got.append(
            (
                clock.figures["quilt"]["cpu_s"],
                seams.per_vertex,
                seams.per_edge,
                float(np.median(np.abs(np.degrees(quilt.angle.astype(np.float64))))),
                isometry(prepared.dense, quilt).within,
                excess(picks),
            )
        )
    star = " *" if variant.default else ""
    return Row(variant.shortcut, variant.value + star, *np.mean(got, axis=0).tolist())


def judged(rows: list[Row]) -> list[Row]:
    """Say for every row which value of the same shortcut beats it, the best one if several."""
    result = []
    for row in rows:
        better = [
            other
            for other in rows
            if other.shortcut == row.shortcut
            and other.cpu_s <= CPU * row.cpu_s
            and other.per_vertex <= ERROR * row.per_vertex
        ]
        best = min(better, key=lambda other: other.per_vertex, default=None)
        result.append(replace(row, beaten_by="" if best is None else best.value.rstrip(" *")))
    return result


def table(
    prepared: Prepared,
    sample: Sample,
    variants: tuple[Variant, ...],
    seeds: tuple[int, ...],
    *,
    on_row: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Measure all variants; the default, which every shortcut has, only once."""
    rows: list[Row] = []
    plain: Row | None = None
    for variant in variants:
        if variant.default and plain is not None:
            row = replace(plain, shortcut=variant.shortcut, value=f"{variant.value} *")
        else:
            row = measure(prepared, sample, variant, seeds)
        plain = row if variant.default else plain
        rows.append(row)
        on_row(row)
    return judged(rows)


def refinement(
    prepared: Prepared, sample: Sample, seconds: tuple[float, ...], seeds: tuple[int, ...]
) -> list[tuple[Any, ...]]:
    """Seam cost against the seconds given to the refinement, each from the same quilt."""
    warm = Synthesizer(prepared.dense, prepared.field, sample, QuiltParameters())
    warm.run()
    refine(warm, tries=2)
    rows = []
    for budget in (0.0, *seconds):
        got = []
        for seed in seeds:
            knobs = QuiltParameters(seed=seed)
            engine = Synthesizer(prepared.dense, prepared.field, sample, knobs)
            engine.run()
            clock = PhaseClock()
            with clock.phase("refine"):
                done = refine(engine, seconds=budget)
            seams = measure_seams(engine.net, engine.state, engine.grid)
            angle = np.degrees(np.abs(engine.state.angle.astype(np.float64)))
            got.append(
                (
                    clock.figures["refine"]["cpu_s"], done.tries, seams.per_vertex,
                    seams.per_edge, float(np.median(angle)),
                )
            )  # fmt: skip
        rows.append((f"{sample.name}, {budget:g} s", *np.mean(got, axis=0).tolist()))
    return rows


def main(*, write: bool = False, quick: bool = False) -> None:
    """Print the tables; `quick` keeps to one small case and to the ends of every knob."""
    mesh, rate = (QUICK_MESH, QUICK_RATE) if quick else (MESH, RATE)
    seeds = QUICK_SEEDS if quick else SEEDS
    there, absent = present([mesh, *(QUICK_SAMPLES if quick else SAMPLES)])
    warm_up()
    prepared = prepare(load_mesh(found(mesh))[0], rate=rate)
    columns = [
        item.name.replace("_s", " s").replace("in_1_3", "in 1.3").replace("_", " ")
        for item in fields(Row)
    ]
    parts = ["## Shortcuts", machine(), f"{mesh} at {rate}²."]
    refined: list[tuple[Any, ...]] = []
    for name in there:
        if name == mesh or find(name) is None:
            continue
        sample = load_sample(found(name))
        rows = table(prepared, sample, quick_variants() if quick else VARIANTS, seeds)
        parts += [f"### {name}", markdown(columns, [astuple(row) for row in rows])]
        refined += refinement(prepared, sample, (0.5,) if quick else SECONDS, seeds)
    head = ("refined for", "CPU s", "tries", "per vertex", "per edge", "angle")
    parts += [NOTE, "### Refinement", markdown(head, refined), absent]
    publish("shortcuts", "\n\n".join(part for part in parts if part), write=write)


def quick_variants() -> tuple[Variant, ...]:
    """The default and the last value of every shortcut, without the paper's slow ones."""
    last = {variant.shortcut: variant for variant in VARIANTS}
    slow = (lscm, copies)
    return tuple(
        variant
        for variant in VARIANTS
        if variant.default or (variant is last[variant.shortcut] and variant.change not in slow)
    )
