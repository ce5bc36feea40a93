"""`patina render` as a user meets it: without a display, the same bits again, errors by name."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

from btfcore.library import meshes, samples
from btfcore.painting import new_document, save_project
from tests.test_cli import patina

ROOT = Path(__file__).resolve().parents[1]
MESH = next(path for path in meshes() if path.name == "spot.obj")
SAMPLE = ROOT / "resources" / "samples" / "linen.btfz"
SMALL = ("--size", "96x72", "--samples", 2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A project, and the same decorated mesh as GLBs."""
    here = tmp_path_factory.mktemp("render")
    painting = new_document(MESH, SAMPLE, rate=96)
    save_project(painting, here / "p.patina")
    from btfcore.files.quilt_npz import write_quilt_npz
    from btfcore.painting import export_document

    export_document(here / "lit.glb", painting, relightable=True)
    export_document(here / "plain.glb", painting)
    prepared, quilt = painting.document.prepared, painting.document.quilt()
    write_quilt_npz(here / "q.npz", prepared.dense, prepared.field, quilt)
    return here


@pytest.fixture(scope="module")
def picture(folder):
    """The project under one light."""
    done = patina("render", folder / "p.patina", "-o", folder / "a.png", "--light", "20,40", *SMALL)
    assert done.returncode == 0, done.stderr
    assert "1 picture of 96 x 72 pixels" in done.stdout
    return np.asarray(Image.open(folder / "a.png")).astype(int)


def test_a_project_is_rendered_before_the_window_s_gradient(picture):
    assert picture.shape == (72, 96, 3)
    assert np.array_equal(picture[0, 0], np.rint(np.array([0.95, 0.96, 0.97]) * 255))
    ground = np.abs(picture - picture[:, :1]).max(axis=2) < 3
    assert 0.2 < (~ground).mean() < 0.8


def test_runs_and_numbers_of_threads_give_the_same_bytes(folder, picture):
    words = [sys.executable, "-m", "app", "render", str(folder / "p.patina"), "--light", "20,40",
             *map(str, SMALL), "-o"]  # fmt: skip
    first = (folder / "a.png").read_bytes()
    one_core = "import os,sys; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))});"
    code = one_core + "from app.__main__ import main; main()"
    for name, command in (("b", words), ("c", [sys.executable, "-c", code, *words[3:]])):
        if name == "c" and not hasattr(os, "sched_setaffinity"):
            continue
        subprocess.run([*command, str(folder / f"{name}.png")], cwd=ROOT, check=True, timeout=240)
        assert (folder / f"{name}.png").read_bytes() == first


def test_nothing_graphical_is_loaded(folder):
    code = (
        "import sys\n"
        "from app.__main__ import main\n"
        f"sys.argv = ['patina', 'render', {str(folder / 'p.patina')!r}, '-o',"
        f" {str(folder / 'n.png')!r}, '--size', '32x24']\n"
        "try:\n"
        "    main()\n"
        "except SystemExit as stop:\n"
        "    assert not stop.code, stop.code\n"
        "heavy = {'PyQt6', 'pyvista', 'vtk', 'vtkmodules', 'pyvistaqt'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    clean = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=clean, capture_output=True,
                          text=True, timeout=240)  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words", [("lit.glb",), ("plain.glb", "--quilt", "q.npz")])
def test_a_glb_with_its_sample_is_the_same_picture(folder, picture, words):
    given = [folder / word if "." in word else word for word in words]
    done = patina("render", *given, "--sample", SAMPLE, "-o", folder / "g.png", "--light", "20,40",
                  *SMALL)  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = np.asarray(Image.open(folder / "g.png")).astype(int)
    apart = np.abs(found - picture)
    assert apart.mean() < 0.05  # its positions are single floats
    assert (apart > 8).any(axis=2).sum() <= 4


def test_decorate_and_paint_write_glbs_that_can_be_lit(folder, tmp_path):
    picture = samples()[0]
    done = patina("decorate", MESH, picture, "-o", tmp_path / "d.glb", "--rate", 64,
                  "--relightable")  # fmt: skip
    assert done.returncode == 0, done.stderr
    done = patina("paint", folder / "p.patina", "-o", tmp_path / "p.glb", "--relightable")
    assert done.returncode == 0, done.stderr
    for name, sample in (("d", picture), ("p", SAMPLE)):
        done = patina("render", tmp_path / f"{name}.glb", "--sample", sample, "-o",
                      tmp_path / f"{name}.png", *SMALL)  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert np.asarray(Image.open(tmp_path / f"{name}.png")).std() > 10
    for words in (("decorate", MESH, picture), ("paint", folder / "p.patina")):
        done = patina(*words, "-o", tmp_path / "no.obj", "--relightable")
        assert done.returncode == 2
        assert ".glb" in done.stderr


def test_an_exr_is_radiance_premultiplied_by_alpha(folder):
    def read(name, *words):
        done = patina("render", folder / "p.patina", "-o", folder / name, *SMALL, *words)
        assert done.returncode == 0, done.stderr
        return OpenImageIO.ImageInput.open(str(folder / name)).read_image("float")

    one = read("one.exr", "--light", "20,40", "--exposure", 3)
    two = read("two.exr", "--light", "20,40,2")
    assert one.shape == (72, 96, 4)
    alpha = one[..., 3]
    assert set(np.unique(alpha)) == {0, 0.25, 0.5, 0.75, 1}
    assert not one[alpha == 0].any()
    assert np.allclose(two[..., :3], 2 * one[..., :3], rtol=1e-5)
    assert one[..., :3].max() > 0.05


def test_an_environment_lights_and_lies_behind(folder):
    from btfcore.files.exr import encode_exr

    sky = np.full((16, 32, 3), 0.5, np.float32)
    sky[:8] = (0.2, 0.4, 1.5)
    (folder / "sky.exr").write_bytes(encode_exr(sky))
    done = patina("render", folder / "p.patina", "-o", folder / "e.png", *SMALL, "--env",
                  folder / "sky.exr", "--env-lights", 16, "--background", "environment",
                  "--view", "30,-30", "--shadows", "--curve", "reinhard")  # fmt: skip
    assert done.returncode == 0, done.stderr
    seen = np.asarray(Image.open(folder / "e.png")).astype(int)
    assert seen[0, 0, 2] > seen[0, 0, 0] + 40  # looking up into the blue
    middle = seen[30:42, 40:56].reshape(-1, 3).mean(axis=0)
    assert (middle > 5).all()


def test_a_film_goes_around_and_a_sequence_is_numbered(folder):
    av = pytest.importorskip("av")
    done = patina("render", folder / "p.patina", "-o", folder / "f.mp4", *SMALL, "--turntable", 3,
                  "--light-sweep", 6, "--fps", 6)  # fmt: skip
    assert done.returncode == 0, done.stderr
    with av.open(str(folder / "f.mp4")) as film:
        shown = [each.to_ndarray(format="rgb24").astype(int) for each in film.decode(video=0)]
    assert len(shown) == 6
    assert min(np.abs(a - b).mean() for a, b in zip(shown, shown[1:], strict=False)) > 1
    done = patina("render", folder / "p.patina", "-o", folder / "s_%02d.png", *SMALL,
                  "--light-sweep", 2, "--light-path", "over", "--background", "transparent",
                  "--per-pixel", "--rank", 4, "--interpolation", "nearest")  # fmt: skip
    assert done.returncode == 0, done.stderr
    one = np.asarray(Image.open(folder / "s_01.png"))
    assert one.shape == (72, 96, 4)
    assert not one[0, 0].any()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("-o", "a.jpg"), "unknown suffix"),
        (("-o", "a.png", "--size", "30000x10"), "30000 x 10"),
        (("-o", "a.png", "--size", "large"), "'large'"),
        (("-o", "a.png", "--samples", 99), "99 samples"),
        (("-o", "a.png", "--turntable", 5), "a film"),
        (("-o", "a.mp4", "--size", "11x10"), "11 x 10"),
        (("-o", "a.mp4", "--background", "transparent"), "alpha"),
        (
            (
                "-o",
                "a_%d.mp4",
            ),
            "one file",
        ),
        (("-o", "a.png", "--light", "north"), "'north'"),
        (("-o", "a.png", "--view", "1"), "'1'"),
        (("-o", "a.png", "--view", "0,100"), "100"),
        (("-o", "a.png", "--view", "0,0,nan"), "nan"),
        (("-o", "a.png", "--env", "gone.exr"), "gone.exr"),
        (("-o", "a.png", "--background", "environment"), "no environment"),
        (("-o", "a.png", "--background", "blue"), "'blue'"),
        (("-o", "a.png", "--curve", "s"), "'s'"),
        (("-o", "a.png", "--exposure", "inf"), "inf stops"),
        (("-o", "a.png", "--representation", "voxels"), "'voxels'"),
        (("-o", "a.png", "--interpolation", "cubic"), "cubic"),
        (("-o", "a.png", "--rank", -1), "-1"),
        (("-o", "a.png", "--sample", "x.png"), "its own"),
        (("-o", "a.png", "--light-path", "up"), "'up'"),
        (("-o", "a.mp4", "--fps", 0), "0 pictures"),
        (("-o", "a.png", "--turntable", -1), "-1"),
    ],
)
def test_wrong_words_are_refused_by_name_and_leave_nothing(folder, tmp_path, words, told):
    given = [tmp_path / word if str(word).startswith("a") and at == 1 else word
             for at, word in enumerate(words)]  # fmt: skip
    done = patina("render", folder / "p.patina", "--size", "32x24", *given)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert done.stderr.count("\n") == 1 and done.stderr.startswith("patina: ")
    assert told in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [(("plain.glb", "--sample", str(SAMPLE)), "--relightable"), (("lit.glb",), "names 1 samples"),
     (("gone.patina",), "gone.patina"), (("gone.glb",), "gone.glb"), (("q.npz",), "q.npz")],
)  # fmt: skip
def test_what_cannot_be_lit_is_named(folder, tmp_path, words, told):
    done = patina("render", folder / words[0], *words[1:], "-o", tmp_path / "a.png", *SMALL)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert told in done.stderr
    assert list(tmp_path.iterdir()) == []
