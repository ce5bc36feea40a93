"""The bench of painting measures what it says, and leaves the document as it was."""

import numpy as np
import pytest

from btfcore.paint import compose, foreground, matching
from btfcore.paint.region import constrain
from tests.bench import paint

MESH, SAMPLE, RATE = "sphere.obj", "cracked-brick.btfz", 192


@pytest.fixture(scope="module")
def document():
    return paint.document(MESH, SAMPLE, RATE)


def test_a_stroke_covers_the_share_that_was_asked_for(document):
    for share in (0.02, 0.08):
        area = paint.Area(strokes=(paint.stroke_over(document, share),))
        engine = document.engine
        covered = constrain(area, document.prepared.mesh, engine.net, engine.locator)
        assert share <= len(covered.vertices) / len(engine.state.patch) < share + 0.03


def test_strokes_are_measured_and_taken_back(document):
    before = document.engine.copy()
    row = paint.measure_stroke(document, SAMPLE, 0.05)
    assert len(document.engine.differences(before)) == 0 and document.layers == ()
    assert row.moved == 0 and row.patches > 0 and 0.05 <= row.area < 0.09
    assert 0 < row.first_ms <= row.all_ms and row.step_ms <= row.all_ms
    assert 0 < row.E < 1 and 0.5 < row.reached <= 1 and row.thorough_E < 1.1


def test_the_reference_tries_more_and_the_knobs_come_back():
    modules = (compose, foreground, matching)
    kept = [vars(module).copy() for module in modules]
    with pytest.raises(ZeroDivisionError), paint.thorough():
        assert compose.PLACEMENTS == paint.THOROUGH["PLACEMENTS"]
        assert matching.LOOKED_AT == paint.THOROUGH["LOOKED_AT"]
        assert foreground.TRIES == paint.THOROUGH["TRIES"]
        _ = 1 / 0
    for module, before in zip(modules, kept, strict=True):
        assert all(vars(module)[name] is value for name, value in before.items())


def test_tools_are_timed(document):
    row = paint.measure_tools(document, SAMPLE)
    figures = [value for value in vars(row).values() if isinstance(value, float)]
    assert len(figures) == 10 and all(value > 0 and np.isfinite(value) for value in figures)
