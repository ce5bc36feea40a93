"""Packages from anywhere: a sample or a named error, quickly and in little memory."""

import tracemalloc
import zipfile

import pytest

from btfcore.errors import InvalidBtf, PatinaError
from btfcore.files.package.read import read_package
from tests.files.package.mutate import check, mutants, originals, repacked


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    return originals(tmp_path_factory.mktemp("originals"))


def refused(tmp_path, data, message):
    path = tmp_path / "bad.btfz"
    path.write_bytes(data)
    before = sorted(tmp_path.iterdir())
    tracemalloc.start()
    try:
        with pytest.raises(InvalidBtf, match=message) as caught:
            read_package(path)
        assert tracemalloc.get_traced_memory()[1] < 50 << 20
    finally:
        tracemalloc.stop()
    assert str(caught.value).startswith("bad.btfz: ")
    assert sorted(tmp_path.iterdir()) == before


def changed(**values):
    return lambda manifest: manifest | values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed(version=2), "version 2 of the package format is newer than 1"),
        (changed(version="1"), "version"),
        (changed(format="other"), "does not say"),
        (changed(width=0), "width"),
        (changed(width=2**31 + 1), "width"),
        (changed(width=9), r"shape \(6, 8, 4\), not \(6, 9, 4\)"),
        (changed(images=59), r"not \(59, 3"),
        (changed(views=[]), "views"),
        (changed(views=[[0, 0]]), "views"),
        (changed(views=[[0.0, 0.0, 1.0]] * 5), "same direction"),
        (changed(lights=[[0.0, 0.0, 2.0]] * 12), "light 0 is no unit vector"),
        (changed(encoding=None), "without an encoding"),
        (changed(encoding={"name": "pickle", "epsilon": 1.0}), "encoding.name"),
        (changed(encoding={"name": "log", "epsilon": 0.0}), "encoding.epsilon"),
        (changed(texel_size_mm=-1.0), "texel_size_mm"),
        (changed(name="x" * 5000), "name"),
        (lambda manifest: [manifest], "does not say"),
        (lambda manifest: {k: v for k, v in manifest.items() if k != "views"}, "views"),
    ],
)
def test_manifests_that_lie(tmp_path, packages, change, message):
    refused(tmp_path, repacked(packages[0], tmp_path, manifest=change), message)


def tensor(name, **values):
    return lambda header: header | {name: header[name] | values}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (tensor("weights", shape=[2**62, 2**62]), "weights"),
        (tensor("weights", shape=[-6, -8, 4]), "whole number"),
        (tensor("weights", shape=[6, 8, 4.0]), "whole number"),
        (tensor("weights", shape=[8, 6, 4]), r"shape \(8, 6, 4\), not"),
        (tensor("weights", shape=[1] * 9), "weights"),
        (tensor("weights", dtype="O"), "makes no sense"),
        (tensor("weights", data_offsets=[0, 2**63]), "lies at"),
        (tensor("weights", data_offsets=[9, 3]), "lies at"),
        (tensor("basis", data_offsets=[0, 1440]), "begins at"),
        (
            lambda header: {k: v for k, v in header.items() if k != "basis"},
            "begins at",
        ),
        (lambda header: "pickle", "makes no sense"),
    ],
)
def test_tensor_headers_that_lie(tmp_path, packages, change, message):
    refused(tmp_path, repacked(packages[0], tmp_path, header=change), message)


def test_a_deeply_nested_manifest(tmp_path, packages):
    data = repacked(packages[0], tmp_path)
    path = tmp_path / "bad.btfz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("manifest.json", "[" * 100_000)
    refused(tmp_path, path.read_bytes(), "no JSON")
    assert data


@pytest.mark.parametrize("name", ["../manifest.json", "/manifest.json", "C:\\manifest.json"])
def test_names_that_lead_elsewhere_are_never_followed(tmp_path, packages, name):
    data = repacked(packages[0], tmp_path, names=lambda old: name if old[0] == "m" else old)
    refused(tmp_path, data, "no manifest.json")


def test_compressed_members_are_refused(tmp_path, packages):
    data = repacked(packages[0], tmp_path, method=zipfile.ZIP_DEFLATED)
    refused(tmp_path, data, "is compressed")


def test_members_named_twice_are_refused(tmp_path, packages):
    path = tmp_path / "bad.btfz"
    path.write_bytes(packages[0])
    with pytest.warns(UserWarning), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("manifest.json", "{}")
    refused(tmp_path, path.read_bytes(), "two members are named 'manifest.json'")


def test_encrypted_members_are_refused(tmp_path, packages):
    data = bytearray(packages[0])
    place = data.index(b"PK\1\2")
    data[place + 8] |= 1
    refused(tmp_path, bytes(data), "encrypted")


def test_a_hundred_thousand_members_are_refused_unread(tmp_path):
    path = tmp_path / "bad.btfz"
    with zipfile.ZipFile(path, "w") as archive:
        for number in range(100):
            archive.writestr(str(number), b"")
    refused(tmp_path, path.read_bytes(), "100 members")


def test_a_bit_of_the_factors_turned_is_noticed(tmp_path, packages):
    data = bytearray(packages[0])
    data[data.index(b".safetensors") + 2000] ^= 1
    refused(tmp_path, bytes(data), "checksum")


@pytest.mark.parametrize("kind", [0, 1], ids=["factors", "images"])
def test_cut_off_at_any_byte(tmp_path, packages, kind):
    data = packages[kind]
    path = tmp_path / "cut.btfz"
    places = {*range(0, 200), *range(len(data) - 700, len(data)), *range(200, len(data), 997)}
    for place in sorted(places):
        path.write_bytes(data[:place])
        with pytest.raises(PatinaError):
            read_package(path)


@pytest.mark.parametrize("kind", [0, 1], ids=["factors", "images"])
def test_random_damage_ends_in_a_sample_or_a_named_error(tmp_path, packages, kind):
    path = tmp_path / "mutant.btfz"
    for mutant in mutants(packages[kind], 200, seed=kind):
        path.write_bytes(mutant)
        check(path)


def test_unknown_parts_are_ignored_with_a_note(tmp_path, packages):
    path = tmp_path / "new.btfz"
    path.write_bytes(repacked(packages[0], tmp_path, manifest=changed(colour_of_the_day="red")))
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("evil.pkl", b"cos\nsystem\n")
    notes = " ".join(read_package(path).notes)
    assert "colour_of_the_day" in notes and "evil.pkl" in notes
