"""Projects of older versions are read; what no version was is refused."""

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from btfcore.errors import InvalidProject
from btfcore.files.project import schema
from btfcore.files.project.migrate import STEPS, migrated
from btfcore.files.project.read import read_project
from btfcore.files.project.write import write_project
from tests.files.project.projects import differences, project

STORED = Path(__file__).with_name("version_0.patina")


def manifest_of(path):
    with zipfile.ZipFile(path) as archive:
        return json.loads(archive.read("manifest.json"))


def test_every_version_has_a_step_to_the_next():
    assert sorted(STEPS) == list(range(schema.VERSION))


def test_the_stored_file_of_version_0_reads_as_what_it_was(tmp_path):
    assert manifest_of(STORED)["version"] == 0
    found = read_project(STORED)
    assert found.notes == ("migrated from version 0 of the project format to 1",)
    one = project()
    crack = replace(one.materials[1], scale=1.0)  # version 0 had no scales
    one = replace(
        one, materials=(one.materials[0], crack), edits=one.edits[:2], token=found.token,
        notes=found.notes, patches=one.background.patches,
    )  # fmt: skip
    figures = [replace(each, figures=None) for each in found.edits]
    asked = [replace(each, figures=None) for each in one.edits]
    assert differences(replace(one, edits=asked), replace(found, edits=figures)) == []
    assert found.edits[0].figures["patches"] == 2


def test_saving_brings_it_to_the_newest_version(tmp_path):
    write_project(tmp_path / "a.patina", read_project(STORED))
    assert manifest_of(tmp_path / "a.patina")["version"] == schema.VERSION
    assert read_project(tmp_path / "a.patina").notes == ()


def test_migrating_leaves_the_given_manifest_alone():
    given = manifest_of(STORED)
    before = json.dumps(given)
    migrated(given, 0, 1, "x")
    assert json.dumps(given) == before


@pytest.mark.parametrize("part", ["knobs", "dense", "samples", "quilt", "layers"])
@pytest.mark.parametrize("wrong", [None, 3, "text", [3]])
def test_old_manifests_that_make_no_sense_are_refused_by_name(part, wrong):
    given = manifest_of(STORED)
    given[part] = wrong
    with pytest.raises(InvalidProject, match="x.patina: "):
        schema.from_json(json.dumps(given).encode(), "x.patina")
    del given[part]
    with pytest.raises(InvalidProject, match=f"version 0 makes no sense.*{part}"):
        schema.from_json(json.dumps(given).encode(), "x.patina")
