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
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(tmp_path, mesh, sample, change, words):
    value = {"mesh": mesh, "sample": sample, "output": tmp_path / "o.glb", "rate": "64"}
    value |= {"scale": "1"} | change
    if change.get("output"):
        value["output"] = tmp_path / change["output"]
    options = ["--rate", value["rate"], "--scale", value["scale"]]
    options += ["--guide", value["guide"]] if "guide" in value else []
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
