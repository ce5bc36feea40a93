"""Laws of areas and of the transition zone about their edge (Zhou §IV-B, fig. 10)."""

import numpy as np
import pytest

from btfcore.errors import InvalidEdit
from btfcore.paint.edits import Area, Stroke
from btfcore.paint.region import _edge_of, constrain, signed_distance, target, zone
from tests.paint.grounds import Ground, ball, cow, flat, halves, walls


def over(place: Ground, area: Area, width: float = 0.0):
    return constrain(area, place.mesh, place.net, place.locator(), width=width)


def whole(place: Ground, area: Area, width: float = 0.0) -> np.ndarray:
    return over(place, area, width).spread(len(place.dense.vertices))


def test_the_zone_is_centred_on_the_edge():
    psi = np.array([-np.inf, -9, -2, -1, 0, 1, 2, 9, np.inf])
    assert np.allclose(target(psi, 4.0), [1, 1, 1, 0.75, 0.5, 0.25, 0, 0, 0])
    assert np.array_equal(target(psi, 0.0), [1, 1, 1, 1, 1, 0, 0, 0, 0])
    assert target(psi, 4.0).dtype == target(psi, 0.0).dtype == np.float32
    fine = np.linspace(-5, 5, 2001)
    assert abs(target(fine, 6.0).mean() - target(fine, 0.0).mean()) < 1e-3, "no area is gained"


def test_a_soft_brush_widens_the_zone():
    assert zone(10.0, 1.0, 3.0) == 3.0
    assert zone(10.0, 0.9, 3.0) == 3.0
    assert np.isclose(zone(10.0, 0.5, 3.0), 10.0)
    assert zone(10.0, 0.0, 3.0) == 20.0


@pytest.mark.parametrize(("hardness", "width"), [(1.0, 0.0), (1.0, 6.0), (0.5, 6.0), (0.0, 0.0)])
def test_a_dab_falls_off_as_its_zone_says(hardness, width):
    place = flat()
    point, radius = np.array([[50.3, -40.2, 0.0]]), 12.0
    found = whole(place, Area((Stroke(point, radius, hardness=hardness),)), width)
    away = np.linalg.norm(place.dense.vertices - point, axis=1)
    wide = zone(radius, hardness, width)
    expected = target(away - radius, wide)
    sure = np.abs(away - radius) > 1e-2 if wide == 0 else slice(None)
    assert np.allclose(found[sure], expected[sure], atol=1e-3)


def test_an_area_is_the_union_of_its_parts():
    place = halves()
    soft = Stroke(np.array([[60.0, -20, 0]]), 6.0, hardness=0.5)
    sharp = Stroke(np.array([[66.0, -24, 0], [70.0, -50, 0]]), 5.0)
    left = Area(region="left")
    together = whole(place, Area((soft, sharp), region="left"), 3.0)
    alone = [whole(place, each, 3.0) for each in (Area((soft,)), Area((sharp,)), left)]
    assert np.array_equal(together, np.maximum.reduce(alone))


def test_strokes_of_one_zone_share_a_field():
    place = flat()
    one = Stroke(np.array([[30.0, -40, 0]]), 6.0)
    two = Stroke(np.array([[50.0, -40, 0]]), 6.0)
    found = over(place, Area((one, two)), 2.0)
    assert found.dabs.stroke.tolist() == [0, 1]
    parts = np.maximum(whole(place, Area((one,)), 2.0), whole(place, Area((two,)), 2.0))
    assert np.array_equal(found.spread(len(parts)), parts), "they do not touch"
    assert (np.diff(found.vertices) > 0).all() and (found.target > 0).all()


@pytest.mark.parametrize("area", [Area(region="left"), Area(faces=np.array([0, 1], np.int32))])
def test_a_region_has_a_zone_at_its_edge_and_none_at_the_border(area):
    place = halves()
    found = whole(place, area, 6.0)
    x = place.dense.vertices[:, 0]
    assert np.allclose(found, target(x - 40.5, 6.0), atol=1e-3)


def test_faces_of_a_real_mesh():
    place = cow()
    faces = np.flatnonzero(place.mesh.vertices[place.mesh.faces][:, :, 1].mean(axis=1) > 0.3)
    area = Area(faces=faces.astype(np.int32))
    inside = np.isin(place.dense.face, faces)
    assert np.array_equal(whole(place, area) > 0, inside)
    soft = whole(place, area, 8 * place.step)
    assert (soft[inside] >= 0.5).all() and (soft[~inside] <= 0.5).all()
    assert abs(soft.sum() / inside.sum() - 1) < 0.03, "the area keeps its size"


def test_everywhere_and_a_region_that_covers_all():
    place = flat()
    everything = over(place, Area(everywhere=True), 9.0)
    assert (everything.target == 1).all() and len(everything.vertices) == 81 * 101
    assert (whole(place, Area(region="all"), 9.0) == 1).all(), "a mesh without regions is one"


def test_vertices_belong_to_a_rate():
    place = flat()
    chosen = np.flatnonzero(place.dense.vertices[:, 0] < 30).astype(np.int32)
    area = Area(vertices=chosen, rate=place.dense.size)
    assert np.array_equal(over(place, area).vertices, chosen)
    with pytest.raises(InvalidEdit, match=f"of rate 17, the dense mesh has {place.dense.size}"):
        over(place, Area(vertices=chosen, rate=17))


@pytest.mark.parametrize(
    ("area", "said"),
    [
        (
            Area(faces=np.array([0, 4], np.int32)),
            "face 4 of an area is not among the 4 of the mesh",
        ),
        (Area(faces=np.array([-1], np.int32)), "face -1 of"),
        (Area(region="top"), "no region 'top'; it has 'left', 'right'"),
        (
            Area(vertices=np.array([4941], np.int32), rate=82),
            "vertex 4941 of an area is not among the 4,941 of the dense mesh at 82",
        ),
        (
            Area((Stroke(np.array([[0, 0, 9.0], [9, 0, 9.0]]), 2.0),)),
            r"none of the 4,941 vertices .* 0 dabs lie on the surface, 19 beside it, and 0 have",
        ),
        (
            Area((Stroke(np.array([[9, -9, 0.0]]), 2.0, pressure=np.zeros(1)),)),
            "0 dabs lie on the surface, 0 beside it, and 1 have no pressure",
        ),
        (
            Area((Stroke(np.array([[9.4, -9.6, 0.0]]), 0.1),)),
            r"1 strokes of up to 0\.1 steps radius 1 dabs lie on",
        ),
    ],
)
def test_an_area_that_does_not_fit_is_named(area, said):
    with pytest.raises(InvalidEdit, match=said):
        over(halves(), area)


def test_faces_too_small_for_any_vertex_are_named():
    place = cow()
    free = np.setdiff1d(np.arange(len(place.mesh.faces)), place.dense.face)[:3].astype(np.int32)
    assert len(free) == 3
    with pytest.raises(InvalidEdit, match="covers none of the 8,580 .*: 3 faces hold none of them"):
        over(place, Area(faces=free))


def test_a_set_on_one_side_of_a_wall_leaves_the_other_alone():
    place = walls()
    half = len(place.dense.vertices) // 2
    x = place.dense.vertices[:, 0]
    inside = (np.arange(2 * half) < half) & (x < 20)
    psi = signed_distance(place.net, inside, 5.0)
    assert np.isposinf(psi[half:]).all()


def test_signed_distance_of_half_a_plane():
    place = flat()
    x = place.dense.vertices[:, 0]
    psi = signed_distance(place.net, x < 50, 12.0)
    true = (x - 49.5) / place.step
    near = np.abs(true) < 12
    assert np.allclose(psi[near], true[near], atol=1e-3)
    assert np.isneginf(psi[true < -12.1]).all() and np.isposinf(psi[true > 12.1]).all()


def test_signed_distance_of_a_cap():
    place = ball()
    height = place.dense.vertices[:, 2]
    psi = signed_distance(place.net, height > 0.3, 10.0)
    true = (np.arccos(0.3) - np.arccos(np.clip(height, -1, 1))) / place.step
    near = np.abs(true) < 9
    error = psi[near] + true[near]  # inside is negative
    assert np.abs(error).mean() < 0.3 and np.abs(error).max() < 1.0


def test_signed_distance_without_an_edge():
    place = flat()
    everywhere = np.ones(81 * 101, bool)
    assert np.isneginf(signed_distance(place.net, everywhere, 5.0)).all()
    assert np.isposinf(signed_distance(place.net, ~everywhere, 5.0)).all()


def test_the_edge_equals_its_twin():
    place = cow()
    net = place.net
    inside = np.random.default_rng(0).random(len(place.dense.vertices)) < 0.5
    inside |= place.dense.vertices[:, 0] > 0
    seeds, start = _edge_of(net.indptr, net.indices, net.edge, inside)
    tail = np.repeat(np.arange(len(inside)), np.diff(net.indptr))
    crossing = inside[tail] != inside[net.indices]
    half = np.full(len(inside), np.inf)
    np.minimum.at(
        half, tail[crossing], np.linalg.norm(net.edge[crossing].astype(np.float64), axis=1) / 2
    )
    assert np.array_equal(seeds, np.flatnonzero(np.isfinite(half)))
    assert np.allclose(start, half[seeds], rtol=1e-12)
