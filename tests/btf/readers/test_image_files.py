"""Images come out as they went in, whatever the order and size of the blocks read."""

import threading

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.materialize import materialize
from btfcore.btf.readers import decode as decoding
from btfcore.btf.readers import image_files
from btfcore.btf.readers.bonn_names import read_named_images
from btfcore.btf.readers.decode import decode_images
from btfcore.btf.readers.image_files import ImageFiles
from btfcore.btf.readers.listing import list_files
from btfcore.btf.readers.picture import looks_like_picture, read_picture
from btfcore.errors import Cancelled, GuardedFailure, InvalidImage
from btfcore.files.exr import encode_exr
from tests.btf.readers.sets import UBO, named, picture, png, to_folder, to_zip


def numbers_of(images):
    return np.rint(linear_to_srgb(images[:, 0, 0, 0]) * 255).astype(int).tolist()


@pytest.fixture
def stack(tmp_path, in_process, monkeypatch):
    """36 images of 144 bytes in a zip, with a cache of ten; counts the calls of the decoder."""
    where = to_zip(tmp_path / "set.zip", named(UBO, ".png"))
    files = list_files(where)
    entries = files.ending(".png")
    entries.sort(key=lambda entry: entry.base)
    calls = []

    def counted(files, chosen, **knobs):
        calls.append(len(chosen))
        return decode_images(files, chosen, **knobs)

    monkeypatch.setattr(image_files, "decode_images", counted)
    first = decode_images(files, entries[:1])[0]
    found = ImageFiles(files, entries, first, cache_mb=10 * 144 / 2**20)
    return found, calls


def test_any_order_and_repetitions(stack):
    found, _ = stack
    rng = np.random.default_rng(1)
    for count in (1, 2, 7, 36, 60):
        wanted = rng.integers(0, 36, count)
        assert numbers_of(found.read(wanted)) == wanted.tolist()
    assert found.read([]).shape == (0, 6, 8, 3)
    assert numbers_of(found.read([-1])) == [35]
    with pytest.raises(IndexError):
        found.read([36])


def test_reading_in_order_decodes_ahead_and_each_image_once(stack):
    found, calls = stack
    for start in range(0, 36, 3):
        assert numbers_of(found.read(range(start, start + 3))) == [start, start + 1, start + 2]
    assert sum(calls) <= 40
    assert len(calls) <= 5


def test_a_single_image_decodes_no_more(stack):
    found, calls = stack
    found.read([17])
    assert calls == [1]


def test_threads_get_what_they_ask_for(stack):
    found, _ = stack
    wrong = []

    def work(seed):
        for wanted in np.random.default_rng(seed).integers(0, 36, (20, 4)):
            if numbers_of(found.read(wanted)) != wanted.tolist():
                wrong.append(wanted)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_children_in_pairs_return_everything_in_order(tmp_path):
    where = to_folder(tmp_path / "set", named(UBO, ".png"))
    sample = materialize(read_named_images(where))
    assert not sample.stack.dear
    assert sorted(numbers_of(sample.stack.read(range(36)))) == list(range(36))


def test_flaws_are_mended_and_counted_once(tmp_path, in_process):
    values = np.ones((6, 8, 3), np.float32)
    values[0, 0] = np.nan
    values[1, 1, 0] = np.inf
    values[2, 2, :2] = -1
    spoiled = encode_exr(values, half=False)
    to_folder(tmp_path, {"tl000 pl000 tv000 pv000.exr": spoiled})
    stack = read_named_images(tmp_path).stack
    for _ in range(2):
        image = stack.read([0])[0]
    assert (image[0, 0].max(), image[1, 1, 0], image[2, 2, 1]) == (0, 65504, 0)
    flaws = stack.flaws
    assert (flaws.nan, flaws.infinite, flaws.negative) == (3, 1, 2)


def test_the_one_that_brings_the_child_down_is_named(tmp_path, monkeypatch):
    to_folder(tmp_path, {f"{n}.png": png(picture(n)) for n in range(5)})
    files = list_files(tmp_path)

    def run(task, arrays, options, **_):
        if any(job["name"] == "3.png" for job in options["jobs"]):
            raise GuardedFailure("reading failed")
        return decoding.decode(arrays, options)

    monkeypatch.setattr(decoding, "run_guarded", run)
    with pytest.raises(GuardedFailure, match=r"^3\.png: "):
        decode_images(files, files.ending(".png"))


def test_a_single_picture_of_any_depth(tmp_path, in_process):
    radiance = np.linspace(0, 40, 144, dtype=np.float32).reshape(6, 8, 3)
    (tmp_path / "sky.exr").write_bytes(encode_exr(radiance, half=False))
    assert looks_like_picture(tmp_path / "sky.exr")
    sample = read_picture(tmp_path / "sky.exr")
    assert sample.is_image
    assert sample.name == "sky"
    assert np.array_equal(sample.image(0, 0), radiance)
    with pytest.raises(InvalidImage, match=r"^none\.png: there is no such file"):
        read_picture(tmp_path / "none.png")
    (tmp_path / "cut.png").write_bytes(png(picture(1))[:60])
    with pytest.raises(InvalidImage, match=r"^cut\.png: "):
        read_picture(tmp_path / "cut.png")


def test_an_interruption_ends_both_children(monkeypatch, tmp_path):
    """Decoding is interrupted in one child; the other must not be waited for to its end."""
    import time

    from btfcore.btf.readers import decode
    from btfcore.btf.readers.entries import Entry
    from btfcore.btf.readers.listing import FileSet

    ended = []

    def child(task, arrays, options, *, progress, **limits):
        if options["jobs"][0]["name"] == "0.png":
            time.sleep(0.05)
            raise KeyboardInterrupt
        for step in range(2000):
            try:
                progress(0.5, "reading")
            except Cancelled:
                ended.append(step)
                raise
            time.sleep(0.005)
        return {}, {"images": []}

    monkeypatch.setattr(decode, "run_guarded", child)
    entries = tuple(Entry(f"{n}.png", 10) for n in range(30))
    with pytest.raises(KeyboardInterrupt):
        decode.decode_images(FileSet("set", tmp_path, False, entries), entries)
    assert ended, "the second child ran on"
