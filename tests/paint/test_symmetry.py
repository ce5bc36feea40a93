"""Laws of mirrored and turned strokes and stamps."""

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import Area, StampEdit, Stroke, Symmetry
from btfcore.paint.region import constrain
from btfcore.paint.symmetry import (
    area_images,
    origin_of,
    stamp_images,
    stroke_images,
    transforms,
)
from btfcore.types import Mesh
from tests.paint.grounds import ball, cow, flat, ground, walls
from tests.surfaces import random_field, sphere

BALL = np.array([[0.6, 0.48, 0.64], [0.64, 0.6, 0.48]])  # points of the unit sphere


@pytest.mark.parametrize(
    ("symmetry", "count"),
    [
        (Symmetry(), 1),
        (Symmetry("x"), 2),
        (Symmetry("xyz"), 8),
        (Symmetry(radial=5), 5),
        (Symmetry("x", 3, "y"), 6),
        (Symmetry("y", 3, "y"), 6),
        (Symmetry("xz", 2, "y"), 4),  # two mirrors are half a turn
    ],
)
def test_transforms_are_orthogonal_and_none_comes_twice(symmetry, count):
    found = np.array(transforms(symmetry))
    assert len(found) == count
    assert np.array_equal(found[0], np.eye(3))
    assert np.allclose(found @ found.swapaxes(1, 2), np.eye(3))
    apart = np.abs(found[:, None] - found).max(axis=(2, 3)) + np.eye(count)
    assert apart.min() > 0.1
    # they are a group: any two of them together are a third
    products = (found[:, None] @ found).reshape(-1, 1, 3, 3)
    assert (np.abs(products - found).max(axis=(2, 3)).min(axis=1) < 1e-9).all()


def test_the_origin_is_the_middle_of_the_box():
    mesh = Mesh(np.array([[0.0, 0, 0], [4, 0, 0], [0, 2, 0], [0, 0, 9.0]]), np.zeros((0, 3), int))
    assert origin_of(Symmetry("x"), mesh).tolist() == [2, 1, 4.5]
    assert origin_of(Symmetry("x", origin=(1.0, 2, 3)), mesh).tolist() == [1, 2, 3]


def test_strokes_are_mirrored_with_their_normals():
    place = ball()
    one = Stroke(BALL, 0.1, BALL.copy(), np.array([0.5, 1.0]), 0.7)
    two = Stroke(-BALL[:1], 0.2)
    found, missed = stroke_images((one, two), Symmetry("x"), place.mesh, place.locator())
    assert missed == 0 and found[:2] == (one, two) and len(found) == 4
    flip = np.array([-1.0, 1, 1])
    middle = origin_of(Symmetry("x"), place.mesh)
    assert np.allclose(found[2].points - middle, (BALL - middle) * flip)
    assert np.allclose(found[2].normals, BALL * flip)
    assert found[2].pressure.tolist() == [0.5, 1.0]
    assert (found[2].radius, found[2].hardness) == (0.1, 0.7)
    assert np.allclose(found[3].points - middle, (-BALL[:1] - middle) * flip)


def test_radial_copies_are_turned_about_the_axis():
    place = ball()
    symmetry = Symmetry(radial=4, axis="z", origin=(0.0, 0, 0))
    found, missed = stroke_images((Stroke(BALL, 0.1),), symmetry, place.mesh, place.locator())
    assert missed == 0 and len(found) == 4
    x, y, z = BALL.T
    assert np.allclose(found[1].points, np.stack([-y, x, z], axis=1)), "counter-clockwise"


def test_an_image_on_its_stroke_is_dropped():
    place = ball()
    symmetry, locator = Symmetry("x", origin=(0.0, 0, 0)), place.locator()
    on_plane = np.array([[0, 0.6, 0.8], [0, 0.8, 0.6]])
    across = np.array([[-0.6, 0.8, 0], [0.0, 1, 0], [0.6, 0.8, 0]])
    for points in (on_plane, across):
        stroke = Stroke(points, 0.1)
        assert stroke_images((stroke,), symmetry, place.mesh, locator) == ((stroke,), 0)
    uneven = Stroke(across, 0.1, pressure=np.array([0.1, 0.5, 1.0]))
    assert len(stroke_images((uneven,), symmetry, place.mesh, locator)[0]) == 2
    both = stroke_images((Stroke(on_plane, 0.1),), Symmetry("xy", origin=(0.0, 0, 0)), place.mesh,
                         locator)[0]  # fmt: skip
    assert len(both) == 2, "mirroring across x gives nothing new, across y it does"


def test_sides_of_a_thin_wall_are_different_places():
    place = walls(gap=0.001)
    point = np.array([[20.0, -20, 0]])
    stroke = Stroke(point, 3.0, np.array([[0, 0, 1.0]]))
    symmetry = Symmetry("z", origin=(20.0, -20, -0.0005))
    found, _ = stroke_images((stroke,), symmetry, place.mesh, place.locator())
    assert len(found) == 2
    without, _ = stroke_images((Stroke(point, 3.0),), symmetry, place.mesh, place.locator())
    assert len(without) == 1


def test_images_off_the_surface_are_left_out_and_counted():
    place = flat()
    stroke = Stroke(np.array([[20.0, -20, 0], [30.0, -20, 0]]), 4.0)
    symmetry = Symmetry("xy", origin=(50.0, 0.0, 0.0))
    found, missed = stroke_images((stroke,), symmetry, place.mesh, place.locator())
    assert missed == 2 and len(found) == 2
    area, missed = area_images(Area((stroke,), region="all"), symmetry, place.mesh, place.locator())
    assert missed == 2 and len(area.strokes) == 2 and area.region == "all"


def test_plain_symmetry_changes_nothing():
    place = flat()
    area = Area((Stroke(np.array([[20.0, -20, 0]]), 4.0),))
    assert area_images(area, Symmetry(), place.mesh, place.locator()) == (area, 0)
    stamp = StampEdit(point=(20.0, -20, 0), sample=0)
    assert stamp_images(stamp, place.mesh, place.field, place.locator()) == ((stamp,), 0)


def test_a_mirrored_area_is_mirrored():
    """On a plane that is its own mirror image, so is m_0."""
    place = flat(81, 101)
    stroke = Stroke(np.array([[20.3, -20.4, 0], [35.0, -47, 0]]), 5.0)
    symmetry = Symmetry("xy")
    area, _ = area_images(Area((stroke,)), symmetry, place.mesh, place.locator())
    found = constrain(area, place.mesh, place.net, place.locator(), width=4.0)
    picture = found.spread(81 * 101).reshape(81, 101)
    assert np.abs(picture - picture[::-1]).max() < 0.01
    assert np.abs(picture - picture[:, ::-1]).max() < 0.01


def heading(place, edit: StampEdit):
    """Directions in space of a stamp's +column and -row axes, and the normal."""
    normal = None if edit.normal is None else np.array(edit.normal)
    vertex = place.locator().find(np.array(edit.point), normal).vertex[0]
    up = place.dense.normals[vertex].astype(np.float64)
    along = place.field.tangents[vertex].astype(np.float64)
    angle = np.radians(edit.rotation)
    column = np.cos(angle) * along + np.sin(angle) * np.cross(up, along)
    return column, np.cross(up, column), up


@pytest.mark.parametrize("symmetry", [Symmetry("x"), Symmetry("yz"), Symmetry("z", 3, "z")])
@pytest.mark.parametrize("rotation", [0.0, 77.0, -200.0])
def test_a_stamp_keeps_its_handedness_and_mirrors_its_heading(symmetry, rotation):
    dense = sphere(5)
    place = ground(dense, field=random_field(dense))  # what the field does must not matter
    # on a vertex that has its images among the vertices, so that normals are exact mirrors
    points = dense.vertices
    point = points[np.argmax(points @ [0.5, 0.6, 0.62])]
    edit = StampEdit(point=tuple(point), sample=1, rotation=rotation, scale=1.5, seed=7,
                     symmetry=symmetry)  # fmt: skip
    found, missed = stamp_images(edit, place.mesh, place.field, place.locator())
    matrices = transforms(symmetry)
    assert missed == 0 and len(found) == len(matrices)
    assert (found[0].point, found[0].rotation) == (edit.point, rotation)
    column, row, _ = heading(place, edit)
    for image, matrix in zip(found, matrices, strict=True):
        assert image.symmetry.plain and (image.scale, image.seed, image.sample) == (1.5, 7, 1)
        assert np.allclose(image.point, matrix @ point, atol=1e-6)
        mirrored, up_in_picture, normal = heading(place, image)
        assert np.allclose(mirrored, matrix @ column, atol=0.03), "the heading is mirrored"
        assert np.allclose(np.cross(mirrored, up_in_picture), normal, atol=1e-6)
        # the picture is not: its up is the mirror image's up only where nothing was mirrored
        sign = np.linalg.det(matrix)
        assert np.allclose(up_in_picture, sign * (matrix @ row), atol=0.03)


def test_a_stamp_on_the_mirror_has_no_image():
    place = ball()
    stamp = StampEdit(point=(0.0, 0.6, 0.8), sample=0, symmetry=Symmetry("x", origin=(0, 0, 0)))
    found, missed = stamp_images(stamp, place.mesh, place.field, place.locator())
    assert len(found) == 1 and missed == 0 and found[0].symmetry.plain


def test_a_stamp_whose_image_finds_no_surface_is_left_out():
    place = flat()
    stamp = StampEdit(point=(20.0, -20, 0), sample=0, symmetry=Symmetry("xy", origin=(50, 0, 0)))
    found, missed = stamp_images(stamp, place.mesh, place.field, place.locator())
    assert len(found) == 2 and missed == 2
    turned_over = Symmetry("z", origin=(50, -40, 0.5))  # lands, but seen from behind
    stamp = StampEdit(point=(20.0, -20, 0), sample=0, symmetry=turned_over)
    found, missed = stamp_images(stamp, place.mesh, place.field, place.locator())
    assert len(found) == 1 and missed == 1
    with pytest.raises(InvalidEdit, match=r"the stamp at \(20, -20, 50\) is 50 away"):
        stamp_images(StampEdit(point=(20.0, -20, 50.0), sample=0, symmetry=turned_over),
                     place.mesh, place.field, place.locator())  # fmt: skip


def test_a_real_mesh_mirrors_onto_itself():
    """A cow is nearly its own mirror image; what is painted on one flank appears on the other."""
    place = cow()
    locator = place.locator()
    flank = np.argmax(place.dense.normals[:, 0] * (np.abs(place.dense.vertices[:, 1]) < 0.2))
    point = place.dense.vertices[[flank]]
    area = Area((Stroke(point, 0.1, place.dense.normals[[flank]].astype(float)),))
    both, missed = area_images(area, Symmetry("x"), place.mesh, locator)
    assert missed == 0 and len(both.strokes) == 2
    found = constrain(both, place.mesh, place.net, locator)
    x = place.dense.vertices[found.vertices, 0]
    right, left = (x > 0).sum(), (x < 0).sum()
    assert min(right, left) > 50 and abs(right - left) < 0.2 * right
