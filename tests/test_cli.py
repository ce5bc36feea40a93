"""The command line as a user meets it, in processes of its own."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from btfcore.library import meshes, samples

ROOT = Path(__file__).resolve().parents[1]


def patina(*words, **options):
    """Run the command; returns the finished process."""
    return subprocess.run(
        [sys.executable, "-m", "app", *map(str, words)],
        cwd=ROOT, capture_output=True, text=True, timeout=240, **options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def mesh():
    return next(path for path in meshes() if "spot" in path.name)


@pytest.fixture(scope="module")
def sample():
    return samples()[0]


@pytest.fixture(scope="module")
def run(tmp_path_factory, mesh, sample):
    folder = tmp_path_factory.mktemp("run")
    done = patina(
        "decorate", mesh, sample, "-o", folder / "out.glb", "--rate", 128, "--seed", 5,
        "--save-quilt", folder / "q.npz", "--report", folder / "r.json",
        "--preview", folder / "p.png",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder


def test_decorate_writes_all_it_was_asked_for(run):
    assert sorted(p.name for p in run.iterdir()) == ["out.glb", "p.png", "q.npz", "r.json"]
    assert (run / "out.glb").read_bytes()[:4] == b"glTF"


def test_the_report_holds_what_the_issue_lists(run):
    report = json.loads((run / "r.json").read_text())
    assert report["seed"] == 5 and report["versions"]["patina"]
    for name in ("vertices", "faces", "boundary_edges", "nonmanifold_edges", "euler"):
        assert name in report["input"] and name in report["dense"]
    assert report["dense"]["euler"] == report["input"]["euler"]
    assert report["dense"]["nonmanifold_edges"] == 0
    assert report["dense"]["distance_mean"] <= report["dense"]["distance_max"] < 0.02
    assert set(report["phases"]) >= {"import", "atlas", "dense", "field", "quilt", "export"}
    for figures in report["phases"].values():
        assert set(figures) == {"wall_s", "cpu_s", "peak_mb"}
    kinds = report["quilt"]["patches_by_kind"]
    assert (
        kinds["in_chart"] + kinds["exponential_map"] + kinds["lscm"] == report["quilt"]["patches"]
    )
    assert report["quilt"]["covered"] == 1.0
    assert report["seams"]["per_edge"] >= 0


def test_the_quilt_holds_the_arrays_that_the_design_names(run):
    with np.load(run / "q.npz", allow_pickle=False) as quilt:
        count, faces = len(quilt["vertices"]), len(quilt["faces"])
        shapes = {name: quilt[name].shape for name in quilt.files}
        assert (quilt["patch"] >= 0).all()
        assert len(np.unique(quilt["texel"], axis=0)) == count
    assert shapes == {
        "vertices": (count, 3), "normals": (count, 3), "tangents": (count, 3),
        "faces": (faces, 3), "texel": (count, 2), "source": (count, 2), "angle": (count,),
        "sample": (count,), "patch": (count,),
    }  # fmt: skip


def test_same_seed_same_file_for_any_thread_count(run, tmp_path, mesh, sample):
    for threads in ("1", "2"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
        done = patina(
            "decorate", mesh, sample, "-o", tmp_path / "out.glb", "--rate", 128, "--seed", 5,
            "--save-quilt", tmp_path / "q.npz", "-q",
            env={**os.environ, **dict.fromkeys(names, threads)},
        )  # fmt: skip
        assert done.returncode == 0 and done.stdout == ""
        assert (tmp_path / "q.npz").read_bytes() == (run / "q.npz").read_bytes()
        assert (tmp_path / "out.glb").read_bytes() == (run / "out.glb").read_bytes()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mesh": "nowhere.obj"}, "nowhere.obj"),
        ({"sample": "nowhere.png"}, "nowhere.png"),
        ({"output": "out.fbx"}, ".fbx"),
        ({"output": "nofolder/out.glb"}, "nofolder"),
        ({"rate": "3"}, "rate is 3"),
        ({"scale": "-1"}, "scale is -1"),
        ({"guide": "nowhere.json"}, "nowhere.json"),
        ({"view-weights": "fronta"}, "'fronta'"),
        ({"light-weights": "nowhere.csv"}, "nowhere.csv"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(tmp_path, mesh, sample, change, words):
    value = {"mesh": mesh, "sample": sample, "output": tmp_path / "o.glb", "rate": "64"}
    value |= {"scale": "1"} | change
    if change.get("output"):
        value["output"] = tmp_path / change["output"]
    options = ["--rate", value["rate"], "--scale", value["scale"]]
    for name in {"guide", "view-weights", "light-weights"} & value.keys():
        options += [f"--{name}", value[name]]
    done = patina("decorate", value["mesh"], value["sample"], "-o", value["output"], *options)
    assert done.returncode == 2, done.stderr
    assert words in done.stderr and done.stderr.startswith("patina: ")
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_interrupting_leaves_nothing_half_written(tmp_path, mesh, sample):
    child = subprocess.Popen(
        [sys.executable, "-m", "app", "decorate", str(mesh), str(sample), "-o",
         str(tmp_path / "o.glb"), "--rate", "2048"],
        cwd=ROOT, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    time.sleep(2.0)
    child.send_signal(signal.SIGINT)
    _, error = child.communicate(timeout=60)
    assert child.returncode == 130, error
    assert list(tmp_path.iterdir()) == []


STOPPED = """
import os, sys
from btfcore.quilt.synthesize import Synthesizer
lay, number = Synthesizer._patch_at, int(sys.argv.pop())
def lay_or_stop(self, vertex):
    if self.state.patches == 3:
        os.kill(os.getpid(), number)
    return lay(self, vertex)
Synthesizer._patch_at = lay_or_stop
from app.__main__ import main
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_leaves_its_quilt_and_is_gone_on_with(tmp_path, mesh, sample, number):
    quilt, output = tmp_path / "q.npz", tmp_path / "o.glb"
    words = ["decorate", mesh, sample, "-o", output, "--rate", 128]
    done = subprocess.run(
        [sys.executable, "-c", STOPPED, *map(str, words), "--save-quilt", str(quilt),
         str(int(number))],
        cwd=ROOT, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "covered" in done.stderr and str(quilt) in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == [quilt]
    with np.load(quilt, allow_pickle=False) as stored:
        begun = {name: stored[name] for name in ("patch", "source")}
    assert begun["patch"].max() == 3 and (begun["patch"] < 0).any()
    if number == signal.SIGTERM:
        return
    other = patina(*words[:-1], 96, "--continue", quilt)
    assert other.returncode == 2 and "another mesh or rate" in other.stderr
    larger = patina(*words, "--continue", quilt, "--scale", 3)
    assert larger.returncode == 2 and "scale" in larger.stderr
    assert list(tmp_path.iterdir()) == [quilt]
    done = patina(
        *words, "--continue", quilt, "--save-quilt", quilt, "--report", tmp_path / "r.json"
    )
    assert done.returncode == 0, done.stderr
    with np.load(quilt, allow_pickle=False) as stored:
        assert (stored["patch"] >= 0).all()
        kept = (begun["patch"] >= 0) & (stored["patch"] == begun["patch"])
        assert kept.any() and (stored["patch"] > 3).any()
        np.testing.assert_allclose(stored["source"][kept], begun["source"][kept], atol=1e-3)
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["quilt"]["patches_continued"] == 4 and report["quilt"]["covered"] == 1.0
    assert output.read_bytes()[:4] == b"glTF"
