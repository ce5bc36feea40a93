"""Laws of OBJ and PLY and of the one door, read back by other libraries."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import pyvista
import trimesh
from PIL import Image

from btfcore.errors import Cancelled, InvalidParameter, OutputFailed
from btfcore.files.export import check_output, export
from btfcore.files.obj import obj_files, write_obj
from btfcore.files.ply import write_ply
from btfcore.files.png import encode_png
from btfcore.files.surface import export_dense, export_input
from btfcore.render.gutter import gutter_source
from btfcore.render.texture import atlas_texture, quantise
from tests.boxes import box

ROOT = Path(__file__).resolve().parents[2]


def noise_colours(dense):
    random = np.random.default_rng(0)
    return random.random((len(dense.vertices), 3)).astype(np.float32)


@pytest.mark.parametrize("name", ["plain.obj", "with blanks.obj", "größe 兔子.obj", "#-.OBJ"])
def test_obj_comes_back_whole_with_its_texture(tmp_path, name):
    atlas, dense = box(8)
    colours = noise_colours(dense)
    written = export(tmp_path / name, atlas.mesh, atlas, dense, colours)
    assert written[0] == tmp_path / name
    assert sorted(tmp_path.iterdir()) == sorted(written)
    found = trimesh.load(written[0], file_type="obj", process=False)
    assert len(found.faces) == 12
    corner = found.vertices[found.faces]
    np.testing.assert_allclose(corner, atlas.mesh.vertices[atlas.mesh.faces], atol=1e-8)
    uv = (atlas.uv + 0.5) / atlas.size * [1, -1] + [0, 1]
    np.testing.assert_allclose(found.visual.uv[found.faces], uv, atol=1e-6)
    image = atlas_texture(dense, colours)
    assert np.array_equal(np.asarray(found.visual.material.image), image)
    assert np.array_equal(np.asarray(Image.open(written[2])), image)
    for companion in written[1:]:
        assert companion.name.isascii() and " " not in companion.name


def test_vtk_reads_the_obj_too(tmp_path):
    atlas, dense = box(8)
    path = export(tmp_path / "box.obj", atlas.mesh, atlas, dense, noise_colours(dense))[0]
    found = pyvista.read(path)
    assert found.n_cells == 12
    corner = found.points[found.regular_faces]
    np.testing.assert_allclose(corner, atlas.mesh.vertices[atlas.mesh.faces], atol=1e-6)
    normals = found.point_data["Normals"][found.regular_faces]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    np.testing.assert_allclose(normals, np.repeat(flat[:, None], 3, axis=1), atol=1e-5)


def test_obj_positions_are_not_torn_at_splits(tmp_path):
    atlas, dense = box(8)
    for surface, count in ((export_input(atlas.mesh, atlas), 8), (export_dense(dense), 6 * 64)):
        path = write_obj(tmp_path / "box.obj", surface, encode_png(np.zeros((4, 4, 3), np.uint8)))
        lines = path[0].read_text().splitlines()
        assert sum(line.startswith("v ") for line in lines) == count


def test_obj_keeps_its_digits_far_from_the_origin(tmp_path):
    atlas, dense = box(8, centre=(1e7, 2e7, -3e7), edge=1e-2)
    path = export(tmp_path / "far.obj", atlas.mesh, atlas, dense, noise_colours(dense))[0]
    found = trimesh.load(path, process=False)
    error = found.vertices[found.faces] - atlas.mesh.vertices[atlas.mesh.faces]
    assert np.abs(error).max() < 1e-8


def test_companions_never_share_a_name_by_accident(tmp_path):
    names = ["a b.obj", "a_b.obj", "ä.obj", "ö.obj", "兔.obj", "子.obj", "x.obj"]
    files = [each for name in names for each in obj_files(tmp_path / name)]
    assert len(set(files)) == 3 * len(names)
    assert obj_files(tmp_path / "brick.obj")[2].name != "brick.png"  # likely the sample itself


@pytest.mark.parametrize(
    ("centre", "edge"), [((0, 0, 0), 1.0), ((1e7, 0, 0), 0.5), ((0, 0, 0), 1e30)]
)
def test_ply_comes_back_with_colours(tmp_path, centre, edge):
    atlas, dense = box(8, centre=centre, edge=edge)
    colours = noise_colours(dense)
    (path,) = export(tmp_path / "box.ply", atlas.mesh, atlas, dense, colours)
    found = trimesh.load(path, process=False)
    assert np.array_equal(found.faces, dense.faces)
    assert np.abs(found.vertices - dense.vertices).max() <= 1e-6 * edge
    assert np.array_equal(found.visual.vertex_colors[:, :3], quantise(colours))
    other = pyvista.read(path)
    assert np.array_equal(other.regular_faces, dense.faces)
    assert np.array_equal(other.point_data["RGB"], quantise(colours))
    np.testing.assert_allclose(other.point_data["Normals"], dense.normals, atol=1e-6)


def test_ply_counts_must_agree(tmp_path):
    _, dense = box(4)
    with pytest.raises(InvalidParameter, match="96 vertices"):
        write_ply(
            tmp_path / "x.ply",
            dense.vertices,
            dense.normals,
            np.zeros((5, 3), np.uint8),
            dense.faces,
        )


@pytest.mark.parametrize("suffix", [".glb", ".GLB", ".obj", ".ply"])
@pytest.mark.parametrize("dense_shape", [False, True])
def test_every_known_suffix_is_written(tmp_path, suffix, dense_shape):
    atlas, dense = box(8)
    seen = []
    written = export(
        tmp_path / f"out{suffix}",
        atlas.mesh,
        atlas,
        dense,
        noise_colours(dense),
        dense_shape=dense_shape,
        source=gutter_source(dense),
        progress=lambda share, _: seen.append(share),
    )
    assert all(path.stat().st_size > 0 for path in written)
    assert seen == sorted(seen) and 0 <= seen[0] and seen[-1] <= 1


@pytest.mark.parametrize(
    ("name", "kind", "words"),
    [
        ("out.fbx", InvalidParameter, r"'\.fbx'.*\.glb, \.obj, \.ply"),
        ("out", InvalidParameter, "no suffix"),
        ("missing/out.glb", OutputFailed, "does not exist"),
        ("folder.glb", OutputFailed, "is a directory"),
    ],
)
def test_impossible_outputs_are_refused_before_long_work(tmp_path, name, kind, words):
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(kind, match=words):
        check_output(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.glb"]


def test_other_suffixes_can_be_asked_for(tmp_path):
    assert check_output(tmp_path / "q.npz", suffixes=(".npz",)) == tmp_path / "q.npz"
    with pytest.raises(InvalidParameter, match=r"known: \.npz"):
        check_output(tmp_path / "q.glb", suffixes=(".npz",))


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
def test_a_full_disk_keeps_the_older_files(tmp_path, monkeypatch, suffix):
    atlas, dense = box(6)
    path = tmp_path / f"out{suffix}"
    export(path, atlas.mesh, atlas, dense, noise_colours(dense))
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputFailed, match="disk is full"):
        export(path, atlas.mesh, atlas, dense, np.zeros((len(dense.vertices), 3), np.float32))
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
@pytest.mark.parametrize("at", [0.05, 0.45, 0.55])
def test_cancelling_leaves_nothing(tmp_path, suffix, at):
    atlas, dense = box(6)

    def progress(share, _):
        if share >= at:
            raise Cancelled

    path = tmp_path / f"out{suffix}"
    try:
        export(path, atlas.mesh, atlas, dense, noise_colours(dense), progress=progress)
    except Cancelled:
        assert list(tmp_path.iterdir()) == []
    else:
        assert path.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX limits")
def test_a_size_limit_hit_in_the_middle_leaves_nothing_in_any_format(tmp_path):
    code = (
        "import pathlib, resource, sys, numpy as np\n"
        "from btfcore.errors import OutputFailed\n"
        "from btfcore.files.export import export\n"
        "from btfcore.files.quilt_npz import write_quilt_npz\n"
        "from tests.boxes import box, quilt_on\n"
        "atlas, dense = box(32)\n"
        "quilt, field = quilt_on(dense)\n"
        "colours = np.zeros((len(dense.vertices), 3), np.float32)\n"
        "rest = atlas.mesh, atlas, dense, colours\n"
        "writers = [lambda: write_quilt_npz(sys.argv[1] + '/x.npz', dense, field, quilt)]\n"
        "for suffix in ('.glb', '.obj', '.ply'):\n"
        "    name = sys.argv[1] + '/x' + suffix\n"
        "    writers.append(lambda name=name: export(name, *rest, dense_shape=True))\n"
        "for write in writers:\n"
        "    write()  # compiled code is cached now, before the limit\n"
        "for path in pathlib.Path(sys.argv[1]).iterdir():\n"
        "    path.unlink()\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "for write in writers:\n"
        "    try:\n"
        "        write()\n"
        "    except OutputFailed as error:\n"
        "        assert 'size limit' in str(error), error\n"
        "    else:\n"
        "        sys.exit('no error')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, capture_output=True
    )
    assert done.returncode == 0, done.stderr.decode()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_an_export_killed_half_way_leaves_nothing_under_its_names(tmp_path):
    code = (
        "import sys, time, numpy as np\n"
        "from btfcore.files.export import export\n"
        "from tests.boxes import box\n"
        "atlas, dense = box(6)\n"
        "def progress(share, label):\n"
        "    if share > 0.6:\n"
        "        print('half', flush=True); time.sleep(60)\n"
        "export(sys.argv[1], atlas.mesh, atlas, dense,\n"
        "       np.zeros((len(dense.vertices), 3), np.float32), progress=progress)\n"
    )
    path = tmp_path / "out.obj"
    child = subprocess.Popen(
        [sys.executable, "-c", code, str(path)], cwd=ROOT, stdout=subprocess.PIPE
    )
    try:
        assert child.stdout.readline() == b"half\n"
        time.sleep(0.05)
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
        child.stdout.close()
    assert not any(each.exists() for each in obj_files(path))
