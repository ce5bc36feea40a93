"""The table of shortcuts marks the defaults that there are, and judges as it says."""

from dataclasses import replace

import pytest

from btfcore.quilt.parameters import QuiltParameters
from tests.bench.optimum import Pick, excess
from tests.bench.shortcuts import VARIANTS, Row, judged, quick_variants


def test_every_shortcut_has_one_default_and_all_values_are_allowed():
    for shortcut in {variant.shortcut for variant in VARIANTS}:
        tried = [variant for variant in VARIANTS if variant.shortcut == shortcut]
        assert sum(variant.default for variant in tried) == 1, shortcut
        assert len({variant.value for variant in tried}) == len(tried) > 1
        for variant in tried:
            QuiltParameters(**variant.knobs)


def test_the_quick_table_is_short():
    chosen = quick_variants()
    assert 0 < len(chosen) < len(VARIANTS)
    assert {variant.shortcut for variant in chosen} == {variant.shortcut for variant in VARIANTS}


def test_a_value_is_beaten_by_one_that_is_no_slower_and_better():
    row = Row("knob", "a *", 1.0, 0.050, 1.0, 4.0, 0.9, 1.1)
    rows = [
        row,
        replace(row, value="b", cpu_s=1.02, per_vertex=0.040),
        replace(row, value="c", cpu_s=1.50, per_vertex=0.030),
        replace(row, value="d", cpu_s=1.00, per_vertex=0.0495),
        replace(row, shortcut="other", value="e", cpu_s=0.1, per_vertex=0.010),
    ]
    assert [row.beaten_by for row in judged(rows)] == ["b", "", "", "b", ""]


def test_excess_is_one_where_nothing_better_was_tried():
    assert excess([Pick(2.0, 2.0, 90), Pick(1.0, float("inf"), 90)]) == pytest.approx(1)
    assert excess([Pick(3.0, 2.0, 90), Pick(1.0, 1.0, 90)]) == pytest.approx(4 / 3)
    assert excess([Pick(1.0, 2.0, 90)]) == 1.0  # between those tried
