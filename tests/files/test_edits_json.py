"""Edits files: every knob there and back, and messages that name the field."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.files.edits_json import (
    Script,
    Source,
    from_json,
    read_edits,
    schema_text,
    to_json,
)
from btfcore.files.edits_schema import ENTRIES, AreaEntry, StrokeEntry, SymmetryEntry
from btfcore.paint.edits import KINDS, Area, EraseEdit, PaintEdit, Stroke, Symmetry
from tests.files.project.projects import differences, edits

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("background", "crack")


def file(*entries, **more):
    """Text of an edits file."""
    whole = {"format": "patina-edits", "version": 1, "edits": list(entries)} | more
    return json.dumps(whole).encode()


STROKE = {"points": [[0, 0, 0], [1.5, 0, 0]], "radius": 0.1}
PAINT = {"kind": "paint", "sample": "crack", "area": {"strokes": [STROKE]}}
STAMP = {"kind": "stamp", "sample": "crack", "point": [0, 0, 1]}


def stroke(**change):
    return {**PAINT, "area": {"strokes": [STROKE, {**STROKE, **change}]}}


def test_every_knob_has_its_field():
    for name, kind in KINDS.items():
        knobs = {item.name for item in fields(kind)} - {"uid"}
        assert set(ENTRIES[name].model_fields) == knobs | {"kind"}
    for kind, entry in ((Stroke, StrokeEntry), (Area, AreaEntry), (Symmetry, SymmetryEntry)):
        assert {item.name for item in fields(kind)} == set(entry.model_fields)


def test_defaults_are_those_of_the_edits():
    found = from_json(file(PAINT, STAMP, {"kind": "erase", "area": {"everywhere": True}},
                           {"kind": "repair", "area": {"region": "lid"}},
                           {"kind": "requilt", "area": {"faces": [0]}}))  # fmt: skip
    for edit in found.edits:
        given = {"sample", "area", "point"}
        for item in fields(edit):
            if item.name not in given and item.name != "symmetry":
                assert getattr(edit, item.name) == item.default, item.name
        assert differences(edit.symmetry, Symmetry()) == []


def test_every_bit_of_every_knob_comes_back():
    script = Script(edits(), NAMES, Source("background", Path("b.btfz"), None, True, 2.0), 7,
                    (Source("crack", Path("c/c.jpg"), Path("c/m.png"), True, 0.3),))  # fmt: skip
    found = from_json(to_json(script))
    order = [found.names.index("crack") if hasattr(each, "sample") else None for each in edits()]
    back = [
        type(each)(**{**{f.name: getattr(each, f.name) for f in fields(each)}, **new})
        for each, number in zip(found.edits, order, strict=True)
        for new in [{} if number is None else {"sample": 1}]
    ]
    assert differences(list(edits()), back) == []
    assert (found.background, found.seed, found.sources) == (
        script.background, script.seed, script.sources,
    )  # fmt: skip


def test_random_strokes_come_back(tmp_path):
    random = np.random.default_rng(0)
    for count in (1, 2, 1000):
        points = random.normal(size=(count, 3)) * 10.0 ** random.integers(-300, 300, (count, 1))
        mine = Stroke(points, 1e-300, -points, random.random(count), 0.1 + 0.2)
        edit = PaintEdit(area=Area((mine,)), sample=0, transition=5e-324)
        path = tmp_path / "e.json"
        path.write_bytes(to_json(Script((edit,), ("crack",))))
        assert differences(edit, read_edits(path).edits[0]) == []


def test_paths_are_of_the_files_folder(tmp_path):
    (tmp_path / "e.json").write_bytes(
        file(background={"sample": "b.btfz", "seed": 3, "scale": 2},
             samples={"crack": {"file": "../c.jpg", "mask": "m.png"}})
    )  # fmt: skip
    found = read_edits(tmp_path / "e.json")
    assert found.background.file == tmp_path / "b.btfz" and found.seed == 3
    assert found.sources[0].file == tmp_path / ".." / "c.jpg"
    text = json.loads(to_json(found, tmp_path))
    assert text["samples"]["crack"]["mask"] == "m.png"
    assert text["background"]["sample"] == "b.btfz"


def test_a_byte_order_mark_is_no_harm():
    assert len(from_json(b"\xef\xbb\xbf" + file(PAINT)).edits) == 1


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (stroke(pressure=[1, 1.5]), r"edits\[1\].area.strokes\[1\].pressure\[1\]: 1.5; .*to 1"),
        (stroke(pressure=[1, -0.1]), r"strokes\[1\].pressure\[1\]: -0.1; .*equal to 0"),
        (stroke(pressure=[float("nan"), 1]), r"strokes\[1\].pressure\[0\]: nan; .*finite"),
        (stroke(pressure=[1]), r"edits\[1\].area.strokes\[1\]: 1 pressures for 2 points"),
        (stroke(pressure=["1", 1]), r"pressure\[0\]: '1'; it should be a valid number"),
        (stroke(points=[]), r"edits\[1\].area.strokes\[1\].points: list of 0; .*at least 1"),
        (stroke(points=[[0, 0]]), r"strokes\[1\].points\[0\]: list of 2; .*at least 3"),
        (stroke(points=[[0, float("inf"), 0]]), r"points\[0\]\[1\]: inf; .*finite"),
        (stroke(points=3), r"strokes\[1\].points: 3; it should be a valid list"),
        (stroke(radius=0), r"strokes\[1\].radius: 0; it should be greater than 0"),
        (stroke(radius=float("nan")), r"strokes\[1\].radius: nan"),
        (stroke(radius=True), r"strokes\[1\].radius: True"),
        (stroke(normals=[[0, 0, 1]]), r"strokes\[1\]: normals of shape \(1, 3\) for 2 points"),
        (stroke(hardness=2), r"strokes\[1\].hardness: 2"),
        (stroke(radus=1), r"strokes\[1\].radus: there is no such field; 'radius' is meant"),
        ({**PAINT, "area": {}}, r"edits\[1\].area: the area of an edit is empty"),
        ({**PAINT, "area": {"vertices": [1]}}, r"edits\[1\].area: .*needs the rate"),
        ({**PAINT, "area": {"faces": [-1]}}, r"edits\[1\].area.faces\[0\]: -1"),
        ({**PAINT, "area": {"faces": [2**31]}}, r"edits\[1\].area.faces\[0\]: 2147483648"),
        ({**PAINT, "area": {"faces": []}}, r"edits\[1\].area.faces: list of 0"),
        ({**PAINT, "area": {"faces": [1.5]}}, r"edits\[1\].area.faces\[0\]: 1.5"),
        ({**PAINT, "wait": 1}, r"edits\[1\].wait: there is no such field; 'weight' is meant"),
        ({**PAINT, "weight": -1}, r"edits\[1\].weight: -1"),
        ({**PAINT, "weight": 1e9}, r"edits\[1\].weight: 1000000000.0; .*1000"),
        ({**PAINT, "orientation": "up"}, r"edits\[1\].orientation: 'up'; .*'field', 'search'"),
        ({**PAINT, "work_patch": 3}, r"edits\[1\].work_patch: 3"),
        ({**PAINT, "seed": -1}, r"edits\[1\].seed: -1"),
        ({**PAINT, "transition": float("inf")}, r"edits\[1\].transition: inf; .*finite"),
        ({**PAINT, "sample": 3}, r"edits\[1\].sample: 3; it should be a valid string"),
        ({**PAINT, "kind": "pant"}, r"edits\[1\].kind: 'pant'; there are .*'paint' is meant"),
        ({**PAINT, "kind": None}, r"edits\[1\].kind"),
        ({"sample": "crack"}, r"edits\[1\].kind: it is missing"),
        ({"kind": "paint", "sample": "crack"}, r"edits\[1\].area: it is missing"),
        ({**PAINT, "uid": 3}, r"edits\[1\].uid: there is no such field"),
        ({**PAINT, "symmetry": {"mirror": "xw"}}, r"edits\[1\].symmetry.mirror: 'xw'"),
        ({**PAINT, "symmetry": {"mirror": "xx"}}, r"edits\[1\].symmetry: symmetry across 'xx'"),
        ({**PAINT, "symmetry": {"radial": 65}}, r"edits\[1\].symmetry.radial: 65"),
        ({**PAINT, "symmetry": {"axes": "x"}}, r"symmetry.axes: .*'axis' is meant"),
        ({**STAMP, "scale": 50}, r"edits\[1\].scale: 50"),
        ({**STAMP, "point": [0, 0]}, r"edits\[1\].point: list of 2"),
        ({**STAMP, "feature": -1}, r"edits\[1\].feature: -1"),
        (3, r"edits\[1\]: 3"),
        (None, r"edits\[1\]: None"),
    ],
)  # fmt: skip
def test_a_wrong_field_is_named_by_its_path_and_value(tmp_path, entry, message):
    path = tmp_path / "wrong.json"
    path.write_bytes(file(PAINT, entry))
    with pytest.raises(InvalidEdit, match=r"wrong\.json: .*" + message):
        read_edits(path)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"version": 2}, "version: 2 is newer than 1"),
        ({"version": True}, "version: True"),
        ({"version": 0}, "version: 0; it should be 1"),
        ({"format": "json"}, "format: the file does not begin"),
        ({"edit": []}, "edit: there is no such field; 'edits' is meant"),
        ({"samples": {"crack": {"file": "a", "musk": "b"}}}, "samples.crack.musk: .*'mask' is"),
        ({"samples": {"crack": {"mask": "b"}}}, "samples.crack.file: it is missing"),
        ({"samples": {"": {"file": "a"}}}, "samples"),
        ({"samples": {"background": {"file": "a"}}}, "background: that is the background's"),
        ({"samples": {"c": {"file": "http://x/y.png"}}}, "file: 'http://x/y.png' is no path"),
        ({"samples": {"c": {"file": "\\\\host\\y.png"}}}, "samples.c.file: .* is no path"),
        ({"samples": {"c": {"file": "//host/y.png"}}}, "samples.c.file: .* is no path"),
        ({"samples": {"c": {"file": "a\0b"}}}, "samples.c.file: .* is no path"),
        ({"background": {"sample": "file:///etc/passwd"}}, "background.sample: .* is no path"),
        ({"background": {"sample": "a", "scale": 0}}, "background.scale: 0"),
        ({"background": {"sample": "a", "seed": 2**32}}, "background.seed: 4294967296"),
        ({"background": "a.png"}, "background: 'a.png'"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_named_by_its_field(more, message):
    with pytest.raises(InvalidEdit, match=message):
        from_json(file(PAINT, **more))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "no JSON"),
        (b"\xff", "no JSON"),
        (b"[" * 100_000, "no JSON"),
        (b"[]", "format"),
        (b'{"format": "patina-edits", "version": 1, "edits": [], "edits": []}', "'edits' is given"),
        (b'{"format": "patina-edits", "version": 1, "edits": ' + b'{"a":' * 900 + b"1" + b"}" * 901,
         "edits: object"),
        (b'{"format": "patina-edits", "version": ' + b"9" * 9999 + b"}", "no JSON"),
    ],
)  # fmt: skip
def test_text_that_is_no_edits_file(text, message):
    with pytest.raises(InvalidEdit, match=message):
        from_json(text)


def test_sizes_are_bounded(tmp_path, monkeypatch):
    path = tmp_path / "big.json"
    with path.open("wb") as stream:
        stream.truncate(1 << 30)  # sparse: a gigabyte that takes no disk
    with pytest.raises(InvalidEdit, match=r"big\.json: 1,073,741,824 bytes, up to"):
        read_edits(path)
    with pytest.raises(InvalidEdit, match="points: list of 100,001"):
        from_json(file(stroke(points=[[0, 0, 0]] * 100_001)))
    monkeypatch.setattr("btfcore.files.edits_json.LARGEST", 100)
    with pytest.raises(InvalidEdit, match="bytes of edits, up to 100 can be stored"):
        to_json(Script(edits(), NAMES))


def test_what_is_no_file_is_named(tmp_path):
    for path in (tmp_path / "nowhere.json", tmp_path, "nul\0.json"):
        with pytest.raises(InvalidEdit, match="no such file|null"):
            read_edits(path)


def test_samples_that_nobody_brings_are_named_with_the_nearest():
    script = from_json(file(PAINT, {**STAMP, "sample": "crak"}, samples={"crack": {"file": "a"}}))
    with pytest.raises(InvalidEdit, match=r"edits\[1\].sample: .* 'crak'; 'crack' is"):
        script.check_names(["background"])
    script.check_names(["background", "crak"])


def test_numbers_that_json_has_not_are_refused_when_writing():
    edit = PaintEdit(area=Area(everywhere=True), sample=0)
    object.__setattr__(edit, "transition", float("inf"))  # the edit itself refuses it
    with pytest.raises(InvalidEdit, match="not finite"):
        to_json(Script((edit,), ("a",)))


def test_names_that_no_file_holds_are_written_all_the_same():
    edit = EraseEdit(area=Area(everywhere=True), name="half \ud800 a character " + "x" * 5000)
    found = from_json(to_json(Script((edit,)))).edits[0]
    assert found.name.startswith("half ? a character") and len(found.name) == 4096


def test_an_area_with_empty_parts_is_written_without_them():
    empty = np.zeros(0, np.int32)
    edit = EraseEdit(area=Area(everywhere=True, faces=empty, vertices=empty, rate=4))
    assert from_json(to_json(Script((edit,)))).edits[0].area.faces is None


def test_the_schema_in_docs_is_the_one_that_is_read():
    """Write it anew with `python -m tests.files.test_edits_json`."""
    stored = json.loads((ROOT / "docs" / "edits.schema.json").read_text(encoding="utf-8"))
    assert stored == json.loads(schema_text())


def test_the_examples_in_docs_are_read():
    text = (ROOT / "docs" / "edits.md").read_text(encoding="utf-8")
    blocks = [part.split("```")[0] for part in text.split("```json\n")[1:]]
    assert len(blocks) >= 2
    kinds = {edit["kind"] for block in blocks for edit in json.loads(block)["edits"]}
    assert kinds == set(KINDS)
    for block in blocks:
        from_json(block.encode())


if __name__ == "__main__":
    (ROOT / "docs" / "edits.schema.json").write_text(schema_text(), encoding="utf-8")
