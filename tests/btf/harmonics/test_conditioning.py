"""What lights determine is fitted, the rest is refused with the numbers."""

import numpy as np
import pytest

from btfcore.btf.directions import layout, rings
from btfcore.btf.harmonics.basis import evaluate
from btfcore.btf.harmonics.conditioning import check_order, conditioning, largest_order
from btfcore.errors import InvalidParameter

LARGEST = {
    "12x8x12x8": (4, 5),
    "12x5x12x5": (4, 4),
    "ubo81": (4, 5),
    "ubo151": (4, 6),
}


@pytest.mark.parametrize("name", LARGEST)
def test_largest_orders_of_the_layouts(name):
    lights = layout(name).lights
    kinds = ("spherical", "hemispherical")
    assert tuple(largest_order(lights, kind) for kind in kinds) == LARGEST[name]


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_the_condition_is_that_of_the_matrix(kind):
    lights = layout("ubo81").lights
    found = conditioning(lights, 3, kind)
    assert found.condition == pytest.approx(np.linalg.cond(evaluate(lights, 3, kind)), rel=1e-9)
    assert found.sound and found.rank == found.functions == 16


def test_hemispherical_harmonics_are_the_better_conditioned_ones():
    for name in LARGEST:
        lights = layout(name).lights
        for order in range(1, 5):
            spherical = conditioning(lights, order).condition
            assert conditioning(lights, order, "hemispherical").condition < spherical / 2


def test_order_six_on_twelve_azimuths_is_refused_with_the_numbers():
    with pytest.raises(InvalidParameter) as caught:
        check_order(layout("12x8x12x8").lights, 6, name="wool")
    text = str(caught.value)
    assert text.startswith("wool: spherical harmonics of order 6")
    for part in ("49", "96 lights", "12 azimuths", "half of that, 6", "sin 6φ is zero"):
        assert part in text
    assert "up to 4 (spherical) or 5 (hemispherical)" in text and "regularise" in text


def test_the_rings_where_the_cosine_vanishes():
    turned = rings([(theta, 12, 15) for theta in np.linspace(5, 75, 8)])
    assert conditioning(turned, 6).vanishing == ("cos 6φ",)
    assert conditioning(turned, 5).vanishing == ()


def test_azimuths_are_counted_around_the_circle():
    assert conditioning(rings([(0, 1, 0), (30, 5, 0), (60, 5, 36)]), 1).azimuths == 10
    assert conditioning(rings([(30, 4, 0), (60, 8, 360)]), 1).azimuths == 8
    assert conditioning(rings([(0, 1, 0)]), 1).azimuths == 1


@pytest.mark.parametrize("kind", ["spherical", "hemispherical"])
def test_a_single_ring_and_a_single_light_determine_the_constant_only(kind):
    for lights in (rings([(40, 24, 0)]), rings([(40, 1, 0)])):
        assert check_order(lights, 0, kind).condition == pytest.approx(1)
        with pytest.raises(InvalidParameter, match=r"only (1|3) of .* up to 0 \("):
            check_order(lights, 1, kind)


def test_nearly_repeated_lights_count_once():
    lights = layout("12x5x12x5").lights[::7]
    assert len(lights) == 9
    twice = np.concatenate([lights, lights + 1e-9])
    assert conditioning(twice, 4).rank <= 9


def test_regularised_combinations_pass():
    found = check_order(layout("12x8x12x8").lights, 6, singular="regularise")
    assert not found.sound and found.rank < 49


@pytest.mark.parametrize("knob", [{"singular": "maybe"}, {"limit": 0.5}, {"limit": float("nan")}])
def test_knobs_out_of_range(knob):
    with pytest.raises(InvalidParameter, match=next(iter(knob))):
        check_order(layout("ubo81").lights, 2, **knob)
