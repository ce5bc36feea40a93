"""The benchmarks' own measures are right where the answer is known, and pages stay stable."""

import numpy as np
import pytest

from btfcore.types import Quilt
from tests.bench import table
from tests.bench.measures import isometry, mean_turn, uprightness
from tests.surfaces import constant_field, cylinder, plane


def copied(dense, matrix):
    """Quilt of one patch: the plane's (x, y) mapped to (column, row) by a matrix."""
    count = len(dense.vertices)
    source = (dense.vertices[:, :2] @ np.asarray(matrix).T).astype(np.float32)
    zero = np.zeros(count)
    return Quilt(source, zero.astype(np.float32), zero.astype(np.uint16), zero.astype(np.int32))


def test_a_verbatim_copy_is_an_isometry():
    dense = plane()
    unit = 1 / dense.step
    found = isometry(dense, copied(dense, [[unit, 0], [0, -unit]]))
    assert found.low == pytest.approx(1, abs=1e-3) and found.high == pytest.approx(1, abs=1e-3)
    assert (found.within, found.mirrored) == (1, 0)


def test_stretch_mirroring_and_scale_are_seen():
    dense = plane()
    unit = 1 / dense.step
    found = isometry(dense, copied(dense, [[2 * unit, 0], [0, unit]]))
    assert found.low == pytest.approx(1, abs=1e-3) and found.high == pytest.approx(2, abs=1e-3)
    assert (found.within, found.mirrored) == (0, 1)
    halved = isometry(dense, copied(dense, [[unit / 2, 0], [0, -unit / 2]]), scale=2.0)
    assert halved.median == pytest.approx(1, abs=1e-3)


def test_a_straight_field_turns_nowhere_and_stands_upright():
    field = constant_field(plane())
    assert mean_turn(plane(), field) < 0.1
    assert uprightness(plane(), field) == pytest.approx(1, abs=1e-5)
    for dense in (plane(), cylinder()):
        sideways = constant_field(dense, (0.0, 1.0, 0.0))
        assert mean_turn(dense, sideways) < 0.1
        assert uprightness(dense, sideways) == pytest.approx(0, abs=1e-3)


def test_tables_are_aligned():
    text = table.markdown(("name", "n", "x"), [("a", 12345, 0.12345), ("bb", 1, 1.5e-5)])
    lines = text.splitlines()
    assert len({len(line) for line in lines}) == 1
    assert "12,345" in lines[2] and "0.123" in lines[2] and "1.5e-05" in lines[3]


def test_writing_one_section_leaves_the_others_alone(tmp_path, monkeypatch):
    page = tmp_path / "docs" / "benchmarks.md"
    monkeypatch.setattr(table, "PAGE", page)
    monkeypatch.setattr(table, "ROOT", tmp_path)
    table.publish("dense", "first", write=True)
    table.publish("quilt", "second", write=True)
    before = page.read_text(encoding="utf-8")
    table.publish("dense", "third", write=True)
    assert page.read_text(encoding="utf-8") == before.replace("first", "third")
    table.publish("dense", "not kept", write=False)
    assert "not kept" not in page.read_text(encoding="utf-8")
