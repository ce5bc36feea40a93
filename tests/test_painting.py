"""The verbs of painting, from files to files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from btfcore.errors import Cancelled, InvalidEdit, InvalidImage, PatinaError, ProjectChanged
from btfcore.files.edits_json import Source, read_edits
from btfcore.files.png import encode_png
from btfcore.library import meshes
from btfcore.painting import (
    add_samples,
    apply_edits,
    at_rate,
    edit_figures,
    export_document,
    new_document,
    open_project,
    save_project,
)
from btfcore.pipeline import load_mesh
from btfcore.quilt.parameters import QuiltParameters
from btfcore.regions import RegionSamples
from btfcore.render.texture import vertex_colours
from btfcore.render.thumbnail import thumbnail
from tests.files.project.projects import differences
from tests.paint.scenes import bits, cracked, ready, spotted

KNOBS = QuiltParameters(work_patch=16)


def picture(path, values):
    path.write_bytes(encode_png(np.round(np.clip(values, 0, 1) * 255).astype(np.uint8)))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two pictures with their masks, and an edits file."""
    here = tmp_path_factory.mktemp("files")
    for sample in (cracked(), spotted()):
        picture(here / f"{sample.name}.png", sample.colour)
        picture(here / f"{sample.name}_mask.png", sample.mask)
    dense = ready().dense
    points = dense.vertices[[100, 130]].tolist()
    edits = [
        {"kind": "paint", "sample": "background",
         "area": {"strokes": [{"points": points[:1], "radius": 8 * dense.step}]}},
        {"kind": "stamp", "sample": "spots", "point": points[1], "feature": 0},
        {"kind": "erase", "name": "off", "visible": False, "area": {"everywhere": True}},
    ]  # fmt: skip
    text = {"format": "patina-edits", "version": 1, "edits": edits,
            "background": {"sample": "cracked.png", "mask": "cracked_mask.png"},
            "samples": {"spots": {"file": "spotted.png", "mask": "spotted_mask.png"}}}  # fmt: skip
    (here / "e.json").write_text(json.dumps(text))
    return here


def begun(folder):
    script = read_edits(folder / "e.json")
    return new_document(ready(), script.background, parameters=KNOBS)


@pytest.fixture(scope="module")
def painting(folder):
    made = begun(folder)
    apply_edits(made, folder / "e.json")
    return made


def test_a_script_is_painted_as_it_says(painting, folder):
    document = painting.document
    assert painting.names == ("background", "spots")
    assert [edit.name for edit in document.edits] == ["Paint 1", "Stamp 2", "off"]
    assert [getattr(edit, "sample", None) for edit in document.edits] == [0, 1, None]
    assert [layer.result is None for layer in document.layers] == [False, False, True]
    assert len(document.layers[1].result.delta.vertices) > 10
    assert set(np.unique(document.engine.state.sample)) == {0, 1}


def test_the_background_has_nothing_of_its_feature(folder):
    made = begun(folder)
    quilt = made.document.quilt()
    assert (quilt.patch >= 0).all()
    colours = vertex_colours(quilt, made.document.samples)
    yellow = (colours[:, 0] > 0.8) & (colours[:, 2] < 0.4)  # the colour of the crack
    assert not yellow.any()


def test_the_same_script_gives_the_same_bits(painting, folder):
    again = begun(folder)
    apply_edits(again, folder / "e.json")
    assert bits(again.document) == bits(painting.document)


def test_figures_of_edits_are_plain_json(painting):
    figures = [edit_figures(each, painting.names) for each in painting.document.layers]
    json.dumps(figures, allow_nan=False)
    stamp = figures[1]
    assert stamp["kind"] == "stamp" and stamp["sample"] == "spots" and stamp["patches"] == 1
    assert stamp["energy"] == pytest.approx(stamp["weight"] * stamp["constraint"] + stamp["smooth"])
    assert figures[2] == {
        "uid": 2, "name": "off", "kind": "erase", "visible": False, "sample": None,
    }  # fmt: skip


def test_a_project_opens_as_it_was_without_the_files_it_came_from(painting, tmp_path):
    path = tmp_path / "p.patina"
    picture = thumbnail(
        painting.document.prepared.dense, painting.document.quilt(), painting.document.samples
    )
    assert picture.shape == (256, 256, 3) and np.ptp(picture) > 50
    made = replace(painting)
    save_project(made, path, preview=picture)
    back = open_project(path)
    assert bits(back.document) == bits(painting.document)
    assert back.names == painting.names
    assert differences(list(painting.materials), list(back.materials)) == []
    assert (back.path, back.token) == (path, made.token)


def test_two_paintings_of_one_file_do_not_overwrite_each_other(painting, tmp_path):
    path = tmp_path / "p.patina"
    save_project(replace(painting), path)
    one, two = open_project(path), open_project(path)
    save_project(one, path)
    with pytest.raises(ProjectChanged, match="another Patina"):
        save_project(two, path)
    save_project(two, tmp_path / "q.patina")  # under another name both are kept
    save_project(one, path)


def test_edits_go_on_after_opening(painting, folder, tmp_path):
    path = tmp_path / "p.patina"
    save_project(replace(painting), path)
    back = open_project(path)
    apply_edits(back, folder / "e.json")  # brings "spots" again, which is the same sample
    assert back.names == ("background", "spots") and len(back.document.layers) == 6
    twice = begun(folder)
    apply_edits(twice, folder / "e.json")
    apply_edits(twice, folder / "e.json")
    assert bits(back.document) == bits(twice.document)


def test_another_sample_under_a_name_that_is_taken_is_refused(painting, folder):
    other = Source("spots", folder / "cracked.png", folder / "cracked_mask.png")
    scaled = Source("spots", folder / "spotted.png", folder / "spotted_mask.png", scale=0.5)
    for source in (other, scaled):
        with pytest.raises(InvalidEdit, match="another sample 'spots' already"):
            add_samples(painting, [source])


def test_samples_of_other_kinds_are_compared_by_colours_and_edits_made_anew(folder):
    brick = Path(__file__).resolve().parents[1] / "resources" / "samples" / "brick.btfz"
    made = new_document(ready(), brick, parameters=KNOBS)
    channels = made.document.samples[0].channels.shape[2]
    assert channels > 3
    made.document.add(read_edits(folder / "e.json").edits[2])
    add_samples(made, [Source("spots", folder / "spotted.png", folder / "spotted_mask.png")])
    assert made.document.samples[0].channels.shape[2] == 3
    assert any("compared by their colours" in note for note in made.notes)
    assert made.materials[0].btf.factors is not None  # it can still be lit anew


def test_a_script_that_fails_says_where_and_keeps_what_was_made(folder, tmp_path):
    made = begun(folder)
    text = json.loads((folder / "e.json").read_text())
    text["samples"]["spots"] = {
        key: str(folder / name) for key, name in text["samples"]["spots"].items()
    }
    text["edits"][1]["point"] = [50, 0, 0]
    (tmp_path / "far.json").write_text(json.dumps(text))
    with pytest.raises(InvalidEdit, match=r"far\.json: edits\[1\]: .*50"):
        apply_edits(made, tmp_path / "far.json")
    assert [edit.name for edit in made.document.edits] == ["Paint 1"]
    text["edits"][1]["sample"] = "spot"
    (tmp_path / "far.json").write_text(json.dumps(text))
    with pytest.raises(InvalidEdit, match=r"far\.json: edits\[1\].sample: .*'spots' is meant"):
        apply_edits(made, tmp_path / "far.json")


def test_samples_that_are_gone_or_make_no_sense_are_named(folder):
    made = begun(folder)
    before = bits(made.document)
    with pytest.raises(PatinaError, match="nowhere.png"):
        add_samples(made, [Source("x", folder / "nowhere.png")])
    with pytest.raises(InvalidImage, match="mask|size"):
        small = picture(folder / "small.png", np.eye(8))
        add_samples(made, [Source("x", folder / "spotted.png", small)])
    for values in (np.zeros((96, 96)), np.ones((96, 96))):
        with pytest.raises(InvalidImage, match="%"):
            add_samples(made, [Source("x", folder / "spotted.png",
                                      picture(folder / "plain.png", values))])  # fmt: skip
    assert made.names == ("background",) and bits(made.document) == before


def test_cancelling_a_script_keeps_the_edits_that_are_done(folder):
    made = begun(folder)

    def progress(fraction, label):
        if len(made.document.layers) == 1 and fraction > 0.4:
            raise Cancelled

    with pytest.raises(Cancelled):
        apply_edits(made, folder / "e.json", progress=progress)
    assert len(made.document.layers) == 1
    assert len(made.document.replay()) == 0


def test_another_rate_shows_the_same_picture(painting, tmp_path):
    coarse, at = painting.document, {}
    for rate in (96, 192):
        at[rate] = at_rate(painting, rate)
    assert at[96][0] is coarse.prepared
    fine, quilt = at[192]
    assert (quilt.patch >= 0).all() and len(fine.dense.vertices) > 3 * len(at[96][1].patch)
    _, near = cKDTree(fine.dense.vertices).query(coarse.prepared.dense.vertices)
    one = vertex_colours(at[96][1], coarse.samples)
    two = vertex_colours(quilt, coarse.samples)[near]
    assert np.sqrt(((one - two) ** 2).mean()) < 0.05
    shares = [
        np.bincount(each.sample, minlength=2) / len(each.sample) for each in (at[96][1], quilt)
    ]
    assert np.abs(shares[0] - shares[1]).max() < 0.01
    files = export_document(tmp_path / "o.glb", painting, rate=192)
    assert files[0].read_bytes()[:4] == b"glTF"


def test_regions_have_samples_of_their_own_and_come_back(folder, tmp_path):
    box = next(path for path in meshes() if path.name == "open_box.obj")
    labels = tmp_path / "labels.json"
    count = len(load_mesh(box)[0].faces)
    labels.write_text(json.dumps([int(at > count // 2) for at in range(count)]))
    regions = RegionSamples(str(labels), (f"1={folder / 'spotted.png'}",), (), ("soft",))
    made = new_document(box, folder / "cracked.png", rate=64, parameters=KNOBS, regions=regions)
    assert made.names == ("background", "spotted")
    assert set(np.unique(made.document.engine.state.sample)) == {0, 1}
    save_project(made, tmp_path / "p.patina")
    back = open_project(tmp_path / "p.patina")
    assert bits(back.document) == bits(made.document)
    bare = replace(made.plan, files=tuple(Path(file.name) for file in made.plan.files))
    assert differences(bare, back.plan) == []
    assert str(folder).encode() not in (tmp_path / "p.patina").read_bytes()
    fine, quilt = at_rate(back, 128)
    assert (quilt.patch >= 0).all() and len(fine.dense.vertices) > len(back.document.quilt().patch)
