"""Films are read back by their own libraries: sizes, times, colours; the same bytes again."""

import io
import sys

import numpy as np
import pytest
from PIL import Image

from btfcore.errors import InvalidParameter, OutputFailed
from btfcore.files.movie import check_movie, durations, gif, is_sequence, numbered, write_movie

av = pytest.importorskip("av")

FLAT = (40, 160, 90)


def frames(count=9, size=(64, 48)):
    """A light square that moves over a flat colour."""
    for number in range(count):
        frame = np.full((size[1], size[0], 3), FLAT, np.uint8)
        frame[12:28, 4 * number : 4 * number + 16] = 230
        yield frame


def test_an_mp4_holds_pictures_times_and_the_meaning_of_its_colours(tmp_path):
    write_movie(tmp_path / "a.mp4", frames(), size=(64, 48), fps=12.5)
    with av.open(str(tmp_path / "a.mp4")) as film:
        stream = film.streams.video[0]
        context = stream.codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.width, stream.height) == (64, 48)
        assert stream.average_rate == 12.5
        marks = (context.color_primaries, context.color_trc, context.colorspace)
        assert marks == (1, 1, 1)  # BT.709
        assert context.color_range == 1  # 16 to 235
        shown = [each.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()
                 for each in film.decode(video=0)]  # fmt: skip
    assert len(shown) == 9
    for number, frame in enumerate(shown):
        assert np.abs(frame[40:, :].astype(int) - FLAT).max() <= 4
        assert np.abs(frame[18:22, 4 * number + 6 : 4 * number + 10].astype(int) - 230).max() <= 6


def test_a_gif_holds_pictures_and_times(tmp_path):
    write_movie(tmp_path / "a.gif", frames(), size=(64, 48), fps=30)
    film = Image.open(tmp_path / "a.gif")
    assert film.n_frames == 9
    assert film.info["loop"] == 0
    total = 0
    for number, frame in enumerate(frames()):
        film.seek(number)
        total += film.info["duration"]
        assert np.abs(np.asarray(film.convert("RGB")).astype(int) - frame).mean() < 3
    assert total == 300


def test_a_moving_picture_leaves_still_parts_alone_in_a_gif():
    rng = np.random.default_rng(0)
    still = rng.integers(0, 256, (40, 60, 3)).astype(np.uint8)
    pictures = []
    for number in range(4):
        picture = still.copy()
        picture[:, 40:] = 60 * number
        pictures.append(picture)
    film = Image.open(io.BytesIO(gif(pictures, 10)))
    shown = []
    for number in range(4):
        film.seek(number)
        shown.append(np.asarray(film.convert("RGB"))[:, :30])
    assert all(np.array_equal(each, shown[0]) for each in shown)


@pytest.mark.parametrize("name", ["film.mp4", "film.gif"])
def test_the_same_pictures_make_the_same_bytes(tmp_path, name):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        write_movie(tmp_path / folder / name, frames(), size=(64, 48))
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_sequences_are_numbered_files(tmp_path):
    write_movie(tmp_path / "f_%03d.png", frames(3), size=(64, 48))
    assert sorted(each.name for each in tmp_path.iterdir()) == [
        "f_000.png", "f_001.png", "f_002.png"
    ]  # fmt: skip
    last = list(frames(3))[2]
    assert np.array_equal(np.asarray(Image.open(tmp_path / "f_002.png")), last)
    assert is_sequence("a/%d.exr") and not is_sequence("a%d/b.exr")
    assert numbered("a/%04d.exr", 12345).name == "12345.exr"
    with pytest.raises(InvalidParameter, match="one %d"):
        numbered("%d_%d.png", 1)


def test_what_fails_leaves_nothing(tmp_path):
    def broken():
        yield from frames(3)
        raise KeyboardInterrupt

    for name in ("a.mp4", "a.gif"):
        with pytest.raises(KeyboardInterrupt):
            write_movie(tmp_path / name, broken(), size=(64, 48))
        wrong = [np.zeros((48, 65, 3), np.uint8)]
        with pytest.raises(InvalidParameter, match="picture 0"):
            write_movie(tmp_path / name, wrong, size=(64, 48))
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputFailed, match="does not exist"):
        write_movie(tmp_path / "no" / "a.mp4", frames(), size=(64, 48))


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(OutputFailed, match="PyAV"):
        write_movie(tmp_path / "a.mp4", frames(), size=(64, 48))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "size", "fps", "count", "told"),
    [("a.mp4", (63, 48), 25, 1, "63 x 48"), ("a.mp4", (9000, 48), 25, 1, "9000"),
     ("a.gif", (4000, 4000), 25, 100, "100 pictures"), ("a.gif", (64, 48), 60, 1, "60 pictures"),
     ("a.mp4", (64, 48), float("nan"), 1, "nan"), ("a.mp4", (64, 48), 1000, 1, "1000")],
)  # fmt: skip
def test_films_that_cannot_be_are_refused_before_the_work(name, size, fps, count, told):
    with pytest.raises(InvalidParameter, match=told):
        check_movie(name, size, fps, count)


def test_hundredths_of_a_second_add_up():
    assert sum(durations(90, 30)) == 3000
    assert set(durations(90, 30)) == {30, 40}
