"""The refinement from files: in the pipeline, in the report and on the command line."""

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from btfcore.errors import Cancelled, InvalidParameter
from btfcore.library import meshes, samples
from btfcore.pipeline import decorate
from btfcore.report import run_report


@pytest.fixture(scope="module")
def inputs():
    return next(path for path in meshes() if "spot" in path.name), samples()[0]


@pytest.fixture(scope="module")
def plain(inputs):
    return decorate(*inputs, rate=96)


def test_a_refined_run_costs_less_and_says_so(inputs, plain):
    refined = decorate(*inputs, rate=96, refine_tries=4)
    report = run_report(refined)
    found = report["refinement"]
    assert found["tries"] == 4 and found["after"] <= found["before"]
    assert found["after"] == pytest.approx(report["seams"]["per_vertex"], rel=1e-5)
    assert found["before"] == pytest.approx(run_report(plain)["seams"]["per_vertex"], rel=1e-5)
    assert "refine" in report["phases"]
    again = decorate(*inputs, rate=96, refine_tries=4)
    assert again.quilt.source.tobytes() == refined.quilt.source.tobytes()


def test_without_a_budget_nothing_is_refined(plain):
    assert plain.refinement is None and run_report(plain)["refinement"] is None
    assert "refine" not in plain.clock.figures


def test_a_refinement_cancelled_keeps_the_covered_quilt(inputs):
    def stop(fraction, label):
        if label == "refining":
            raise Cancelled

    with pytest.raises(Cancelled):
        decorate(*inputs, rate=96, refine_s=60.0, progress=stop)
    done = decorate(*inputs, rate=96, refine_s=60.0, partial=True, progress=stop)
    assert not done.complete and (done.quilt.patch >= 0).all()


def test_an_impossible_budget_is_named_before_anything_is_read(tmp_path):
    with pytest.raises(InvalidParameter, match="-3 tries"):
        decorate("nowhere.obj", "nowhere.png", refine_tries=-3)
    words = ["decorate", "nowhere.obj", "nowhere.png", "-o", str(tmp_path / "o.glb")]
    done = CliRunner().invoke(app, [*words, "--refine", "-1"])
    assert isinstance(done.exception, InvalidParameter) and "seconds" in str(done.exception)


def test_seconds_on_the_command_line(inputs, plain, tmp_path):
    words = ["decorate", *map(str, inputs), "-o", str(tmp_path / "o.glb"), "--rate", "96", "-q"]
    done = CliRunner().invoke(
        app, [*words, "--refine", "0.3", "--save-quilt", str(tmp_path / "q.npz")]
    )
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "q.npz", allow_pickle=False) as quilt:
        assert len(quilt["patch"]) == len(plain.quilt.patch) and (quilt["patch"] >= 0).all()
