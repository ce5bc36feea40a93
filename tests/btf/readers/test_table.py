"""Tables of directions: what they say is followed to the digit, and nothing outside the folder."""

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb
from btfcore.btf.readers.conditions import from_angles
from btfcore.btf.readers.table import looks_like_table, read_table
from btfcore.btf.readers.table_text import parse_csv, parse_lp
from btfcore.errors import InvalidBtf
from tests.btf.readers.sets import picture, png, to_folder, to_zip

pytestmark = pytest.mark.usefixtures("in_process")


def number_of(image):
    return round(float(linear_to_srgb(image)[0, 0, 0]) * 255)


def lights(count):
    rng = np.random.default_rng(4)
    vectors = rng.normal(size=(count, 3))
    vectors[:, 2] = np.abs(vectors[:, 2]) + 0.2
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.fixture
def light_list(tmp_path):
    """A folder with seven images, one with a blank in its name, and a light list."""
    directions = lights(7)
    names = [f"pic {n}.png" if n == 3 else f"sub/pic{n}.png" for n in range(7)]
    files = {name: png(picture(n)) for n, name in enumerate(names)}
    rows = [f"{name} {x!r} {y!r} {z!r}" for name, (x, y, z) in zip(names, directions.tolist())]  # noqa: B905
    files["rock.lp"] = ("7\r\n" + "\r\n".join(rows) + "\r\n").encode()
    return to_folder(tmp_path / "set", files), directions, files


@pytest.mark.parametrize("how", ["file", "folder", "zip"])
def test_a_light_list_is_one_view_under_its_lights(tmp_path, light_list, how):
    folder, directions, files = light_list
    zipped = tmp_path / "rock.zip"
    where = {"file": folder / "rock.lp", "folder": folder, "zip": zipped}[how]
    to_zip(zipped, {f"inner/{name}": data for name, data in files.items()})
    assert looks_like_table(where)
    sample = read_table(where)
    assert sample.name == ("set" if how == "folder" else "rock")
    assert np.array_equal(sample.views, [[0, 0, 1]])
    for n, direction in enumerate(directions):
        place = int(np.linalg.norm(sample.lights - direction, axis=1).argmin())
        assert sample.lights[place] == pytest.approx(direction, abs=1e-12)
        assert number_of(sample.image(0, place)) == n


def test_angles_and_vectors_agree(tmp_path):
    angles = [(0, 0, 0, 0), (0, 0, 40.25, 10), (33.3, 200.5, 0, 0), (33.3, 200.5, 40.25, 10)]
    degrees = ["# measured", "Theta_view;phi_view;FILE;theta_light;phi_light;exposure"]
    vectors = ["file,lx,ly,lz,vx,vy,vz"]
    files = {}
    for n, (tv, pv, tl, pl) in enumerate(angles):
        files[f"i{n}.png"] = png(picture(n))
        degrees.append(f"{tv};{pv};i{n}.png;{tl};{pl};0.5")
        light, view = from_angles(tl, pl), from_angles(tv, pv)
        numbers = [repr(float(value)) for value in (*light, *view)]
        vectors.append(",".join([f"I{n}.PNG", *numbers]))  # the case of letters may differ
    one = to_folder(tmp_path / "one", {**files, "t.csv": "\n".join(degrees).encode("utf-8-sig")})
    other = to_folder(tmp_path / "other", {**files, "t.csv": "\n".join(vectors).encode()})
    first, second = read_table(one), read_table(other)
    assert first.views == pytest.approx(second.views, abs=1e-12)
    assert first.lights == pytest.approx(second.lights, abs=1e-12)
    assert np.array_equal(first.index, second.index)
    for n, pair in enumerate([(0, 0), (0, 1), (1, 0), (1, 1)]):
        assert number_of(first.image(*pair)) == number_of(second.image(*pair)) == n


def test_a_table_without_views_is_seen_from_above_and_lengths_are_mended(tmp_path):
    text = "name,x,y,z\na.png,0,0,2\nb.png,0,3,4\n"
    files = {"a.png": png(picture(1)), "b.png": png(picture(2)), "lights.csv": text.encode()}
    sample = read_table(to_folder(tmp_path, files))
    assert np.array_equal(sample.views, [[0, 0, 1]])
    assert sample.lights[1] == pytest.approx([0, 0.6, 0.8])
    assert any("normalised 2 light vectors" in note for note in sample.notes)


@pytest.mark.parametrize(
    "name",
    [
        "../a.png",
        "/etc/a.png",
        "C:\\a.png",
        "\\\\host\\share\\a.png",
        "sub/../../a.png",
        "x/..",
        "",
    ],
)
def test_names_that_leave_the_folder_are_refused_with_their_line(tmp_path, name):
    to_folder(tmp_path, {"a.png": png(picture(1)), "set/b.png": png(picture(1))})
    rows = f"file,lx,ly,lz\nb.png,0,0,1\n{name},0,1,1\n"
    (tmp_path / "set" / "t.csv").write_text(rows)
    with pytest.raises(InvalidBtf, match="line 3"):
        read_table(tmp_path / "set")
    if name:
        (tmp_path / "set" / "t.lp").write_text(f"2\nb.png 0 0 1\n{name} 0 1 1\n")
        with pytest.raises(InvalidBtf, match="line 3"):
            read_table(tmp_path / "set" / "t.lp")


def test_a_link_that_leaves_the_folder_is_refused(tmp_path):
    to_folder(tmp_path, {"a.png": png(picture(1)), "set/t.lp": b"1\nb.png 0 0 1\n"})
    (tmp_path / "set" / "b.png").symlink_to(tmp_path / "a.png")
    for where in (tmp_path / "set", tmp_path / "set" / "t.lp"):
        with pytest.raises(InvalidBtf, match="leads out of the folder"):
            read_table(where)
    (tmp_path / "set" / "b.png").unlink()
    to_folder(tmp_path / "set", {"deep/c.png": png(picture(9))})
    (tmp_path / "set" / "b.png").symlink_to(tmp_path / "set" / "deep" / "c.png")
    assert number_of(read_table(tmp_path / "set").image(0, 0)) == 9


LISTS = {
    "": "line 1",
    "two\na.png 0 0 1\n": "line 1",
    "2\na.png 0 0 1\n": "announces 2 images, lists 1",
    "99999999999\na.png 0 0 1\n": "line 1",
    "1\na.png 0 1\n": "line 2",
    "1\na.png 0 0 nan\n": "line 2.*'nan'",
    "1\na.png 0 0 1_0\n": "line 2.*'1_0'",
    "1\na.png 0 0 0\n": "line 2.*no light above",
    "2\na.png 0 0 1\n\nb.png 0 0 -1\n": "line 4.*no light above",
    "1\n" + "a" * 5000 + " 0 0 1\n": "line 2.*5,00",
    "1\na.png\0 0 0 1\n": "null",
}


@pytest.mark.parametrize("text", LISTS)
def test_light_lists_that_make_no_sense(text):
    with pytest.raises(InvalidBtf, match=LISTS[text]) as caught:
        parse_lp("x.lp", text.encode())
    assert str(caught.value).startswith("x.lp")


TABLES = {
    "": "header",
    "file,lx,ly\na.png,0,0\n": "no light columns",
    "lx,ly,lz\n0,0,1\n": "no column `file`",
    "file,lx,ly,lz\na.png,0,0\n": "line 2: 3 cells for 4 columns",
    'file,lx,ly,lz\n"a.png,0,0,1\n': "line 2",
    "file,theta_light,phi_light\na.png,91,0\n": "line 2.*91",
    "file,theta_light,phi_light\na.png,ten,0\n": "line 2.*'ten'",
    "file,theta_light,phi_light\na.png,1e999,0\n": "line 2",
}


@pytest.mark.parametrize("text", TABLES)
def test_tables_that_make_no_sense(text):
    with pytest.raises(InvalidBtf, match=TABLES[text]) as caught:
        parse_csv("x.csv", text.encode())
    assert str(caught.value).startswith("x.csv")


def test_contradictions_between_table_and_files(tmp_path):
    images = {"a.png": png(picture(1)), "b.png": png(picture(2)), "c.txt": b"no image"}
    cases = {
        "2\na.png 0 0 1\nb.png 0 0 2\n": "a.png and b.png|b.png and a.png",
        "2\na.png 0 0 1\na.png 0 1 2\n": "line 3.*line 2 too",
        "2\na.png 0 0 1\nd.png 0 1 2\n": "line 3: there is no 'd.png'",
        "2\na.png 0 0 1\nc.txt 0 1 2\n": "line 3: 'c.txt' is no image",
    }
    for number, (text, words) in enumerate(cases.items()):
        folder = to_folder(tmp_path / str(number), {**images, "t.lp": text.encode()})
        with pytest.raises(InvalidBtf, match=words):
            read_table(folder)
    to_folder(tmp_path / "0", {"u.lp": b"1\na.png 0 0 1\n"})
    with pytest.raises(InvalidBtf, match=r"one directions table .* found t\.lp, u\.lp"):
        read_table(tmp_path / "0")
