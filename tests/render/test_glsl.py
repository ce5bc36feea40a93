"""What the shader reads: lists in textures, tables, maps of the atlas."""

import re

import numpy as np
import pytest

from btfcore.btf.sample import from_picture
from btfcore.errors import InvalidParameter
from btfcore.render.glsl.directions import direction_set
from btfcore.render.glsl.harmonics import MOST_POINTS, order_of, sky_points, sky_values
from btfcore.render.glsl.layout import in_fours, listed, shift_of
from btfcore.render.glsl.samples import MOST_FACTORS, pack, unfit
from btfcore.render.glsl.surface import (
    SAMPLERS,
    SHADOWS,
    light_values,
    pack_maps,
    pack_shadows,
    program,
    sky_degree,
    tone_values,
    unfit_lights,
)
from btfcore.render.lights import Lights, directional
from btfcore.render.material import raw_material
from btfcore.render.surfels import BARE, Surfels
from tests.render.chance import factor_sample, harmonic_sample


def read(table, place):
    """What the shader's shift and mask find at a place of a list."""
    mask = (1 << table.shift) - 1
    return table.image[place >> table.shift, place & mask]


def constant(text, name):
    """Values of a constant array in GLSL."""
    found = re.search(rf"const int {name}\[\d+\] = int\[\d+\]\((.*?)\);", text)
    return [int(each) for each in found[1].split(",")]


def row(packed, sample, number, weights):
    """`patinaRow` in numpy."""
    blocks = constant(packed.text, "BLOCKS")[sample]
    place = constant(packed.text, "FIRST_ROW")[sample] + number * (1 + 3 * blocks)
    value = read(packed.table, place)[:3].astype(float)
    fours = in_fours(weights[None])[0]
    for k in range(blocks):
        for colour in range(3):
            value[colour] += fours[k] @ read(packed.table, place + 1 + 3 * k + colour)
    return value


def elements(sample, source):
    count = len(sample)
    frame = np.tile(np.eye(3, dtype=np.float32), (count, 1, 1))
    return Surfels(
        np.zeros((count, 3), np.float32), frame, np.asarray(source, np.float32),
        np.asarray(sample, np.uint16),
    )  # fmt: skip


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 16, 17, 1000, 70_000])
def test_a_list_keeps_its_order(count):
    values = np.random.default_rng(0).normal(size=(count, 4)).astype(np.float32)
    table = listed([values[: count // 3], values[count // 3 :]])
    places = np.arange(count)
    found = table.image[places >> table.shift, places & ((1 << table.shift) - 1)]
    assert np.array_equal(found, values)
    assert table.image.shape[0] <= table.image.shape[1] == 1 << table.shift


def test_the_largest_list_is_named():
    assert shift_of(8192 * 8192) == 13
    with pytest.raises(InvalidParameter, match="67108865 texels of four numbers, where a texture"):
        shift_of(8192 * 8192 + 1)


def test_rows_of_the_tables_give_the_materials_own_values():
    one, two = factor_sample(rank=6), factor_sample(rank=9, layout="12x5x12x5", seed=2)
    harmonic = harmonic_sample(rank=5)
    packed = pack([one, harmonic, two])
    random = np.random.default_rng(5)
    for number, each in ((0, one), (2, two)):
        views, lights = each.table.shape[:2]
        assert constant(packed.text, "LIGHT_NODES")[number] == lights
        for a, b in ((0, 0), (3, 7), (views - 1, lights - 1)):
            weights = random.normal(size=each.rank)
            wanted = each.table[a, b, :, :-1] @ weights + each.table[a, b, :, -1]
            assert row(packed, number, a * lights + b, weights) == pytest.approx(wanted, abs=1e-5)
    weights = random.normal(size=5)
    wanted = np.einsum("k,kc->c", np.append(weights, 1), harmonic.components[:, 11])
    assert row(packed, 1, 11, weights) == pytest.approx(wanted, abs=1e-5)


def test_weights_lie_texel_by_texel_and_view_by_view():
    one, harmonic = factor_sample(rank=6, shape=(4, 5)), harmonic_sample(rank=5, shape=(3, 7))
    packed = pack([one, harmonic])
    first = constant(packed.text, "FIRST_WEIGHT")
    place = first[0] + (2 * 5 + 3) * 2
    found = np.concatenate([read(packed.weights, place), read(packed.weights, place + 1)])
    assert np.array_equal(found[:6], one.weights[2, 3]) and not found[6:].any()
    place = first[1] + (8 * 21 + 1 * 7 + 4) * 2
    found = np.concatenate([read(packed.weights, place), read(packed.weights, place + 1)])
    assert np.array_equal(found[:5], harmonic.weights[8, 1, 4])
    assert packed.bare == 2 and packed.shapes == ((4, 5, False), (3, 7, False), (1, 1, False))


@pytest.mark.parametrize("layout", ["ubo81", "ubo151", "12x8x12x8"])
def test_tables_of_directions_hold_every_node(layout):
    for method in ("grid", "barycentric", "nearest4", "nearest"):
        views = factor_sample(layout=layout, method=method).views
        found = direction_set(views)
        assert found.texels.dtype == np.float32 and np.isfinite(found.texels).all()
        rings, edges, side = found.counts
        if method == "grid":
            named = found.texels[rings:, 1]
            assert found.texels[:rings, 2].sum() == len(named)
        elif method == "barycentric":
            named = found.texels[: 3 * rings, 2]
            lists = 3 * rings + 2 * edges + side * side
            cells = found.texels[3 * rings + 2 * edges : lists]
            assert cells[:, 1].sum() == len(found.texels) - lists
        else:
            named = found.texels[:, 3]
        assert set(named.astype(int)) == set(range(len(views.mix)))
        assert found.held == pytest.approx(np.cos(np.radians(75)), abs=1e-5)


def test_positions_are_brought_into_their_sample():
    samples = pack([factor_sample(shape=(4, 5)), factor_sample(shape=(4, 5), tiles=True)])
    source = [[7.5, -2.0], [7.5, -2.5], [1.25, 3.5], [-1e-9, 4.0]]
    made = elements([0, 1, BARE, 1], source)
    gutter = np.array([[0, 1], [2, 3]], np.int32)
    maps = pack_maps(made, gutter, samples)
    assert maps.quilt[0, 0, :3].tolist() == [4.0, 0.0, 0.0]  # held at the border
    assert maps.quilt[0, 1, :3].tolist() == [2.5, 1.5, 1.0]  # wrapped
    assert maps.quilt[1, 0, :3].tolist() == [0.0, 0.0, 2.0]  # bare: the one grey texel
    assert maps.quilt[1, 1, :3].tolist() == [5.0, 0.0, 1.0]
    assert np.array_equal(maps.column[..., :3], np.broadcast_to([1, 0, 0], (2, 2, 3)))
    assert np.array_equal(maps.normal[..., :3], np.broadcast_to([0, 0, 1], (2, 2, 3)))
    with pytest.raises(InvalidParameter, match="names sample 3, 2 are given"):
        pack_maps(elements([3], [[0, 0]]), np.zeros((1, 1), np.int32), samples)


def test_shadows_fill_up_with_light():
    visible = np.array([[0.0, 1.0], [0.5, 0.25], [1.0, 0.0], [0.2, 0.4], [0.6, 0.8]], np.float32)
    low, high = pack_shadows(visible, np.array([[1, 0]], np.int32))
    assert low.tolist() == [[[255, 64, 0, 102], [0, 128, 255, 51]]]
    assert high.tolist() == [[[204, 255, 255, 255], [153, 255, 255, 255]]]
    with pytest.raises(InvalidParameter, match="shadows of 9 lights, where a shader takes 8"):
        pack_shadows(np.ones((9, 2), np.float32), np.array([[0]], np.int32))


def test_what_does_not_fit_is_named():
    sample = factor_sample()
    assert unfit([sample, harmonic_sample()], size=8192) == ""
    assert "atlas of 8193 x 8193" in unfit([sample], size=8193)
    assert "atlas of 2048 x 2048 texels is larger than the card's 1024" in unfit(
        [sample], size=2048, largest=1024
    )
    picture = from_picture("photo", np.full((2, 2, 3), 0.5, np.float32))
    assert "photo: raw images" in unfit([raw_material(picture)], size=64)
    many = factor_sample("many", rank=MOST_FACTORS + 1, shape=(1, 1), layout="3x1x3x1")
    assert "many: 129 factors" in unfit([many], size=64)
    large = factor_sample("large", shape=(40, 40))
    assert "samples' weights do not fit" in unfit([large], size=32, largest=32)
    with pytest.raises(InvalidParameter, match="do not fit on the card"):
        pack([large], largest=32)


def test_lights_that_do_not_fit_are_named():
    many = directional(np.tile([0.0, 0.0, 1.0], (65, 1)))
    assert "65 lights" in unfit_lights(many)
    sky = Lights(many.direction[:4], many.intensity[:4], 4, np.zeros((25, 3)))
    assert unfit_lights(sky) == ""
    assert sky_degree(pack([factor_sample()]), sky) == -1
    assert sky_degree(pack([factor_sample(), harmonic_sample(order=2)]), sky) == 6
    with pytest.raises(InvalidParameter, match="environment of order 7, a shader takes 6"):
        order_of(np.zeros((64, 3)))


def test_the_sky_is_integrated_exactly():
    """A constant environment of radiance 1 gives what a Lambertian surface shows: E over pi."""
    constant_sky = np.zeros((25, 3))
    constant_sky[0] = np.sqrt(4 * np.pi)
    values = np.array(sky_values(constant_sky, 12)).reshape(-1, 4)
    assert len(values) == MOST_POINTS
    assert values[:, :3].sum(axis=0) == pytest.approx(4, abs=1e-12)  # 4 pi over pi
    assert sky_points(12).startswith("#define SKY_POINTS 91\n")


def test_uniforms():
    lights = directional([[0, 0, 2], [3, 0, 0]], [[1, 2, 3], [4, 5, 6]])
    values = np.array(light_values(lights)).reshape(64, 2, 4)
    assert values[1].tolist() == [[1, 0, 0, 0], [4, 5, 6, 0]] and not values[2:].any()
    assert tone_values(2.0, "filmic", 4.0) == (4.0, 2.0, 4.0, 0.0)
    with pytest.raises(InvalidParameter, match="curve 'film'"):
        tone_values(0.0, "film", 4.0)
    with pytest.raises(InvalidParameter, match="exposure of nan stops"):
        tone_values(float("nan"), "clip", 4.0)


def test_the_program_has_only_what_its_samples_need():
    plain = program(pack([factor_sample(method="grid")]), 64)
    assert "patinaGrid" in plain
    for word in ("patinaTriangle", "patinaNearest", "#define HARMONICS", "#define SHADOWS"):
        assert word not in plain
    full = program(pack([factor_sample(method="nearest4"), harmonic_sample()]), 64, shadows=True)
    for word in ("patinaNearest", "#define HARMONICS", "#define SHADOWS", *SAMPLERS, *SHADOWS):
        assert word in full
    assert len(SAMPLERS) + len(SHADOWS) <= 8
    assert plain.isascii() and full.isascii()
