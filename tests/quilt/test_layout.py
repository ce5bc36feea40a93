"""Laws of borders: what a hard one cuts, and how far a soft one lets samples reach."""

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.patch.connectivity import connect
from btfcore.quilt.layout import Borders, lay_out
from tests.surfaces import constant_field, plane, sphere


@pytest.fixture(scope="module")
def net():
    dense = plane(30, 60)
    return connect(dense, constant_field(dense))


def strips(*widths, rows=30):
    """Regions 0, 1, … as vertical strips of a plane."""
    return np.tile(np.repeat(np.arange(len(widths)), widths), rows).astype(np.int32)


def pairs(net):
    """Both ends of every half-edge."""
    return np.repeat(np.arange(len(net.indptr) - 1), np.diff(net.indptr)), net.indices


def levels(net, seeds):
    """Twin: breadth-first distance (N,) from `seeds`."""
    tail, head = pairs(net)
    away = np.where(seeds, 0, 10**6)
    while True:
        nearer = away.copy()
        np.minimum.at(nearer, head, away[tail] + 1)
        if (nearer == away).all():
            return away
        away = nearer


def test_a_hard_border_leaves_no_edge_and_no_face_across(net):
    region = strips(20, 40)
    layout = lay_out(net, region, [0, 1], Borders.all(True), 12)
    tail, head = pairs(layout.net)
    assert (region[tail] == region[head]).all()
    assert (region[layout.net.faces] == region[layout.net.faces[:, :1]]).all()
    before = region[pairs(net)[0]] == region[pairs(net)[1]]
    assert len(layout.net.indices) == before.sum(), "no other edge goes"
    assert np.array_equal(layout.net.edge, net.edge[before])
    assert np.array_equal(layout.net.turn, net.turn[before])
    whole = (region[net.faces] == region[net.faces[:, :1]]).all(axis=1)
    assert np.array_equal(layout.net.area, net.area[whole])
    assert (layout.allowed == (region == [[0], [1]])).all()
    for vertex in (0, 500, len(region) - 1):
        faces = layout.net.face_of[layout.net.face_ptr[vertex] : layout.net.face_ptr[vertex + 1]]
        assert (layout.net.faces[faces] == vertex).any(axis=1).all()
        assert len(faces) == (layout.net.faces == vertex).sum()


@pytest.mark.parametrize("width", [0, 1, 7])
def test_a_soft_border_is_crossed_by_so_many_levels(net, width):
    region = strips(20, 40)
    layout = lay_out(net, region, [0, 1], Borders.all(False), width)
    assert layout.net is net
    for sample in (0, 1):
        away = levels(net, region == sample)
        assert np.array_equal(layout.allowed[sample], away <= width)


def test_a_thin_region_keeps_a_core(net):
    region = strips(25, 6, 29)
    layout = lay_out(net, region, [0, 1, 0], Borders.all(False), 12)
    middle = region == 1
    assert layout.allowed[1][middle].all()
    assert (~layout.allowed[0][middle]).sum() >= middle.sum() / 3
    assert layout.allowed[0][middle].any()


def test_borders_named_one_by_one(net):
    region = strips(15, 15, 15, 15)
    borders = Borders(True, np.array([[1, 2]], np.int32), np.array([False]))
    layout = lay_out(net, region, [0, 1, 2, 0], borders, 5)
    tail, head = pairs(layout.net)
    crossing = {(int(a), int(b)) for a, b in zip(region[tail], region[head], strict=True)}
    assert {(1, 2), (2, 1)} <= crossing and not crossing & {(0, 1), (1, 0), (2, 3), (3, 2)}
    assert not layout.allowed[0][(region == 1) | (region == 2)].any()
    assert layout.allowed[1][region == 2].any() and layout.allowed[2][region == 1].any()


def test_regions_of_one_sample_have_no_border_but_one_that_is_named(net):
    region = strips(30, 30)
    layout = lay_out(net, region, [0, 0], Borders.all(True), 5)
    assert layout.net is net and layout.allowed.all()
    named = Borders(False, np.array([[1, 0]], np.int32), np.array([True]))
    layout = lay_out(net, region, [0, 0], named, 5)
    tail, head = pairs(layout.net)
    assert (region[tail] == region[head]).all()


def test_a_sample_does_not_pass_through_a_soft_neighbour_into_a_hard_one():
    dense = plane(30, 40)
    net = connect(dense, constant_field(dense))
    column, row = np.tile(np.arange(40), 30), np.repeat(np.arange(30), 40)
    region = np.where(column < 10, 0, np.where(row < 15, 1, 2)).astype(np.int32)
    borders = Borders(False, np.array([[0, 2]], np.int32), np.array([True]))
    layout = lay_out(net, region, [0, 1, 2], borders, 7)
    assert not layout.allowed[0][region == 2].any()
    assert layout.allowed[0][region == 1].any() and layout.allowed[1][region == 2].any()


def test_every_vertex_may_take_its_own_sample():
    dense = sphere(3)
    net = connect(dense, constant_field(dense))
    region = np.random.default_rng(0).integers(0, 5, len(dense.vertices)).astype(np.int32)
    layout = lay_out(net, region, [2, 0, 1, 0, 2], Borders.all(False), 12)
    assert layout.allowed[layout.home, np.arange(len(region))].all()


def test_numbers_out_of_range_are_named(net):
    with pytest.raises(InvalidParameter, match="shape"):
        lay_out(net, np.zeros(5, np.int32), [0], Borders.all(True), 3)
    with pytest.raises(InvalidParameter, match="regions"):
        lay_out(net, strips(20, 40), [0], Borders.all(True), 3)
    with pytest.raises(InvalidParameter, match="samples"):
        lay_out(net, strips(20, 40), [0, -1], Borders.all(True), 3)
