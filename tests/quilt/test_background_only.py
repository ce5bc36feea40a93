"""Laws of a synthesis that leaves the features of its samples out."""

from dataclasses import replace

import numpy as np
import pytest

from btfcore.errors import InvalidImage
from btfcore.patch.resample import look_up
from btfcore.quilt.background import Room
from btfcore.quilt.fitting import barred_places
from btfcore.quilt.layout import Borders, lay_out
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.refine import refine
from btfcore.quilt.sheet import BARRED, roomy, sheet_of
from btfcore.quilt.synthesize import Synthesizer
from tests.quilt.test_several_samples import factors, halves, same
from tests.surfaces import blobs, constant_field, plane, random_field, sphere


def stained(height=72, width=80, *, kind="disk", seed=0):
    """Blobs with a soft feature that is far darker than anything else."""
    from scipy.ndimage import gaussian_filter

    row, column = np.mgrid[:height, :width]
    if kind == "disk":
        mask = np.hypot(row - 0.45 * height, column - 0.5 * width) < 0.25 * height
    elif kind == "net":
        mask = (row % 26 < 8) | (column % 30 < 8)
    else:
        mask = column > 0.6 * width
    mask = gaussian_filter(mask.astype(np.float32), 1.0)
    plain = blobs(height, width, seed)
    colour = (plain.colour * (1 - mask[..., None])).astype(np.float32)
    return replace(plain, colour=colour, channels=colour.copy(), mask=mask)


def shown(quilt, sample):
    """Feature (N,) at what every vertex shows of a sample."""
    return look_up(np.ascontiguousarray(sample.mask[..., None]), quilt.source)[:, 0]


SURFACES = {
    "plane": lambda: plane(70, 80),
    "sphere": lambda: sphere(4),
}


@pytest.mark.parametrize("kind", ["disk", "net", "half"])
@pytest.mark.parametrize(
    "knobs", [{}, {"scale": 0.6}, {"scale": 1.7}, {"reuse": 1.0}, {"sway": 0.0}, {"beside": 1}]
)
def test_no_vertex_lies_on_a_feature_and_all_are_covered(kind, knobs):
    dense = plane(60, 70)
    sample = stained(kind=kind)
    engine = Synthesizer(
        dense, constant_field(dense), sample, QuiltParameters(features=False, seed=3, **knobs)
    )
    quilt = engine.run()
    assert (quilt.patch >= 0).all() and engine.statistics.covered == 1.0
    # on the grid not even the soft edge is taken; at full size, that is the sample itself
    barred = barred_places(engine.sheet.barred, engine.sheet.frames[0], engine.state.source)
    assert not barred.any()
    assert shown(quilt, sample).max() <= (BARRED + 1e-6 if knobs.get("scale", 1) >= 1 else 0.5)
    refine(engine, tries=6)
    assert shown(engine.state.quilt(engine.sheet), sample).max() <= 0.5
    assert not barred_places(engine.sheet.barred, engine.sheet.frames[0], engine.state.source).any()


def test_features_would_be_taken_otherwise():
    dense = plane(60, 70)
    sample = stained()
    quilt = Synthesizer(dense, constant_field(dense), sample, QuiltParameters(seed=3)).run()
    assert (shown(quilt, sample) > 0.5).any()


@pytest.mark.parametrize("surface", sorted(SURFACES))
@pytest.mark.parametrize("literal", [False, True])
def test_wild_fields_and_the_papers_way_keep_clear_as_well(surface, literal):
    dense = SURFACES[surface]()
    sample = stained(kind="net")
    engine = Synthesizer(
        dense, random_field(dense), sample, QuiltParameters(features=False, literal=literal)
    )
    quilt = engine.run()
    assert (quilt.patch >= 0).all() and shown(quilt, sample).max() <= BARRED + 1e-6


def test_several_samples_keep_clear_of_their_own_features():
    dense = sphere(4)
    field = constant_field(dense, (0, 0, 1.0))
    from btfcore.patch.connectivity import connect

    net = connect(dense, field)
    other = factors()
    mask = np.zeros(other.colour.shape[:2], np.float32)
    mask[20:30, 10:60] = 1
    samples = [stained(), replace(other, mask=mask)]
    parameters = QuiltParameters(features=False)
    layout = lay_out(net, halves(dense), [0, 1], Borders.all(False), parameters.border)
    quilt = Synthesizer(dense, field, samples, parameters, layout=layout).run()
    assert (quilt.patch >= 0).all() and set(quilt.sample.tolist()) == {0, 1}
    for index, sample in enumerate(samples):
        assert shown(quilt, sample)[quilt.sample == index].max() <= BARRED + 1e-6


def test_masks_make_no_difference_where_features_are_wanted():
    dense = plane(50, 60)
    sample = stained()
    for knobs in ({}, {"reuse": 1.0}, {"literal": True}):
        parameters = QuiltParameters(seed=5, **knobs)
        plain = replace(sample, mask=None)
        one = Synthesizer(dense, constant_field(dense), sample, parameters)
        two = Synthesizer(dense, constant_field(dense), plain, parameters)
        assert len(one.sheet.barred) == 0
        assert same(one.run(), two.run())
        # and leaving features out leaves nothing out where there is none
        three = Synthesizer(
            dense, constant_field(dense), plain, replace(parameters, features=False)
        )
        assert same(two.state.quilt(two.sheet), three.run())


def test_a_feature_that_leaves_no_background_is_refused_with_its_share():
    sample = stained()
    full = np.ones_like(sample.mask)
    full[:20, :10] = 0
    with pytest.raises(InvalidImage, match=r"'blobs': its feature covers 96.5 % of it"):
        sheet_of([replace(sample, mask=full)], [1.0], match_channels=4, features=False)
    crossed = np.ones_like(sample.mask)
    crossed[::3], crossed[:, ::3] = 0, 0  # much is free, but no three texels together
    with pytest.raises(InvalidImage, match=r"covers 44.\d % of it; too little background"):
        sheet_of([replace(sample, mask=crossed)], [1.0], match_channels=4, features=False)
    with pytest.raises(InvalidImage, match="a mask of 3 x 3 texels for 80 x 72"):
        sheet_of(
            [replace(sample, mask=np.zeros((3, 3), np.float32))], [1.0], match_channels=4,
            features=False,
        )  # fmt: skip


def test_little_background_still_covers_the_surface():
    sample = stained()
    mask = np.ones_like(sample.mask)
    mask[10:16, 20:50] = 0  # a strip six texels wide
    mask[40:50, 5:25] = 0
    sample = replace(sample, mask=mask)
    dense = plane(40, 40)
    quilt = Synthesizer(dense, constant_field(dense), sample, QuiltParameters(features=False)).run()
    assert (quilt.patch >= 0).all() and shown(quilt, sample).max() <= BARRED + 1e-6


def test_a_place_is_barred_where_its_bilinear_value_has_part_of_a_feature():
    random = np.random.default_rng(2)
    barred = random.random((30, 20)) < 0.2
    frame = np.array([10, 14, 20, 3], np.int32)  # the second sample of a sheet
    place = (random.random((400, 2)) * [24, 18] - 2).astype(np.float32)
    place[:80] = np.round(place[:80])
    place[80:100, 0] = np.round(place[80:100, 0])
    part = barred[10:24, :20].astype(np.float64)
    from scipy.ndimage import map_coordinates

    at = np.clip(place.astype(np.float64), 0, [19, 13])[:, ::-1].T
    twin = map_coordinates(part, at, order=1, mode="nearest") > 0
    assert np.array_equal(barred_places(barred, frame, place), twin)
    assert not barred_places(np.zeros((0, 0), bool), frame, place).any()


def test_room_is_told_where_there_is_some():
    barred = np.zeros((40, 60), bool)
    barred[:, 20:30] = True
    room = Room(barred, 2.0)
    penalty = room.penalty(8.0)
    assert penalty[20, 25] > 2.0 and penalty[20, 55] == 0.0
    assert (np.diff(penalty[20, 30:50]) <= 1e-12).all()
    for share in (0.0, 0.4, 0.999, 1.0):
        column, row = room.start(share)
        assert not barred[int(row) - 6 : int(row) + 7, int(column) - 6 : int(column) + 7].any()
    assert room.nearest(np.array([24.0, 20.0])).tolist() == [17.0, 20.0]
    assert room.nearest(np.array([-50.0, 90.0])).tolist() == [2.0, 37.0]
    assert np.array_equal(roomy(barred, 1)[1:-1, 1:19], np.ones((38, 18), bool))
    assert not roomy(barred, 1)[:, 19:31].any() and not roomy(barred, 1)[0].any()
