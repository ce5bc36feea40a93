"""What is written comes back; independent code reads it; the same sample makes the same bytes."""

import io
import json
import zipfile

import numpy as np
import pytest
from PIL import Image
from safetensors.numpy import load

from btfcore.btf.sample import Encoding, full_index
from btfcore.btf.stack import ArrayStack
from btfcore.errors import InvalidParameter
from btfcore.files.package.container import members
from btfcore.files.package.read import is_package, read_package, read_preview
from btfcore.files.package.write import write_package
from tests.btf.bricks import factors, images, sample

DETAILS = {
    "mask": np.linspace(0, 1, 48, dtype=np.float32).reshape(6, 8),
    "tiles": True,
    "texel_size": 0.25,
    "cosine": False,
    "licence": "CC0",
    "citation": "Someone, “Stoff”, 2026",
    "origin": "made for a test",
    "notes": ("one", "two"),
}


def same_details(one, two):
    for name in ("name", "tiles", "texel_size", "cosine", "licence", "citation", "origin", "notes"):
        assert getattr(one, name) == getattr(two, name), name
    for name in ("views", "lights", "index"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    assert np.abs(one.mask - two.mask).max() <= 0.5 / 65535 + 1e-7


def test_factors_come_back(tmp_path):
    knee = Encoding("logluma", 1e-4, 2.5)
    whole = sample(factors=factors(encoding=knee), **DETAILS)
    path = write_package(tmp_path / "Größe.btfz", whole)
    back = read_package(path)
    same_details(back, whole)
    assert back.factors.encoding == knee and back.factors.error == 0.125
    for name in ("weights", "basis"):
        wanted = getattr(whole.factors, name)
        assert np.array_equal(getattr(back.factors, name), wanted.astype(np.float16)), name
    for name in ("mean", "singular"):
        assert np.array_equal(getattr(back.factors, name), getattr(whole.factors, name)), name
    exact = read_package(write_package(tmp_path / "exact.btfz", whole, full_floats=True))
    assert np.array_equal(exact.factors.weights, whole.factors.weights)
    assert back.stack.shape == (60, 6, 8)
    assert np.isfinite(back.image(1, 2)).all()


def test_factors_beyond_half_floats_are_kept_whole(tmp_path):
    large = factors()
    big = type(large)(
        large.weights * np.float32(1e5), large.basis, large.mean, large.singular, large.encoding
    )
    back = read_package(write_package(tmp_path / "a.btfz", sample(factors=big)))
    assert np.array_equal(back.factors.weights, big.weights)


def test_images_come_back_from_the_mapped_file(tmp_path):
    stored = images()
    stored[7, 1, 1, 0] = 3e6  # beyond half floats: its image is scaled
    index = full_index(5, 12)
    index[0, 1] = -1
    index[index > 0] -= 1
    keep = np.delete(stored, 1, axis=0)
    whole = sample(stack=ArrayStack(keep), index=index, **DETAILS)
    path = write_package(tmp_path / "images.btfz", whole)
    back = read_package(path)
    same_details(back, whole)
    assert isinstance(back.stack.images, np.memmap) and not back.stack.images.flags.writeable
    got = back.stack.read(np.arange(59))
    assert (np.abs(got - keep) <= keep * 2.0**-11 + 64 * 2.0**-24).all()
    exact = read_package(write_package(tmp_path / "full.btfz", whole, full_floats=True))
    assert np.array_equal(exact.stack.read(np.arange(59)), keep)


@pytest.mark.parametrize("contents", ["factors", "images"])
def test_independent_code_reads_it(tmp_path, contents):
    whole = sample(factors=factors(), **DETAILS)
    picture = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    path = write_package(tmp_path / "a.btfz", whole, contents=contents, preview=picture)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == ["manifest.json", "preview.png", f"{contents}.safetensors"]
        assert {info.compress_type for info in archive.infolist()} == {zipfile.ZIP_STORED}
        tensors = load(archive.read(f"{contents}.safetensors"))
        manifest = json.loads(archive.read("manifest.json"))
    assert np.allclose(manifest["views"], whole.views, atol=0)
    if contents == "factors":
        made = tensors["weights"].astype(np.float32) @ tensors["basis"][17].astype(np.float32).T
        made += tensors["mean"][17]
        assert manifest["encoding"]["name"] == "sqrt"
        assert np.abs(np.clip(made, 0, None) ** 2 - read_package(path).image(1, 5)).max() < 1e-5
    else:
        assert np.array_equal(tensors["images"], images().astype(np.float16))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(read_preview(path)))), picture)


def test_large_members_begin_at_a_multiple_of_64(tmp_path):
    path = write_package(tmp_path / "a.btfz", sample())
    assert all(member.start % 64 == 0 for member in members(path).values())
    assert is_package(path) and not is_package(__file__ and tmp_path / "absent")


def test_the_same_sample_makes_the_same_bytes(tmp_path):
    one = write_package(tmp_path / "one.btfz", sample(factors=factors())).read_bytes()
    two = write_package(tmp_path / "two.btfz", sample(factors=factors())).read_bytes()
    assert one == two


def test_wrong_requests_are_refused(tmp_path):
    with pytest.raises(InvalidParameter, match="ends in .btfz"):
        write_package(tmp_path / "a.zip", sample())
    with pytest.raises(InvalidParameter, match="no factors"):
        write_package(tmp_path / "a.btfz", sample(), contents="factors")
    with pytest.raises(InvalidParameter, match="'pictures'"):
        write_package(tmp_path / "a.btfz", sample(), contents="pictures")
    assert list(tmp_path.iterdir()) == []
