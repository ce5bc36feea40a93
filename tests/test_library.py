"""The library that ships: every file loads, and every file is credited and free to ship."""

import re

import numpy as np
import pytest

from btfcore import library
from btfcore.btf.image import read_image
from btfcore.errors import PatinaError
from btfcore.files.package.read import read_package, read_preview
from btfcore.mesh.reader import read_mesh

FREE = ("CC0", "public domain", "CC BY", "MIT", "Apache-2.0")
PICTURES = [*library.meshes(), *library.samples()]
EVERYTHING = [*PICTURES, *library.btf_samples()]


def credits() -> dict[str, list[str]]:
    """Rows of CREDITS.md by file name: source, licence, what was changed."""
    text = (library.resource_folder() / "CREDITS.md").read_text(encoding="utf-8")
    cells = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| `")]
    return {row[0].strip("`"): row[1:] for row in cells}


def test_there_is_something_to_choose_from():
    assert len(library.meshes()) >= 4
    assert len(library.samples()) >= 12


def test_credits_and_files_match():
    assert sorted(credits()) == sorted(path.name for path in EVERYTHING)


@pytest.mark.parametrize("name", [path.name for path in EVERYTHING])
def test_every_credit_names_source_free_licence_and_change(name):
    source, licence, changed = credits()[name]
    assert source
    assert licence.startswith(FREE)
    assert changed


def test_the_library_stays_small():
    assert sum(path.stat().st_size for path in PICTURES) < 6e6
    assert all(path.stat().st_size < 1e6 for path in PICTURES)
    assert sum(path.stat().st_size for path in library.btf_samples()) <= 40e6


def test_half_of_the_materials_have_an_imperfection():
    materials = [read_package(path) for path in library.btf_samples()]
    plain = [each for each in materials if each.mask is None]
    assert len(plain) >= 6 and len(materials) - len(plain) >= 6


@pytest.mark.parametrize("path", library.btf_samples(), ids=lambda path: path.name)
def test_every_material_is_a_btf_that_changes_with_light_and_view(path):
    material = read_package(path)
    assert material.factors.rank >= 12 and material.images == 81 * 81
    assert material.licence == "CC0" and material.texel_size > 0
    assert 128 <= min(material.shape) <= max(material.shape) <= 256
    above = material.image(0, 0)
    aside = material.image(0, 80)
    grazing = material.image(80, 0)
    assert 0.02 < above.mean() < 1
    assert aside.mean() < 0.8 * above.mean(), "light from the side is weaker"
    assert np.abs(grazing - above).mean() > 0.005
    assert read_preview(path).startswith(b"\x89PNG")
    if material.mask is not None:
        rim = np.concatenate(
            [material.mask[0], material.mask[-1], material.mask[:, 0], material.mask[:, -1]]
        )
        assert 0.01 < material.mask.mean() < 0.5, "most of it is background"
        assert material.mask.max() > 0.9 and rim.max() < 0.1, "the feature lies well inside"


@pytest.mark.parametrize("path", library.meshes(), ids=lambda path: path.name)
def test_every_mesh_is_clean_as_it_is(path):
    mesh, report = read_mesh(path)
    found = report.statistics
    assert found.nonmanifold_edges == 0
    assert found.components == 1
    assert found.boundary_loops == (1 if path.stem == "open_box" else 0)
    assert not report.notes
    assert np.isfinite(mesh.vertices).all()


@pytest.mark.parametrize("path", library.samples(), ids=lambda path: path.name)
def test_every_sample_shows_a_pattern(path):
    sample = read_image(path)
    height, width, colours = sample.colour.shape
    assert 128 <= min(height, width) <= max(height, width) <= 256
    assert colours == 3
    assert sample.colour.std() > 0.02
    assert re.fullmatch(r"[a-z_]+", path.stem)


def test_a_missing_library_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(library, "__file__", str(tmp_path / "btfcore" / "library.py"))
    monkeypatch.setattr(library, "find_spec", lambda name: None)
    with pytest.raises(PatinaError, match=re.escape(str(tmp_path))):
        library.resource_folder()
