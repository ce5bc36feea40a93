"""DFMF files as written, read by a decoder of the test's own and by ours."""

import struct

import numpy as np
import pytest

import btfcore.btf.bonn.svd as svd
import btfcore.files.bonn_dfmf as writer
from btfcore.btf.bonn.reader import read_bonn
from btfcore.btf.sample import BtfSample, full_index, subset
from btfcore.btf.stack import ArrayStack
from btfcore.errors import Cancelled, InvalidBtf, InvalidParameter, OutputFailed
from btfcore.files.bonn_dfmf import write_dfmf
from btfcore.progress import silent

VIEWS, LIGHTS, HEIGHT, WIDTH = 6, 5, 10, 12
EPSILON = 1e-5


def directions(count, top):
    theta, phi = np.linspace(0, top, count), 2.4 * np.arange(count) - 3
    flat = np.sin(theta)
    return np.stack([flat * np.cos(phi), flat * np.sin(phi), np.cos(theta)], axis=1)


def cloth(seed=0, *, rank=8, scale=1.0, **details):
    """A sample of some smooth factors with a highlight; all values positive."""
    draw = np.random.default_rng(seed)
    maps = draw.random((HEIGHT, WIDTH, rank))
    basis = draw.random((VIEWS * LIGHTS, rank, 3)) * np.geomspace(1, 0.02, rank)[:, None]
    images = (np.einsum("hwk,jkc->jhwc", maps, basis) ** 2 * scale).astype(np.float32)
    images[3, 2, 2] *= 500
    return images, BtfSample(
        details.pop("name", "cloth"),
        ArrayStack(images),
        directions(VIEWS, 1.2),
        directions(LIGHTS, 1.31),
        full_index(VIEWS, LIGHTS),
        **details,
    )


def decoded(path):
    """Read a DFMF file by the description of the format alone: a dict of what is in it."""
    data = path.read_bytes()
    place = 0

    def take(form):
        nonlocal place
        values = struct.unpack_from("<" + form, data, place)
        place += struct.calcsize("<" + form)
        return values if len(values) > 1 else values[0]

    found = {"signature": take("10s")}
    begin = place
    size, found["version"] = take("II")
    found["words"] = [take("80s").rstrip(b"\0") for _ in range(3)]
    found["ppmm"], *found["scale"] = take("4f")
    found["cosine"] = take("I") if found["version"] > 1 else 0
    found["xml"] = take(f"{take('I')}s") if found["version"] > 2 else b""
    channels = 3
    if found["version"] > 3:
        channels = take("I")
        found["names"] = [take(f"{take('I')}s") for _ in range(channels)]
    assert place == begin + size
    views, lists = [], []
    for _ in range(take("I")):
        views.append(take("ff"))
        lists.append([take("ff") for _ in range(take("I"))])
    assert all(lights == lists[0] for lights in lists)
    found["views"], found["lights"] = np.array(views), np.array(lists[0])
    width, height = take("II")
    assert take("I") == 0
    found["most"], found["model"] = take("Ii")
    found["mean"], found["transform"] = take("3f"), take("9f")
    planes, found["factors"] = [], []
    for _ in range(channels):
        scalar, rank, rows, columns = take("BIII")
        kind = {2: "<f2", 4: "<f4", 8: "<f8"}[scalar]
        parts = []
        for count in (1, rows, columns):
            block = data[place : place + count * rank * scalar]
            parts.append(np.frombuffer(block, kind).reshape(count, rank).astype(float))
            place += len(block)
        found["factors"].append(parts)
        planes.append(parts[1] @ parts[2].T)
    assert place == len(data)
    one, two, three = planes
    if found["model"] == 11:
        luma = np.exp(one) - EPSILON
        u, v = two * (luma + EPSILON), three * (luma + EPSILON)
        one = luma + 1.13983 * v
        two, three = luma - 0.39465 * u - 0.5806 * v, luma + 2.03211 * u
    images = np.stack([one, two, three], axis=-1)
    found["images"] = images.reshape(len(views) * len(lists[0]), height, width, 3)
    return found


def off(got, wanted):
    """Relative L2 distance."""
    return np.linalg.norm(got.astype(float) - wanted) / np.linalg.norm(wanted)


@pytest.mark.parametrize("model", [0, 11])
@pytest.mark.parametrize(("scalar", "most"), [("half", 4e-3), ("float", 3e-6), ("double", 3e-6)])
def test_all_components_give_the_sample_back(tmp_path, scalar, most, model):
    images, sample = cloth(texel_size=0.08, cosine=True)
    path = tmp_path / "cloth.btf"
    errors = write_dfmf(path, sample, components=30, scalar=scalar, colour_model=model)
    assert max(errors) < 1e-6
    assert off(decoded(path)["images"], images) < most
    again = read_bonn(path)
    assert off(again.stack.read(np.arange(30)), images) < most
    assert np.abs(again.views - sample.views).max() < 2e-7
    assert np.abs(again.lights - sample.lights).max() < 2e-7
    assert np.array_equal(again.index, sample.index)
    assert again.texel_size == pytest.approx(0.08) and again.cosine


@pytest.mark.parametrize("model", [0, 11])
@pytest.mark.parametrize("components", [1, 4, (5, 2, 1)])
def test_truncation_is_the_best_there_is_and_its_error_is_told(tmp_path, model, components):
    images, sample = cloth()
    path = tmp_path / "cloth.btf"
    errors = write_dfmf(path, sample, components=components, scalar="double", colour_model=model)
    flat = images.reshape(30, -1, 3).astype(float)
    if model == 11:
        yuv = flat @ np.linalg.inv([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]]).T
        raised = yuv[..., :1] + EPSILON
        flat = np.concatenate([np.log(raised), yuv[..., 1:] / raised], axis=-1)
    ranks = (components,) * 3 if isinstance(components, int) else components
    for channel, rank in enumerate(ranks):
        _, left, right = decoded(path)["factors"][channel]
        assert left.shape[1] == right.shape[1] == rank
        singular = np.linalg.svd(flat[..., channel], compute_uv=False)
        best = np.sqrt((singular[rank:] ** 2).sum() / (singular**2).sum())
        assert errors[channel] == pytest.approx(best, rel=1e-4)
        assert off(left @ right.T, flat[..., channel]) == pytest.approx(best, rel=1e-4)
    assert decoded(path)["most"] == max(ranks)
    ours = read_bonn(path).stack.read(np.arange(30))
    assert np.allclose(ours, np.maximum(decoded(path)["images"], 0), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("way", ["texels", "images", "pairs of blocks", "random"])
def test_every_way_of_factorising_comes_to_the_same(tmp_path, monkeypatch, way):
    images, sample = cloth()
    if way == "texels":
        images = np.ascontiguousarray(images[:, :2, :3])
        sample = BtfSample("cloth", ArrayStack(images), sample.views, sample.lights, sample.index)
    if way == "random":
        monkeypatch.setattr(svd, "MOST_GRAM", 2)
    if way != "images":
        monkeypatch.setattr(writer, "_BLOCK_MB", 7 * images[0].nbytes / 2**20)
    errors = write_dfmf(tmp_path / "x.btf", sample, components=4, scalar="double")
    found = decoded(tmp_path / "x.btf")
    for channel, (singular, left, right) in enumerate(found["factors"]):
        assert np.allclose(left.T @ left, np.eye(4), atol=1e-6)
        assert np.allclose(np.linalg.norm(right, axis=0), singular[0], rtol=1e-6)
        assert (left[np.abs(left).argmax(axis=0), range(4)] > 0).all()
        coded = _coded(images)[..., channel]
        best = np.linalg.svd(coded, compute_uv=False)
        optimum = np.sqrt((best[4:] ** 2).sum() / (best**2).sum())
        assert off(left @ right.T, coded) == pytest.approx(errors[channel], rel=1e-4)
        assert errors[channel] <= optimum * 1.01


def _coded(images):
    """Log Y, U/Y, V/Y (J, texels, 3) f8."""
    flat = images.reshape(len(images), -1, 3).astype(float)
    yuv = flat @ np.linalg.inv([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]]).T
    raised = yuv[..., :1] + EPSILON
    return np.concatenate([np.log(raised), yuv[..., 1:] / raised], axis=-1)


@pytest.mark.parametrize("scale", [1e-7, 1.0, 1e4, 1e6])
def test_half_floats_hold_dark_and_bright_samples(tmp_path, scale):
    images, sample = cloth(scale=scale)
    path = tmp_path / "x.btf"
    write_dfmf(path, sample, components=30, colour_model=0)
    found = decoded(path)
    assert all(np.isfinite(part).all() for parts in found["factors"] for part in parts)
    assert off(found["images"], images) < 2e-3


def test_what_half_floats_cannot_hold_is_refused(tmp_path):
    _, sample = cloth(scale=1e16)
    with pytest.raises(InvalidParameter, match="do not fit half floats"):
        write_dfmf(tmp_path / "x.btf", sample, colour_model=0)
    assert list(tmp_path.iterdir()) == []
    write_dfmf(tmp_path / "x.btf", sample, colour_model=0, scalar="float")


def test_black_and_constant_samples(tmp_path):
    for value in (0.0, 0.5):
        images = np.full((30, 4, 4, 3), value, np.float32)
        _, sample = cloth()
        flat = BtfSample("flat", ArrayStack(images), sample.views, sample.lights, sample.index)
        for model in (0, 11):
            errors = write_dfmf(tmp_path / "x.btf", flat, components=3, colour_model=model)
            assert max(errors) < 1e-6
            assert np.allclose(decoded(tmp_path / "x.btf")["images"], value, rtol=5e-3, atol=2e-7)


@pytest.mark.parametrize("version", [1, 2, 3, 4])
def test_the_description(tmp_path, version):
    _, sample = cloth(
        name="Tuch \N{SNOWMAN}", cosine=version == 4, licence="CC0 & more", citation="<me>"
    )
    path = tmp_path / "x.btf"
    write_dfmf(path, sample, components=1, version=version)
    found = decoded(path)
    assert found["signature"] == b"!DFMF08FCR" and found["version"] == version
    assert found["words"] == [b"Tuch ?", b"", b"Patina"]
    assert found["ppmm"] == 0 and found["scale"] == [1, 1, 1]
    assert found["cosine"] == (version == 4)
    assert found["mean"] == (0, 0, 0) and found["transform"] == (1, 0, 0, 0, 1, 0, 0, 0, 1)
    if version > 2:
        assert b"<licence>CC0 &amp; more</licence><citation>&lt;me&gt;</citation>" in found["xml"]
    again = read_bonn(path)
    assert again.cosine == sample.cosine and again.texel_size is None
    z = np.cos(found["lights"][:, 0])
    assert np.allclose(z, sample.lights[:, 2], atol=1e-6)


def test_images_go_where_their_pair_belongs(tmp_path):
    images, sample = cloth()
    order = np.random.default_rng(1).permutation(30).astype(np.int32)
    shuffled = BtfSample(
        "x",
        ArrayStack(images[np.argsort(order)]),
        sample.views,
        sample.lights,
        order.reshape(VIEWS, LIGHTS),
    )
    write_dfmf(tmp_path / "x.btf", shuffled, components=30, scalar="double")
    assert off(decoded(tmp_path / "x.btf")["images"], images) < 1e-5


def test_the_same_seed_gives_the_same_file(tmp_path, monkeypatch):
    monkeypatch.setattr(svd, "MOST_GRAM", 2)
    monkeypatch.setattr(svd, "_MORE", 0)
    _, sample = cloth()
    files = []
    for number, seed in enumerate((0, 0, 1)):
        write_dfmf(tmp_path / f"{number}", sample, components=2, seed=seed, scalar="double")
        files.append((tmp_path / f"{number}").read_bytes())
    assert files[0] == files[1] != files[2]


@pytest.mark.parametrize(
    "knobs",
    [
        {"components": 0},
        {"components": (1, 2)},
        {"scalar": "quarter"},
        {"colour_model": 2},
        {"version": 0},
        {"version": 5},
        {"version": 1},
    ],
)
def test_knobs_are_checked(tmp_path, knobs):
    _, sample = cloth(cosine=True)
    with pytest.raises(InvalidParameter, match=next(iter(knobs))):
        write_dfmf(tmp_path / "x.btf", sample, **knobs)
    assert list(tmp_path.iterdir()) == []


def test_missing_pairs_are_refused(tmp_path):
    images, sample = cloth()
    index = sample.index.copy()
    index[-1, -1] = -1
    holed = BtfSample("holed", ArrayStack(images[:-1]), sample.views, sample.lights, index)
    with pytest.raises(InvalidBtf, match="holed: 1 pairs"):
        write_dfmf(tmp_path / "x.btf", holed)
    write_dfmf(tmp_path / "x.btf", subset(holed, range(VIEWS - 1), range(LIGHTS)))


def test_nothing_is_left_of_what_was_cancelled_or_refused(tmp_path):
    _, sample = cloth()
    path = tmp_path / "x.btf"
    write_dfmf(path, sample, components=1)
    before = path.read_bytes()
    calls = []

    def stop(fraction, label):
        calls.append((fraction, label))
        if label.startswith("writing"):
            raise Cancelled

    with pytest.raises(Cancelled):
        write_dfmf(path, sample, components=2, progress=stop)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    assert [fraction for fraction, _ in calls] == sorted(fraction for fraction, _ in calls)
    with pytest.raises(OutputFailed):
        write_dfmf(tmp_path / "no" / "x.btf", sample)


def test_what_was_read_can_be_written_again(tmp_path):
    images, sample = cloth()
    write_dfmf(tmp_path / "a.btf", sample, components=30, scalar="float", progress=silent)
    again = read_bonn(tmp_path / "a.btf")
    write_dfmf(tmp_path / "b.btf", again, components=30, scalar="float", memory_mb=0.01)
    assert off(decoded(tmp_path / "b.btf")["images"], images) < 1e-3  # by way of half floats
