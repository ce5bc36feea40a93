"""`patina paint` and `patina project` as a user meets them, in processes of their own."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from btfcore.files.project.read import read_project
from btfcore.library import meshes
from tests.paint.scenes import cracked, ready, spotted
from tests.test_cli import patina
from tests.test_painting import picture

ROOT = Path(__file__).resolve().parents[1]
MESH = next(path for path in meshes() if path.name == "spot.obj")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two pictures with masks and three edits files."""
    here = tmp_path_factory.mktemp("files")
    for sample in (cracked(), spotted()):
        picture(here / f"{sample.name}.png", sample.colour)
        picture(here / f"{sample.name}_mask.png", sample.mask)
    dense = ready().dense
    points = dense.vertices[[100, 130]].tolist()
    background = {"sample": "cracked.png", "mask": "cracked_mask.png", "seed": 5}
    spots = {"spots": {"file": "spotted.png", "mask": "spotted_mask.png"}}
    stamp = {"kind": "stamp", "sample": "spots", "point": points[1]}
    stroke = {"points": points[:1], "radius": 6 * dense.step}
    repair = {"kind": "repair", "name": "mend", "area": {"strokes": [stroke]}}
    for name, more in (
        ("one", {"background": background, "samples": spots, "edits": [stamp]}),
        ("two", {"edits": [repair]}),
        ("bad", {"edits": [repair, {**repair, "area": {"strokes": [{**stroke, "radius": -1}]}}]}),
        ("gone", {"samples": {"x": {"file": "spotted.png", "mask": "gone.png"}}}),
        ("lost", {"edits": [{**stamp, "sample": "spot"}]}),
    ):
        text = {"format": "patina-edits", "version": 1, **more}
        (here / f"{name}.json").write_text(json.dumps(text))
    return here


@pytest.fixture(scope="module")
def run(folder, tmp_path_factory):
    """A mesh painted by two files, with everything that can be asked for."""
    here = tmp_path_factory.mktemp("run")
    done = patina(
        "paint", MESH, "--edits", folder / "one.json", "--edits", folder / "two.json",
        "-o", here / "o.glb", "--rate", 96, "--save", here / "p.patina",
        "--report", here / "r.json", "--preview", here / "p.png",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return here, done


def test_all_that_was_asked_for_is_written(run):
    here, done = run
    assert sorted(p.name for p in here.iterdir()) == ["o.glb", "p.patina", "p.png", "r.json"]
    assert (here / "o.glb").read_bytes()[:4] == b"glTF"
    assert "Stamp 1: 1 patches" in done.stdout and "2 edits made, 2 in all" in done.stdout


def test_the_report_tells_what_every_edit_did(run):
    report = json.loads((run[0] / "r.json").read_text())
    assert [edit["name"] for edit in report["edits"]] == ["Stamp 1", "mend"]
    assert [edit["kind"] for edit in report["edits"]] == ["stamp", "repair"]
    for edit in report["edits"]:
        for name in ("patches", "area", "reached", "energy", "energy_before", "notes", "vertices"):
            assert name in edit
    assert report["seed"] == 5 and report["rate"] == 96 and report["edits_before"] == 0
    assert [each["name"] for each in report["samples"]] == ["background", "spots"]
    assert set(report["phases"]) >= {"import", "samples", "quilt", "paint", "export"}


def test_the_same_edits_give_the_same_file_for_any_thread_count(run, folder, tmp_path):
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    done = patina(
        "paint", MESH, "--edits", folder / "one.json", "--edits", folder / "two.json", "-q",
        "-o", tmp_path / "o.glb", "--rate", 96, env={**os.environ, **dict.fromkeys(names, "1")},
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout == "", done.stderr
    assert (tmp_path / "o.glb").read_bytes() == (run[0] / "o.glb").read_bytes()


def test_a_project_is_gone_on_with(run, folder, tmp_path):
    done = patina(
        "paint", run[0] / "p.patina", "--edits", folder / "two.json", "-o", tmp_path / "q.patina",
        "--report", tmp_path / "r.json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "1 edits made, 3 in all" in done.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["edits_before"] == 2 and report["edits"][0]["uid"] == 2
    one, two = read_project(run[0] / "p.patina"), read_project(tmp_path / "q.patina")
    assert len(two.edits) == 3
    for name in ("source", "angle", "sample", "patch", "ghost"):
        before, after = (getattr(each.background, name) for each in (one, two))
        assert np.array_equal(before, after)


def test_a_project_exports_at_another_rate_without_edits(run, tmp_path):
    for rate in (96, 192):
        done = patina("paint", run[0] / "p.patina", "-o", tmp_path / f"{rate}.glb", "--rate", rate)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "96.glb").read_bytes()[20:] != (tmp_path / "192.glb").read_bytes()[20:]
    assert (tmp_path / "192.glb").stat().st_size > (tmp_path / "96.glb").stat().st_size


def test_info_and_verify_tell_of_a_project(run, tmp_path):
    path = run[0] / "p.patina"
    figures = json.loads(patina("project", "info", path, "--json").stdout)
    assert figures["rate"] == 96 and len(figures["edits"]) == 2
    assert "Stamp 1" in patina("project", "info", path).stdout
    done = patina("project", "verify", path)
    assert done.returncode == 0 and "sound" in done.stdout and "2 edits" in done.stdout
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "d.patina").write_bytes(damaged)
    done = patina("project", "verify", tmp_path / "d.patina")
    assert done.returncode == 2 and "checksum does not fit" in done.stderr
    assert done.stderr.startswith("patina: d.patina: ") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--edits", "bad.json"], r"bad.json: edits[1].area.strokes[0].radius: -1; it should be"),
        (["--edits", "lost.json"], "lost.json: edits[0].sample: there is no sample 'spot'"),
        (["--edits", "gone.json"], "gone.json: samples.x.mask: there is no file"),
        (["--edits", "nowhere.json"], "nowhere.json"),
        (["--edits", "two.json"], "is a mesh: name its background"),
        (["--edits", "one.json", "--rate", "3"], "rate is 3"),
        (["--edits", "one.json", "--report", "r.txt"], "r.txt"),
        (["--edits", "one.json", "--save", "p.glb"], "p.glb"),
        (["--sample", "nowhere.png"], "nowhere.png"),
        (["--sample", "cracked.png", "--mask", "nowhere.png"], "nowhere.png"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(folder, tmp_path, words, message):
    files = (".json", ".png", ".txt", ".glb")
    given = [folder / each if each.endswith(files) else each for each in words]
    more = [] if "--rate" in words else ["--rate", 64]
    if words[1] == "lost.json":
        more += ["--sample", folder / "cracked.png"]
    done = patina("paint", MESH, *given, *more, "-o", tmp_path / "o.glb")
    assert done.returncode == 2, done.stderr
    assert message in done.stderr and done.stderr.startswith("patina: ")
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--sample", "x.png"], "--sample is for a mesh"),
        (["--seed", "3"], "--seed is for a mesh"),
        ([], "nothing to write"),
    ],
)
def test_what_makes_no_sense_for_a_project_is_named(run, tmp_path, words, message):
    output = ["-o", tmp_path / "o.glb"] if words else []
    done = patina("paint", run[0] / "p.patina", *words, *output)
    assert done.returncode == 2 and message in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_project_is_named(tmp_path):
    (tmp_path / "bad.patina").write_bytes(b"no zip at all")
    for words in (["paint", tmp_path / "bad.patina", "-o", tmp_path / "o.glb"],
                  ["project", "info", tmp_path / "bad.patina"]):  # fmt: skip
        done = patina(*words)
        assert done.returncode == 2 and "bad.patina: this is no zip file" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_interrupted_it_keeps_the_edits_that_are_done(run, folder, tmp_path):
    """Many edits, interrupted after some: --save has these, the result is not written."""
    text = json.loads((folder / "two.json").read_text())
    text["edits"] *= 400
    (tmp_path / "many.json").write_text(json.dumps(text))
    words = ["paint", run[0] / "p.patina", "--edits", tmp_path / "many.json",
             "-o", tmp_path / "o.glb", "--save", tmp_path / "s.patina"]  # fmt: skip
    child = subprocess.Popen(
        [sys.executable, "-c", TELLING, *map(str, words)], cwd=ROOT, stderr=subprocess.PIPE,
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert child.stdout.readline() == "painting\n"
        time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=120)
    finally:
        child.kill()
    assert child.returncode == 130, said
    assert "cancelled after" in said and "s.patina holds these" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["many.json", "s.patina"]
    kept = len(read_project(tmp_path / "s.patina").edits)
    assert 2 < kept < 402


# says so when the third of the new edits is begun
TELLING = """
import sys
from btfcore.paint import document
inner, count = document.run, 0
def run(*args, **options):
    global count
    count += 1
    if count == 3:
        print("painting", flush=True)
    return inner(*args, **options)
document.run = run
from app.__main__ import main
sys.argv = ["patina", *sys.argv[1:]]
sys.exit(main())
"""
