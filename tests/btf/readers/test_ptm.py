"""Polynomial texture maps give what their polynomial says, the right way up."""

import json
import struct

import numpy as np
import pytest

from btfcore.btf.colour import srgb_to_linear
from btfcore.btf.readers.pbr_relief import curled
from btfcore.btf.readers.ptm import looks_like_ptm, read_ptm
from btfcore.errors import InvalidBtf, InvalidParameter
from tests.btf.readers.sets import png, to_folder, to_zip

SCALE = [2.0, 1.5, 1.0, 0.5, 1.0, 2.0]
BIAS = [128, 120, 130, 100, 110, 0]


def ptm_bytes(coefficients, colours=None, scale=SCALE, bias=BIAS, breaks="\n"):
    """Write a PTM file of coefficients (H, W, 6) u1 and colours (H, W, 3) u1, or (3, H, W, 6)."""
    height, width = coefficients.shape[-3:-1]
    kind = "RGB" if colours is None else "LRGB"
    head = f"PTM_1.2\nPTM_FORMAT_{kind}\n{width}{breaks}{height}\n"
    head += " ".join(map(str, scale)) + breaks + " ".join(map(str, bias)) + "\n"
    if colours is None:
        return head.encode() + coefficients[:, ::-1].tobytes()
    return head.encode() + coefficients[::-1].tobytes() + colours[::-1].tobytes()


def expected(coefficients, light):
    """Σ (c − bias) scale b / 255 by a plain sum, (…,) f8."""
    u, v, _ = light
    basis = [u * u, v * v, u * v, u, v, 1]
    terms = [(coefficients[..., k].astype(float) - BIAS[k]) * SCALE[k] * basis[k] for k in range(6)]
    return np.maximum(sum(terms) / 255, 0)


@pytest.fixture
def maps():
    rng = np.random.default_rng(3)
    shape = (5, 7)
    return (
        rng.integers(90, 200, (*shape, 6), dtype=np.uint8),
        rng.integers(0, 255, (*shape, 3), dtype=np.uint8),
        rng.integers(90, 200, (3, *shape, 6), dtype=np.uint8),
    )


@pytest.mark.parametrize("breaks", ["\n", " "])
@pytest.mark.parametrize("coded", [True, False])
def test_files_give_the_polynomial(tmp_path, maps, breaks, coded):
    luminance, colours, triple = maps
    (tmp_path / "l.ptm").write_bytes(ptm_bytes(luminance, colours, breaks=breaks))
    (tmp_path / "rgb.ptm").write_bytes(ptm_bytes(triple, breaks=breaks) + b"tail")
    colour = "srgb" if coded else "linear"
    one = read_ptm(tmp_path / "l.ptm", colour=colour)
    two = read_ptm(tmp_path / "rgb.ptm", colour=colour)
    assert looks_like_ptm(tmp_path / "l.ptm")
    assert one.views.tolist() == [[0, 0, 1]]
    assert one.stack.shape == two.stack.shape == (81, 5, 7)
    assert any("4 bytes after" in note for note in two.notes)
    decode = srgb_to_linear if coded else (lambda values: values)
    for number in (0, 17, 80):
        light = one.lights[number]
        wanted = expected(luminance, light)[..., None] * colours / 255
        assert one.image(0, number) == pytest.approx(decode(wanted), abs=1e-5)
        wanted = np.moveaxis(expected(triple, light), 0, 2)
        assert two.image(0, number) == pytest.approx(decode(wanted), abs=1e-5)


def test_lights_of_one_s_own(tmp_path, maps):
    (tmp_path / "l.ptm").write_bytes(ptm_bytes(*maps[:2]))
    light = np.array([[0.6, 0, 0.8]])
    sample = read_ptm(tmp_path / "l.ptm", lights=light, colour="linear")
    wanted = expected(maps[0], light[0])[..., None] * maps[1] / 255
    assert sample.stack.read([0])[0] == pytest.approx(wanted, abs=1e-5)
    for wrong in ([[0, 0, 2]], [[0, 0.6, -0.8]], [0, 0, 1], [[0, 0, 1], [0, 0, 1]], "up"):
        with pytest.raises(InvalidParameter):
            read_ptm(tmp_path / "l.ptm", lights=wrong)
    with pytest.raises(InvalidParameter, match="xyz"):
        read_ptm(tmp_path / "l.ptm", colour="xyz")


@pytest.mark.parametrize("archive", [False, True])
def test_folders_agree_with_files(tmp_path, maps, archive, in_process):
    luminance, colours, triple = maps
    info = {"type": "LRGB_PTM", "scale": SCALE, "bias": BIAS}
    layers = [luminance[..., :3], luminance[..., 3:], colours]
    files = {f"layer{n + 1}.png": png(layer) for n, layer in enumerate(layers)}
    files["info.json"] = json.dumps({"PTM": info}).encode()
    six = {f"layer{k + 1}.png": png(np.moveaxis(triple[..., k], 0, 2).copy()) for k in range(6)}
    six["info.json"] = json.dumps({**info, "type": "RGB_PTM"}).encode()
    put = (lambda n, f: to_zip(tmp_path / f"{n}.zip", f)) if archive else None
    put = put or (lambda n, f: to_folder(tmp_path / n, f))
    (tmp_path / "l.ptm").write_bytes(ptm_bytes(luminance, colours))
    (tmp_path / "rgb.ptm").write_bytes(ptm_bytes(triple))
    for where, file in ((put("three", files), "l.ptm"), (put("six", six), "rgb.ptm")):
        assert looks_like_ptm(where)
        found = read_ptm(where).stack.read(range(81))
        assert np.array_equal(found, read_ptm(tmp_path / file).stack.read(range(81)))


def test_the_leaf_is_the_right_way_up(data):
    sample = read_ptm(data / "btf" / "rti_leaf_lrgb_ptm_512")
    assert sample.stack.shape == (81, 512, 512)
    images = sample.stack.read([0, 60, 80])
    assert np.isfinite(images).all() and images.min() >= 0
    assert 0.02 < images[0].mean() < 0.5
    assert images[0, ..., 1].mean() > 2 * images[0, ..., 2].mean()  # it is green, not blue
    assert images[0].mean() > images[1].mean()  # and brighter under a steep light
    # how brightness changes with the light shows slopes, which are free of curl only where
    # the light's second component points up in the picture
    up = [np.flatnonzero(np.linalg.norm(sample.lights - light, axis=1) < 1e-6)[0]
          for light in sample.lights[[1, 2, 3, 4, 5, 6]]]  # fmt: skip
    grey = sample.stack.read(up).mean(axis=3)
    slope = np.tensordot(np.linalg.pinv(sample.lights[up]), grey, axes=1)
    normal = np.moveaxis(slope / np.linalg.norm(slope, axis=0), 0, 2).astype(np.float32)
    assert curled(normal) is False


def test_cut_off_anywhere_and_every_wrong_header(tmp_path, maps):
    whole = ptm_bytes(*maps[:2])
    path = tmp_path / "x.ptm"
    for end in [*range(0, whole.index(b"\n2.0") + 60, 7), len(whole) - 1]:
        path.write_bytes(whole[:end])
        with pytest.raises(InvalidBtf) as caught:
            read_ptm(path)
        assert str(caught.value).startswith("x")
    cases = [
        (b"PTM_1.2", b"PTM_1.1", "PTM_1.1"),
        (b"FORMAT_LRGB", b"FORMAT_JPEG_LRGB", "JPEG-packed"),
        (b"FORMAT_LRGB", b"FORMAT_LUM", "chroma"),
        (b"FORMAT_LRGB", b"FORMAT_NEW", "unknown"),
        (b"\n7\n5\n", b"\n0\n5\n", "0 x 5"),
        (b"\n7\n5\n", b"\n-7\n5\n", "-7 x 5"),
        (b"\n7\n5\n", b"\n99999999999\n5\n", "99999999999 x 5"),
        (b"\n7\n5\n", b"\n7\n5000\n", "need 315,000 bytes"),
        (b"2.0 1.5", b"2.0 inf", "'inf'"),
        (b"2.0 1.5", b"2.0 1e99", "scale"),
        (b"128 120", b"128 120 7", "15 numbers"),
        (b"128 120", b"128 x", "'x'"),
        (b"PTM_1.2\nPTM", b"#HSH1.2\nPTM", "hemispherical"),
    ]
    for old, new, words in cases:
        assert old in whole
        path.write_bytes(whole.replace(old, new, 1))
        with pytest.raises(InvalidBtf, match=words):
            read_ptm(path)


INFOS = {
    b"": "JSON",
    b"[" * 100_000: "JSON",
    b"[1, 2]": "describes no RTI",
    b'{"type": "hsh"}': "'hsh'",
    b'{"type": ["LRGB_PTM"]}': "is not read",
    b'{"type": "LRGB_PTM", "scale": [1, 2], "bias": [1, 2]}': "scale",
    b'{"type": "LRGB_PTM", "scale": [1, 1, 1, 1, 1, NaN], "bias": [0, 0, 0, 0, 0, 0]}': "scale",
    b'{"type": "LRGB_PTM", "scale": [1, 1, 1, 1, 1, 1], "bias": [0, 0, 0, 0, 0, "0"]}': "bias",
    b'{"type": "LRGB_PTM", "scale": [1, 1, 1, 1, 1, 1], "bias": [0, 0, 0, 0, 0, 0]}': "layer3",
    struct.pack("<4x"): "JSON",
}


@pytest.mark.parametrize("info", INFOS, ids=range(len(INFOS)))
def test_descriptions_that_make_no_sense(tmp_path, info, in_process):
    layer = png(np.zeros((4, 4, 3), np.uint8))
    to_folder(tmp_path, {"info.json": info, "layer1.png": layer, "layer2.png": layer})
    with pytest.raises(InvalidBtf, match=INFOS[info]):
        read_ptm(tmp_path)
