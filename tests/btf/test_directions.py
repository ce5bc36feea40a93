"""Angles and vectors agree, layouts are the papers' and Bonn's, tables name their lines."""

import csv

import numpy as np
import pytest

from btfcore.btf.directions import (
    LARGEST_TABLE,
    LAYOUTS,
    MOST,
    angle_between,
    from_angles,
    layout,
    read_layout,
    repeated,
    to_angles,
)
from btfcore.errors import InvalidBtf, InvalidParameter


def test_angles_and_vectors_are_inverse():
    rng = np.random.default_rng(1)
    theta, phi = rng.uniform(0.01, 1.57, 200), rng.uniform(-3.14, 3.14, 200)
    vectors = from_angles(theta, phi)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-15)
    back = to_angles(3 * vectors)
    np.testing.assert_allclose(back, (theta, phi), atol=1e-14)


def test_the_frame_is_right_handed_with_phi_from_s_to_t():
    np.testing.assert_allclose(from_angles(0, 1.0), (0, 0, 1), atol=1e-15)
    np.testing.assert_allclose(from_angles(np.pi / 2, 0), (1, 0, 0), atol=1e-15)
    np.testing.assert_allclose(from_angles(np.pi / 2, np.pi / 2), (0, 1, 0), atol=1e-15)
    assert [float(part) for part in to_angles([0.0, 0.0, 1.0])] == [0, 0]


def test_small_and_large_angles_are_exact():
    for angle in (1e-9, 1e-4, 1.0, np.pi - 1e-9):
        found = angle_between(from_angles(0.3, 0), from_angles(0.3 + angle, 0))
        assert found == pytest.approx(angle, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize("name", [*LAYOUTS, "1x1x1x1", "7x3x2x9", "64x64x1x1"])
def test_layouts_have_different_unit_directions_up_to_75_degrees(name):
    found = layout(name)
    for directions in (found.views, found.lights):
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-15)
        assert np.degrees(to_angles(directions)[0]).max() < 75.001
        assert repeated(directions) == []
        assert not directions.flags.writeable


def test_resolutions_count_azimuths_then_rings_for_views_then_lights():
    found = layout("12x8x5x2")
    assert len(found.views) == 96 and len(found.lights) == 10
    theta, phi = (np.degrees(part) for part in to_angles(found.views))
    np.testing.assert_allclose(theta.reshape(8, 12)[:, 0], np.arange(5, 76, 10))
    np.testing.assert_allclose(phi.reshape(8, 12)[3, :7], np.arange(0, 181, 30), atol=1e-12)
    tong = to_angles(layout("12x5x12x5").lights)[0].reshape(5, 12)[:, 0]
    np.testing.assert_allclose(np.degrees(tong), (5, 22.5, 40, 57.5, 75))


def test_ubo2003_has_81_directions_on_six_rings():
    theta = np.round(np.degrees(to_angles(layout("ubo81").views)[0]))
    values, counts = np.unique(theta, return_counts=True)
    assert values.tolist() == [0, 15, 30, 45, 60, 75]
    assert counts.tolist() == [1, 6, 12, 18, 20, 24]


def test_ubo2014_is_the_measured_list_in_its_order(data):
    with (data / "btf" / "ubo2014_151_directions.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    theta = np.radians([float(row["zenith_deg"]) for row in rows])
    phi = np.radians([float(row["azimuth_deg"]) for row in rows])
    np.testing.assert_allclose(layout("ubo151").lights, from_angles(theta, phi), atol=1e-12)


@pytest.mark.parametrize(
    "name", ["", "ubo", "12x8", "0x1x1x1", "65x64x1x1", "12x8x12x8\n", "٣x1x1x1"]
)
def test_unknown_layouts_say_what_there_is(name):
    with pytest.raises(InvalidParameter, match="ubo151|where 1 to 4096"):
        layout(name)


def test_repeated_directions_are_found_across_blocks():
    directions = layout("60x20x1x1").views
    again = np.vstack([directions, directions[[5]], from_angles(1.0, 1.0)[None], directions[[900]]])
    assert repeated(again) == [(5, 1200), (900, 1202)]


def table(tmp_path, text):
    path = tmp_path / "my.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_tables_of_angles_and_of_vectors_are_the_same(tmp_path):
    angles = read_layout(table(tmp_path, "# mine\ntheta,phi\n0,0\n30,90\r\n\n75,-180\n"))
    x, z = np.sin(np.radians(75)), np.cos(np.radians(75))
    vectors = read_layout(
        table(tmp_path, f"\ufeffX;Y;Z\n0;0;2e3\n0;.5;{np.cos(np.pi / 6)}\n{-x};0;{z}\n")
    )
    assert angles.name == "my.csv"
    np.testing.assert_allclose(angles.views, vectors.lights, atol=1e-15)
    np.testing.assert_allclose(angles.views, angles.lights)


def test_kinds_part_views_and_lights(tmp_path):
    found = read_layout(table(tmp_path, "kind theta phi\nview 0 0\nLight 20 10\nboth 40 0\n"))
    np.testing.assert_allclose(found.views, from_angles(np.radians([0, 40]), [0, 0]))
    np.testing.assert_allclose(found.lights, from_angles(np.radians([20, 40]), np.radians([10, 0])))
    only = read_layout(table(tmp_path, "theta\tphi\tkind\n20\t10\tlight\n"))
    np.testing.assert_allclose(only.views, [[0, 0, 1]])
    assert len(only.lights) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("# nothing\n\n", "empty"),
        ("theta,phi\n", "no directions"),
        ("theta,azimuth\n1,2\n", "line 1: the columns are theta, azimuth"),
        ("theta,phi,phi\n1,2,3\n", "line 1"),
        ("x,y\n1,2\n", "line 1"),
        ("theta,phi\n10,20\n10\n", "line 3: 1 columns"),
        ("theta,phi\n10,2_0\n", "line 2: phi is '2_0', not a number"),
        ("theta,phi\n10,nan\n", "line 2: phi is 'nan'"),
        ("theta,phi\n10,__import__('os')\n", "line 2: phi is"),
        ("theta,phi\n10,٣\n", "not a number"),
        ("theta,phi\n10," + "1" * 50 + "\n", "not a number"),
        ("theta,phi\n91,0\n", "line 2: theta 91"),
        ("theta,phi\n-1,0\n", "line 2: theta -1"),
        ("theta,phi\n10,1e9\n", "line 2: theta 10 and phi 1e.09"),
        ("x,y,z\n0,0,0\n", "no direction"),
        ("x,y,z\n0,1e999,1\n", "no direction"),
        ("x,y,z\n0,0,1\n1,0,-1\n", r"line 3: the direction lies below the horizon \(z = -0.7071\)"),
        ("x,y,z,kind\n0,0,1,lamp\n", "kind is 'lamp'"),
        ("theta,phi\n10,20\n5,5\n\n10,-340\n", "line 5 repeats the view of line 2"),
        ("theta,phi\n0,20\n0,50\n", "line 3 repeats"),
        (b"theta,phi\n\xff\xfe\n", "byte 10 is no UTF-8"),
        (b"theta,phi\n" + b"#" * LARGEST_TABLE, "at most 1,048,576 bytes"),
    ],
)
def test_bad_tables_are_refused_with_the_line(tmp_path, text, says):
    with pytest.raises(InvalidBtf, match=says) as caught:
        read_layout(table(tmp_path, text))
    assert str(caught.value).startswith("my.csv: ")


def test_too_many_and_absent_tables_are_refused(tmp_path):
    theta, phi = np.meshgrid(np.linspace(1, 80, 65), np.arange(64))
    rows = "".join(f"{t},{p}\n" for t, p in zip(theta.flat, phi.flat, strict=True))
    with pytest.raises(InvalidBtf, match=f"line {MOST + 2}: more than {MOST} views"):
        read_layout(table(tmp_path, "theta,phi\n" + rows))
    for path in (tmp_path / "absent.csv", tmp_path, tmp_path / "a\0b"):
        with pytest.raises(InvalidBtf, match="cannot be read"):
            read_layout(path)
