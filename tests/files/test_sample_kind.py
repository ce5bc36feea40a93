"""Which sample a path holds: one is found wherever it lies, several are listed, none is said."""

import zipfile

import numpy as np
import pytest
from PIL import Image

from btfcore.btf.directions import layout
from btfcore.errors import InvalidBtf
from btfcore.files.package.write import write_package
from btfcore.files.sample_kind import find_sample
from btfcore.files.samples import open_sample, read_pbr_sized
from tests.btf.bricks import sample
from tests.btf.readers.hostile import SYMLINK, Member, archive

NAMED = ["tl000 pl000 tv000 pv000.png", "tl045 pl090 tv000 pv000.png"]
MAPS = ["a_albedo.png", "a_height.png"]


def pictures(folder, *names, shade=100):
    """Put pictures of 4 x 3 texels into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        Image.fromarray(np.full((3, 4, 3), shade, np.uint8)).save(folder / name)
    return folder


def ptm_file(path):
    """Write a PTM of 2 x 1 texels."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"PTM_1.2\nPTM_FORMAT_LRGB\n2\n1\n1 1 1 1 1 1\n0 0 0 0 0 0\n" + b"\x40" * 18)
    return path


def zipped(folder, path):
    """Pack a folder, with its name as the wrapper."""
    with zipfile.ZipFile(path, "w") as out:
        for file in sorted(folder.rglob("*.*")):
            out.write(file, file.relative_to(folder.parent))
    return path


@pytest.mark.parametrize("depth", ["", "download", "download/set 1"])
@pytest.mark.parametrize(("names", "kind"), [(NAMED, "named"), (MAPS, "pbr")])
def test_wrappers_do_not_matter(tmp_path, names, kind, depth):
    top = tmp_path / "top"
    pictures(top / depth, *names)
    (top / "licence.txt").write_text("free")
    assert find_sample(top).kind == kind
    assert find_sample(zipped(top, tmp_path / "top.zip")).kind == kind
    assert open_sample(top, layout="2x1x2x1", size=4).shape == (3, 4)


def test_a_lone_file_in_a_folder_is_the_sample(tmp_path):
    assert find_sample(ptm_file(tmp_path / "one" / "leaf.ptm").parent).path.name == "leaf.ptm"
    (tmp_path / "two").mkdir()
    package = write_package(tmp_path / "two" / "a.btfz", sample())
    assert find_sample(package.parent).kind == find_sample(package).kind == "package"
    assert find_sample(pictures(tmp_path / "three", "a.png")).kind == "image"
    with pytest.raises(InvalidBtf, match=r"leaf.ptm .* unpack"):
        find_sample(zipped(tmp_path / "one", tmp_path / "one.zip"))


def test_several_samples_are_listed(tmp_path):
    pictures(tmp_path / "bark", *MAPS)
    ptm_file(tmp_path / "rti" / "leaf.ptm")
    pictures(tmp_path / "felt", *NAMED)
    with pytest.raises(InvalidBtf, match="holds 3 samples") as caught:
        open_sample(tmp_path)
    for words in ("bark (PBR set)", "rti/leaf.ptm (PTM)", "felt (images named by"):
        assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_one_sample_among_other_pictures_is_not_taken(tmp_path):
    pictures(tmp_path / "bark", *MAPS)
    pictures(tmp_path / "holiday" / "rome", "one.png")
    with pytest.raises(InvalidBtf, match=r"holds bark \(PBR set\), but also images in holiday"):
        find_sample(tmp_path)


def test_a_thumbnail_above_the_maps_does_no_harm(tmp_path):
    pictures(tmp_path / "bark" / "textures", *MAPS)
    pictures(tmp_path / "bark", "preview.png")
    assert find_sample(tmp_path / "bark").path.name == "textures"


def test_what_was_baked_beside_the_maps_does_not_hide_them(tmp_path):
    write_package(pictures(tmp_path / "bark", *MAPS) / "baked.btfz", sample())
    assert find_sample(tmp_path / "bark").kind == "pbr"


def test_a_list_of_files_is_no_table_of_directions_of_a_pbr_set(tmp_path):
    folder = pictures(tmp_path / "bark", *MAPS)
    (folder / "files.csv").write_text("file,size\na_albedo.png,12\n")
    assert find_sample(folder).kind == "pbr"


def test_sets_in_one_folder_are_told_apart_by_a_map(tmp_path):
    folder = pictures(tmp_path / "maps", *MAPS)
    pictures(folder, "T_Moss_BC.png", "T_Moss_H.png", shade=30)
    with pytest.raises(InvalidBtf, match="one of the maps"):
        open_sample(folder)
    moss, other = (read_pbr_sized(folder / name, 4) for name in ("T_Moss_H.png", "a_albedo.png"))
    assert moss.name == "Moss" and moss.height is not None
    assert moss.albedo.max() < 0.1 < other.albedo.min()


def test_an_albedo_map_alone_is_a_flat_material(tmp_path):
    folder = pictures(tmp_path / "plain", "paint.png")
    for path in (folder, folder / "paint.png"):
        found = read_pbr_sized(path, 2)
        assert found.height is None and found.shape == (2, 2)
        assert any("flat" in note for note in found.notes)


def test_a_ptm_is_lit_as_the_layout_says(tmp_path):
    path = ptm_file(tmp_path / "leaf.ptm")
    assert np.allclose(open_sample(path, layout="6x2x5x3").lights, layout("6x2x5x3").lights)


@pytest.mark.parametrize(
    ("members", "reason"),
    [
        ([Member(b"../" + NAMED[0].encode(), b"x")], "leads out"),
        ([Member(NAMED[0].encode(), b"x", attributes=SYMLINK)], "is a link"),
        ([Member(NAMED[0].encode(), b"x", flags=1)], "encrypted"),
        ([Member(NAMED[0].encode(), bytes(999), method=8, size=1 << 29)], "would grow"),
        ([Member(NAMED[0].encode(), b"x")] * 2, "twice"),
    ],
)
def test_a_hostile_zip_is_refused_for_what_is_wrong_with_it(tmp_path, members, reason):
    path = tmp_path / "a.zip"
    path.write_bytes(archive(members))
    with pytest.raises(InvalidBtf, match=f"^a.zip: .*{reason}"):
        open_sample(path)


def test_a_file_called_btf_is_told_that_its_signature_is_unknown(tmp_path):
    (tmp_path / "a.btf").write_bytes(b"!XYZ08FCR" + bytes(400))
    with pytest.raises(InvalidBtf, match="XYZ08FC"):
        open_sample(tmp_path / "a.btf")


def test_where_there_is_nothing_it_is_said_what_would_be_something(tmp_path):
    with pytest.raises(InvalidBtf, match="no sample and no images"):
        find_sample(tmp_path)
    pictures(tmp_path, "one.png", "two.png")
    with pytest.raises(InvalidBtf, match="2 images, none named by its angles"):
        find_sample(tmp_path)
