"""Broken and hostile files end in a named error, soon and without being loaded."""

import os
import struct
import tracemalloc

import numpy as np
import pytest

from btfcore.btf.bonn.reader import bonn_sample, read_bonn
from btfcore.errors import InvalidBtf
from tests.btf.bonn import synthetic as make
from tests.btf.bonn.mutate import check, mutants

FILES = {name: build()[0] for name, build in make.every().items()}
COUNTS = (0, 1 << 31, (1 << 32) - 1)
# Numbers that may be anything, or where 0 has a meaning.
NO_COUNT = ("cosine", "most", "model")
ZERO_SERVES = ("xml_length", "rotations", "reduced", "map_", "name_length", "mask", "magic")


def refused(data, match=None):
    with pytest.raises(InvalidBtf, match=match) as caught:
        bonn_sample("bad.btf", data)
    assert str(caught.value).startswith("bad.btf: ")
    return str(caught.value)


@pytest.mark.parametrize("name", FILES)
def test_cut_off_anywhere(name):
    file = FILES[name]
    end = file.at("height")[0] + 4
    cuts = set(range(end + 20)) if name in ("dfmf", "pvf old") else set(range(0, end, 37))
    for _, start, length, _ in file.fields:
        cuts |= {start - 1, start, start + 1, start + length // 2, start + length - 1}
    for cut in sorted(cut for cut in cuts if 0 <= cut < len(file.data)):
        refused(bytes(file.data[:cut]))


@pytest.mark.parametrize("name", FILES)
def test_bytes_left_over(name):
    refused(bytes(FILES[name].data) + b"\0", "1 bytes follow the last field")


@pytest.mark.parametrize("name", FILES)
def test_absurd_counts(name):
    file = FILES[name]
    tracemalloc.start()
    for field, start, _, kind in file.fields:
        if kind != "u32" or field in NO_COUNT:
            continue
        (old,) = struct.unpack_from("<I", file.data, start)
        for count in (*COUNTS, old + 1, old << 16 | 1):
            if count == old or (count == 0 and field.startswith(ZERO_SERVES)):
                continue
            if (field, count) == ("reduced", 1):
                continue
            data = file.patched(field, struct.pack("<I", count & 0xFFFFFFFF))
            if field in ("lines", "announced") and count:
                check(data)  # more rows to a chunk than there are can be read
            else:
                refused(data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 << 20


def test_zero_where_zero_serves_elsewhere_contradicts_the_rest():
    file = FILES["dfmf"]
    for field in ("xml_length", "name_length0"):
        refused(file.patched(field, struct.pack("<I", 0)))


@pytest.mark.parametrize("size", [0, 1, 3, 5, 6, 7, 9, 16, 255])
def test_sizes_of_numbers_that_there_are_not(size):
    for name, field in (("dfmf", "scalar1"), ("fmf12", "scalar"), ("pvf", "scalar4")):
        message = refused(FILES[name].patched(field, bytes([size])))
        assert f"is {size}, but 2, 4 or 8 bytes" in message


def test_differing_sizes_of_numbers():
    file = FILES["dfmf"]
    for size in (4, 8):
        refused(file.patched("scalar1", bytes([size])), f"is {size}, but channel 0 has 2")


def test_products_that_do_not_fit():
    words = struct.Struct("<II")
    for name, pair in (("dfmf", (48, 21)), ("fmf06", (60, 47)), ("fmf12 transposed", (60, 48))):
        tag = "0" if name == "dfmf" else ""
        refused(FILES[name].patched("rows" + tag, words.pack(*pair)))
    # The same number of values in another shape: only the products tell.
    made, _ = make.dfmf()
    start, _ = made.at("rows0")
    data = bytes(made.data[:start]) + words.pack(21, 47) + bytes(made.data[start + 8 :])
    refused(data, r"rows and columns of channel 0 .* are 21 and 47, but 20 and 48 are needed")
    made, _ = make.pvf()
    refused(made.patched("width", words.pack(7, 8)), "weights and dimension of view 0")
    # Width and height swapped fit the product; that no reader can tell.
    assert check(made.patched("width", words.pack(8, 6))) is not None


def test_products_beyond_32_bits():
    made, _ = make.dfmf()
    wrapped = struct.pack("<II", 65536, 65537)  # 65536 * 65537 = 65536 modulo 2^32
    refused(made.patched("width", wrapped))
    refused(made.patched("width", struct.pack("<II", 65536, 65536)), "at most 268,435,456 texels")
    made, _ = make.fmf()
    for pair in ((1 << 31, 1 << 31), (65536, 65536), (1, (1 << 32) - 1)):
        refused(made.patched("map_width", struct.pack("<II", *pair)), "height map")


def test_texts_without_an_end():
    made, _ = make.dfmf()
    for field in ("setup", "sensor", "light"):
        sample = check(made.patched(field, b"\xff" * 80))
        assert sample is not None and len(sample.origin) < 300
    for field in ("name_length0", "name_length2", "xml_length"):
        for length in (2, 1000, (1 << 32) - 1):
            refused(made.patched(field, struct.pack("<I", length)))


def test_lists_of_lights_that_differ():
    made, _ = make.dfmf()
    angles = make.truth().lights.astype("<f4")
    angles[2] += 0.01
    message = refused(made.patched("lights3", angles.tobytes()))
    assert "the lights of view 3" in message and "first in light 2" in message
    refused(made.patched("nL3", struct.pack("<I", 3)), "number of lights of view 3 .* view 0 has 4")


@pytest.mark.parametrize(
    ("angles", "match"),
    [
        ((1.7, 0.0), "polar angle 1.7"),
        ((-1.7, 0.0), "polar angle -1.7"),
        ((np.nan, 0.0), "polar angle nan"),
        ((0.5, np.inf), "azimuth inf"),
        ((0.5, 1e30), r"azimuth 1e\+30"),
        ((3e38, 0.0), r"polar angle 3e\+38"),
    ],
)
def test_directions_that_are_none(angles, match):
    raw = np.array(angles, "<f4").tobytes()
    for name in ("dfmf", "bdi full", "pvf old"):
        refused(FILES[name].patched("view2", raw), f"view 2 has the {match}|view 2 has .* {match}")
    refused(FILES["dfmf"].patched("lights0", raw), "light 0 has")
    refused(FILES["dfmf"].patched("lights4", raw), "view 4's light 0 has")


def test_repeated_directions():
    true = make.truth()
    for field, angles in (("view3", true.views[1]), ("view3", true.views[1] + 4e-6)):
        refused(FILES["dfmf"].patched(field, angles.astype("<f4").tobytes()), "view")
    lights = true.lights.copy()
    lights[3] = lights[1]
    made, _ = make.fmf(make.Truth(true.views, lights))
    refused(bytes(made.data), "4 lights, but only 3 different")


def test_thousands_of_equal_directions_cost_nothing():
    file = make.File()
    file.put("signature", b"!DFMF08FCR")
    make.description(file)
    count = 1 << 14
    table = struct.pack("<I", count) + struct.pack("<ffIff", 0, 0, 1, 0, 0) * count
    cluster = np.zeros((count, 2), "<f4")
    cluster[:, 0] = 0.5
    cluster[:, 1] = np.arange(count) * 1e-9 + 0.1
    tracemalloc.start()
    refused(bytes(file.data) + table, "only 1 different")
    one_view = struct.pack("<IffI", 1, 0, 0, count)
    refused(bytes(file.data) + one_view + cluster.tobytes(), "repeated|same direction")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 32 << 20


def test_more_pairs_than_can_be_read():
    file = make.File()
    file.put("signature", b"!DFMF08FCR")
    make.description(file)
    table = struct.pack("<IffI", 1 << 14, 0, 0, 1 << 10)
    refused(bytes(file.data) + table, "16,384 views times 1,024 lights")


@pytest.mark.parametrize(
    ("channels", "match"),
    [(0, "is 0"), (2, "is 2"), (4, "is 4"), (81, "is 81"), ((1 << 32) - 1, "is 4,294,967,295")],
)
def test_other_numbers_of_channels(channels, match):
    made, _ = make.dfmf()
    refused(made.patched("channels", struct.pack("<I", channels)), match)


@pytest.mark.parametrize("names", [(b"450", b"550.5", b"650nm"), (b"400 nm",)])
def test_spectral_channels(names):
    refused(bytes(make.bdi(names=names, channels=len(names))[0].data), "spectral")


@pytest.mark.parametrize("model", [5, 6, 7, 8, 13, -1, -(1 << 31), (1 << 31) - 1])
def test_other_colour_models(model):
    made, _ = make.dfmf()
    refused(made.patched("model", struct.pack("<i", model)), f"is {model} .*but only 0, 1, 2")


@pytest.mark.parametrize("model", [1, 2, 3, 4, 9, 10, 11])
def test_grey_samples_in_models_of_three_channels(model):
    refused(bytes(make.dfmf(model=model, channels=1, names=(b"Y",))[0].data), "is grey")


def test_a_transform_that_is_not_finite():
    made, _ = make.dfmf(model=3)
    nan = np.array([np.nan], "<f4").tobytes()
    for field in ("mean", "transform"):
        refused(made.patched(field, nan), "not finite")
        assert check(make.dfmf(model=0)[0].patched(field, nan)) is not None  # of no use there


@pytest.mark.parametrize("version", [0, 5, 1 << 31])
def test_other_versions(version):
    for name in ("dfmf", "fmf06 short", "bdi full", "pvf"):
        refused(FILES[name].patched("version", struct.pack("<I", version)), "1 to 4 are known")


def test_versions_and_methods_of_the_extension():
    file = FILES["fmf12"]
    for version in (3, 255):
        refused(file.patched("extension", bytes([version])), f"is {version}, but 0 to 2")
    refused(file.patched("reduced", struct.pack("<I", 2)), "0 and 1 are known")


def test_compressed_and_unknown_bdi_files():
    file = FILES["bdi full"]
    refused(file.patched("compression", b"\x01"), "bzip")
    refused(file.patched("compression", b"\x03"), "unknown")
    length = file.at("mask")[1]
    sparse = FILES["bdi sparse"]
    refused(sparse.patched("mask", bytes(length)), "leaves no texel")
    refused(sparse.patched("mask", b"\1" * length), "the file ends")


@pytest.mark.parametrize("raw", [np.nan, np.inf, -np.inf, -1.0, 65504.0])
def test_whatever_halves_hold_images_are_radiance(raw):
    half = np.array([raw], "<f2").tobytes()
    for name, file in FILES.items():
        kinds = {field: kind for field, _, _, kind in file.fields}
        for field in ("U0", "SxV0", "mean1", "C0", "W0", "chunk0", "U", "SxV"):
            if kinds.get(field) == "f2":
                sample = check(file.patched(field, half))
                assert sample is not None, (name, field)
                told = any("not finite" in note for note in sample.notes)
                assert told == (not np.isfinite(raw) and field != "chunk0")


def test_signalling_nans_raise_no_warning():
    file = FILES["dfmf transposed"]
    quiet = b"\x01\x00\xa0\x7f"
    with np.errstate(all="raise"):
        assert check(file.patched("U0", quiet)) is not None
        refused(file.patched("view1", quiet), "nan")


def test_no_bonn_file_at_all(tmp_path):
    for raw in (b"", b"!", b"!DFMF", b"PK\3\4", b"!DFMF99FC" + bytes(400)):
        refused(raw, "no Bonn BTF file does")
    with pytest.raises(InvalidBtf, match=r"^none\.btf: there is no such file"):
        read_bonn(tmp_path / "none.btf")
    with pytest.raises(InvalidBtf, match="no regular file"):
        read_bonn(tmp_path)
    with pytest.raises(InvalidBtf, match="no such file|cannot be opened"):
        read_bonn(tmp_path / "a\0b")
    for raw, match in ((b"", "0 bytes are no"), (b"version https://git-lfs.github.com", "LFS")):
        (tmp_path / "x.btf").write_bytes(raw)
        with pytest.raises(InvalidBtf, match=match):
            read_bonn(tmp_path / "x.btf")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.btf")
        with pytest.raises(InvalidBtf, match="no regular file"):
            read_bonn(tmp_path / "pipe.btf")


def sparse(path, parts, size):
    """A file of `size` bytes that holds `parts`, {offset: bytes}, and zeros between them."""
    with open(path, "wb") as stream:
        for place, raw in parts.items():
            stream.seek(place)
            stream.write(raw)
        try:
            stream.truncate(size)
        except OSError:
            pytest.skip("no sparse files of 4 GiB here")


def test_values_beyond_4_gib_are_found(tmp_path):
    # A measurement XML of nearly 4 GiB pushes the rest over the limit of 32 bits.
    made, values = make.dfmf(version=3, scalar=8, xml=b"")
    start, _ = made.at("xml_length")
    xml = (1 << 32) - 400
    head = bytearray(made.data[:start] + struct.pack("<I", xml))
    struct.pack_into("<I", head, made.at("struct_size")[0], 264 + 8 + xml)
    rest = bytes(made.data[start + 4 :])
    path = tmp_path / "huge.btf"
    end = len(head) + xml + len(rest)
    assert end > 1 << 32
    for size in (end - 1, end + 1, end):
        sparse(path, {0: head, len(head) + xml: rest}, size)
        if size != end:
            with pytest.raises(InvalidBtf, match=r"^huge\.btf: .*(the file ends|bytes follow)"):
                read_bonn(path)
    tracemalloc.start()
    sample = read_bonn(path)
    assert np.array_equal(sample.stack.read([19])[0], np.maximum(values[19], 0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 << 20
    path.unlink()


def test_matrices_beyond_4_gib_are_measured_in_full(tmp_path):
    # 8,192 texels x 65,536 components x 8 bytes = 2^32, which is 0 in 32 bits.
    file = make.File()
    file.put("signature", b"!DFMF08FCR")
    make.description(file, names=(b"Y",))
    make.directions(file, make.truth())
    rank, width, height = 1 << 16, 128, 64
    file.put("rest", struct.pack("<IIIIi12f", width, height, 0, rank, 0, *[0] * 12))
    file.put("channel", struct.pack("<BIII", 8, rank, 20, width * height))
    end = len(file.data) + (1 + 20 + width * height) * rank * 8
    path = tmp_path / "huge.btf"
    for size in (end - (1 << 32), end - (1 << 30), end - 1, end + 1):
        sparse(path, {0: file.data}, size)
        with pytest.raises(InvalidBtf, match=r"^huge\.btf: .*(the file ends|bytes follow)"):
            read_bonn(path)
    path.unlink()


@pytest.mark.parametrize("name", FILES)
def test_headers_before_gigabytes_of_nothing(name, tmp_path):
    # Every count asks for its most, and the file is large enough for much of it.
    file = FILES[name]
    path = tmp_path / "x.btf"
    tracemalloc.start()
    for field, start, _, kind in file.fields:
        if kind == "u32" and field not in NO_COUNT and not field.startswith("name"):
            path.write_bytes(file.data[: start + 4])
            with path.open("r+b") as stream:
                stream.seek(start)
                stream.write(struct.pack("<I", (1 << 14)))
                stream.truncate(5 << 30)
            with pytest.raises(InvalidBtf):
                read_bonn(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 64 << 20
    path.unlink()


def test_mutants_are_read_or_refused():
    outcomes = [check(data) is not None for _, data in mutants(7, 300)]
    assert 20 < sum(outcomes) < 200


def test_mutants_are_the_same_for_the_same_seed():
    assert list(mutants(3, 20)) == list(mutants(3, 20)) != list(mutants(4, 20))


def test_mutants_may_be_files(tmp_path):
    for number, (_, data) in enumerate(mutants(11, 20)):
        path = tmp_path / f"{number}.btf"
        path.write_bytes(data)
        check(path)
