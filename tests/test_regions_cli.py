"""Several samples on one mesh, as a user asks for them."""

import json

import numpy as np
import pytest

from btfcore.errors import InvalidRegions
from btfcore.library import meshes, samples
from btfcore.regions import RegionSamples, plan_samples, region_table
from btfcore.types import Mesh
from tests.test_cli import patina

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)


@pytest.fixture
def mesh():
    names = ("Metal", "Wood", "a=b", "x|y")
    return Mesh(POINTS, FACES, np.arange(4, dtype=np.int32), names)


def planned(mesh, **words):
    plan = plan_samples(mesh, "default.png", RegionSamples(**words))
    return {
        name: (plan.files[plan.sample[each]].name, plan.scales[plan.sample[each]])
        for each, name in enumerate(plan.names)
    }, plan


def test_samples_go_where_they_are_named_whatever_the_order(mesh):
    entries = ["Wood=w.png", "a=b=c=d.png", "Metal=m.png"]
    found, plan = planned(mesh, samples=entries, scales=["Wood=2"])
    assert found == {
        "Metal": ("m.png", 1.0), "Wood": ("w.png", 2.0), "a=b": ("c=d.png", 1.0),
        "x|y": ("default.png", 1.0),
    }  # fmt: skip
    _, turned = planned(mesh, samples=entries[::-1], scales=["Wood=2"])
    assert (turned.files, turned.sample, turned.scales) == (plan.files, plan.sample, plan.scales)


def test_one_file_is_one_sample_unless_its_scale_differs(mesh):
    _, plan = planned(mesh, samples=["Wood=m.png", "Metal=m.png"])
    assert plan.sample == (0, 0, 1, 1)
    _, plan = planned(mesh, samples=["Wood=m.png", "Metal=m.png"], scales=["Wood=0.5"])
    assert plan.sample == (0, 1, 2, 2)
    _, plan = planned(mesh, samples=[f"{name}=m.png" for name in mesh.region_names])
    assert plan.sample == (0, 0, 0, 0) and "covers no region" in plan.notes[0]


def test_borders_are_hard_unless_said_otherwise(mesh):
    assert planned(mesh)[1].borders.hard
    assert not planned(mesh, borders=["soft"])[1].borders.hard
    borders = planned(mesh, borders=["x|y|Wood=soft", "soft", "Metal|a=b=hard"])[1].borders
    assert borders.pairs.tolist() == [[3, 1], [0, 2]] and borders.kinds.tolist() == [False, True]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"samples": ["Metal"]}, "is not REGION=FILE"),
        ({"samples": ["=m.png"]}, "is not REGION=FILE"),
        ({"samples": ["Metal="]}, "is not REGION=FILE"),
        ({"samples": ["metal=m.png"]}, "no region 'metal'; it has 'Metal', 'Wood', 'a=b', 'x|y'"),
        ({"samples": ["Wood=a.png", "Wood=b.png"]}, "'Wood' twice"),
        ({"scales": ["Wood"]}, "is not REGION=NUMBER"),
        ({"scales": ["Wood=large"]}, "Wood=large: not a number"),
        ({"scales": ["Wood=nan"]}, "Wood=nan: not a number"),
        ({"scales": ["Wood=-1"]}, "Wood=-1: not a number"),
        ({"scales": ["Stone=1"]}, "no region 'Stone'"),
        ({"borders": ["firm"]}, "neither soft, hard"),
        ({"borders": ["Metal=soft"]}, "neither soft, hard"),
        ({"borders": ["Metal|Wood"]}, "neither soft, hard"),
        ({"borders": ["Metal|Stone=soft"]}, "no region 'Stone'"),
        ({"borders": ["Metal|Metal=soft"]}, "'Metal' twice"),
    ],
)
def test_wrong_words_are_named(mesh, words, reason):
    with pytest.raises(InvalidRegions) as caught:
        planned(mesh, **words)
    assert reason in str(caught.value)


def test_a_mesh_without_regions_is_one():
    plain = Mesh(POINTS, FACES)
    assert [row["name"] for row in region_table(plain)] == ["all"]
    with pytest.raises(InvalidRegions, match="no region 'Metal'; it has 'all'"):
        planned(plain, samples=["Metal=m.png"])


@pytest.fixture(scope="module")
def spot():
    return next(path for path in meshes() if "spot" in path.name)


@pytest.fixture(scope="module")
def halves(spot, tmp_path_factory):
    """Labels of the spot's faces: above or below the middle."""
    from btfcore.mesh.reader import read_mesh

    mesh, _ = read_mesh(spot)
    rows = [line.split()[1:] for line in spot.read_text().splitlines() if line.startswith("f ")]
    points = [line.split()[1:4] for line in spot.read_text().splitlines() if line.startswith("v ")]
    height = np.array(points, float)[:, 1]
    middle = np.median(mesh.vertices[:, 1])
    labels = [
        "top" if np.mean([height[int(c.split("/")[0]) - 1] for c in row]) > middle else "bottom"
        for row in rows
    ]
    path = tmp_path_factory.mktemp("labels") / "halves.json"
    path.write_text(json.dumps(labels))
    return path


@pytest.mark.parametrize("border", ["hard", "soft"])
def test_two_samples_meet_on_one_surface(tmp_path, spot, halves, border):
    one, two = samples()[0], samples()[5]
    words = (
        "decorate", spot, one, "-o", tmp_path / "out.glb", "--rate", 128, "--regions", halves,
        "--sample", f"top={two}", "--border", border, "--border-width", 6,
        "--save-quilt", tmp_path / "q.npz", "--report", tmp_path / "r.json",
        "--preview", tmp_path / "p.png",
    )  # fmt: skip
    done = patina(*words)
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    by_name = {row["name"]: row for row in report["regions"]}
    assert by_name["top"]["sample"] == two.name and by_name["bottom"]["sample"] == one.name
    with np.load(tmp_path / "q.npz", allow_pickle=False) as quilt:
        assert (quilt["patch"] >= 0).all()
        count = np.bincount(quilt["sample"], minlength=2)
    assert [part["vertices"] for part in report["samples"]] == count.tolist()
    kept = [row["kept"] for row in report["regions"]]
    if border == "hard":
        assert kept == [1.0, 1.0] and report["soft_borders"]["seam_edges"] == 0
    else:
        assert min(kept) < 1.0 and min(kept) > 0.6 and report["soft_borders"]["seam_edges"] > 0
    names = ("out.glb", "q.npz", "p.png")
    before = [(tmp_path / name).read_bytes() for name in names]
    assert patina(*words).returncode == 0
    assert [(tmp_path / name).read_bytes() for name in names] == before


def test_regions_are_listed(spot, halves):
    done = patina("regions", spot, "--by", halves)
    assert done.returncode == 0, done.stderr
    assert sorted(line.split("\t")[0] for line in done.stdout.splitlines()) == ["bottom", "top"]
    assert patina("regions", spot).stdout.startswith("all\t")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--sample", "Metal"], "is not REGION=FILE"),
        (["--sample", "Metal=x.png"], "no region 'Metal'; it has 'top', 'bottom'"),
        (["--border", "top|left=soft"], "no region 'left'"),
        (["--border-width", "-1"], "border is -1"),
        (["--sample", "top=absent.png"], "absent.png"),
    ],
)
def test_bad_words_end_with_one_line(tmp_path, spot, halves, words, reason):
    output = tmp_path / "x.glb"
    done = patina("decorate", spot, samples()[0], "-o", output, "--regions", halves, *words)
    assert done.returncode == 2 and not output.exists()
    assert reason in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(("labels", "reason"), [([1, 2], "2 labels"), (None, "negative")])
def test_labels_that_do_not_fit_end_with_one_line(tmp_path, spot, halves, labels, reason):
    path = tmp_path / "labels.json"
    count = len(json.loads(halves.read_text()))
    path.write_text(json.dumps([-1] * count if labels is None else labels))
    done = patina("decorate", spot, samples()[0], "-o", tmp_path / "x.glb", "--regions", path)
    assert done.returncode == 2 and reason in done.stderr and "Traceback" not in done.stderr


def test_a_real_mesh_of_four_parts_takes_four_samples(data):
    from btfcore.pipeline import decorate
    from btfcore.regions import vertex_regions
    from btfcore.report import region_report

    files = samples()[:4]
    asked = RegionSamples("components", [f"{part}={files[part]}" for part in (1, 2, 3)])
    done = decorate(data / "meshes" / "shaderball.glb", files[0], rate=128, regions=asked)
    region = vertex_regions(done.prepared.mesh, done.prepared.dense)
    assert [sample.name for sample in done.samples] == [files[k].stem for k in (1, 2, 3, 0)]
    assert (done.quilt.patch >= 0).all() and np.array_equal(done.quilt.sample, region)
    assert [row["kept"] for row in region_report(done)["regions"]] == [1.0] * 4
