"""A project reads back as it was written, in every bit."""

import json
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidParameter, OutputFailed, ProjectChanged
from btfcore.files.project.read import project_figures, project_token, read_project, verify
from btfcore.files.project.write import write_project
from tests.files.project.projects import differences, project


def full(one):
    """The project with its reports' figures filled up as a file has them."""
    from btfcore.files.project.schema import ReportEntry

    def figures(given):
        if given is None:
            return None
        known = ReportEntry().model_dump() | given
        return {k: tuple(v) if isinstance(v, list) else v for k, v in known.items()}

    edits = [replace(each, figures=figures(each.figures)) for each in one.edits]
    return replace(one, edits=tuple(edits))


@pytest.mark.parametrize("regions", [False, True])
def test_every_bit_comes_back(tmp_path, regions):
    one = project(regions)
    token = write_project(tmp_path / "a.patina", one)
    found = read_project(tmp_path / "a.patina")
    assert found.notes == ()
    assert differences(full(replace(one, token=token)), found) == []
    verify(tmp_path / "a.patina")
    assert project_token(tmp_path / "a.patina") == token


def test_a_project_read_and_written_again_is_the_same_file_but_for_its_token(tmp_path):
    write_project(tmp_path / "a.patina", project(), preview=np.zeros((4, 6, 3), np.uint8))
    write_project(tmp_path / "b.patina", read_project(tmp_path / "a.patina"))
    contents = []
    for name in ("a", "b"):
        with zipfile.ZipFile(tmp_path / f"{name}.patina") as archive:
            members = {each: archive.read(each) for each in archive.namelist()}
        manifest = json.loads(members.pop("manifest.json"))
        manifest.pop("token")
        contents.append((members, manifest))
    assert contents[0][0].pop("preview.png")[:4] == b"\x89PNG"
    assert contents[0] == contents[1]


def test_ghosts_within_patches_and_values_below_edits_are_not_stored(tmp_path):
    one = project()
    write_project(tmp_path / "a.patina", one)
    with zipfile.ZipFile(tmp_path / "a.patina") as archive:
        manifest = json.loads(archive.read("manifest.json"))
    edges, ghosts = manifest["quilt"]["half_edges"], manifest["quilt"]["ghosts"]
    assert 0 < ghosts < edges
    plain = [each["delta"] and each["delta"]["plain"] for each in manifest["edits"]]
    assert plain == [True, True, None, False, None]
    # fits in what the ground says: no ghosts of values before the edit
    assert manifest["edits"][0]["delta"]["before_ghosts"] == 0


def test_arrays_read_can_be_painted_on_and_values_cannot(tmp_path):
    write_project(tmp_path / "a.patina", project())
    found = read_project(tmp_path / "a.patina")
    state = found.background
    for array in (state.source, state.angle, state.sample, state.patch, state.ghost):
        assert array.flags.writeable
    assert not found.prepared.dense.vertices.flags.writeable
    assert not found.edits[0].delta.reads.flags.writeable


def test_figures_tell_what_is_in_it(tmp_path):
    token = write_project(tmp_path / "a.patina", project(True))
    figures = project_figures(tmp_path / "a.patina")
    json.dumps(figures, allow_nan=False)
    assert figures["save"] == token and figures["regions"] == ["low", "hïgh"]
    assert [each["name"] for each in figures["samples"]] == ["background", "crack"]
    assert [each["visible"] for each in figures["edits"]] == [True, False, False, False, False]
    assert figures["samples"][0]["factors"] == 4 and figures["samples"][0]["licence"] == "CC0"


def test_a_file_that_another_instance_saved_is_not_overwritten(tmp_path):
    path = tmp_path / "a.patina"
    first = write_project(path, project())
    second = write_project(path, project(), expected=first)
    before = path.read_bytes()
    with pytest.raises(ProjectChanged, match=f"{second[:8]}.*{first[:8]}.*another name"):
        write_project(path, project(), expected=first)
    assert path.read_bytes() == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.patina", "a.patina.bak"]
    path.write_bytes(b"something else")
    with pytest.raises(ProjectChanged, match="another file now"):
        write_project(path, project(), expected=second)
    path.unlink()  # nothing is lost where there is nothing
    write_project(path, project(), expected=second)


def test_the_backup_is_the_file_before(tmp_path):
    path = tmp_path / "a.patina"
    tokens = [write_project(path, project()) for _ in range(3)]
    assert project_token(path) == tokens[2]
    assert project_token(tmp_path / "a.patina.bak") == tokens[1]


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(InvalidParameter, match="ends in .patina"):
        write_project(tmp_path / "a.zip", project())
    assert list(tmp_path.iterdir()) == []


def test_figures_that_are_no_numbers_and_names_of_any_bytes_can_be_saved(tmp_path):
    one = project()
    first = replace(one.edits[0], figures={"seam": float("nan"), "notes": ()})
    stone = replace(one.materials[0], file="caf\udce9.btfz")
    write_project(
        tmp_path / "a.patina",
        replace(one, edits=(first, *one.edits[1:]), materials=(stone, *one.materials[1:])),
    )
    found = read_project(tmp_path / "a.patina")
    assert np.isnan(found.edits[0].figures["seam"])
    assert found.materials[0].file == "caf?.btfz"


def test_what_the_schema_has_no_room_for_is_named_and_nothing_is_written(tmp_path):
    one = project()
    stone = replace(one.materials[0], name="x" * 5000)
    with pytest.raises(OutputFailed, match="a.patina: .*name"):
        write_project(tmp_path / "a.patina", replace(one, materials=(stone,)))
    assert list(tmp_path.iterdir()) == []
