"""Contact sheets show the measured images that they name, where they name them."""

import numpy as np
import pytest

from app.contact import Sheet, contact_sheet, parse_angles
from btfcore.btf.colour import linear_to_srgb
from btfcore.errors import InvalidParameter
from tests.btf.bricks import LIGHTS, VIEWS, sample


def test_angles_are_parsed():
    found = parse_angles("0,0 45,90; 60,-90", "view")
    assert found == pytest.approx(
        np.array([[0, 0, 1], [0, 0.70711, 0.70711], [0, -0.86603, 0.5]]), abs=1e-5
    )


@pytest.mark.parametrize("text", ["", "45", "a,b", "90,0", "-1,0", "nan,0", "10,1e9", "1,2,3"])
def test_other_texts_are_refused(text):
    with pytest.raises(InvalidParameter, match="view"):
        parse_angles(text, "view")


def test_cells_hold_the_nearest_measured_images():
    whole = sample()
    page = contact_sheet([whole], Sheet(VIEWS[[0, 3]], LIGHTS[[2, 8]], cell=24))
    assert page.shape == (4 + 2 * 44, 4 + 2 * 28, 3)
    # 6 x 8 texels, thrice as large, in the middle of a cell of 24
    shown = page[4 + 44 + 3 : 4 + 44 + 21 : 3, 4 + 28 : 4 + 28 + 24 : 3]
    wanted = np.round(linear_to_srgb(whole.image(3, 8)) * 255)
    assert np.array_equal(shown, wanted)


def test_exposure_is_in_stops():
    whole = sample()
    plain = contact_sheet([whole], Sheet(VIEWS[:1], LIGHTS[:1], cell=16, exposure=-3.0))
    assert np.array_equal(
        plain[4 + 2 : 18 : 2, 4:20:2][:6],
        np.round(linear_to_srgb(whole.image(0, 0) / 8) * 255),
    )


def test_absurd_sheets_are_refused():
    with pytest.raises(InvalidParameter, match="cells of 5 pixels"):
        contact_sheet([sample()], Sheet(VIEWS, LIGHTS, cell=5))
    with pytest.raises(InvalidParameter, match="too large"):
        contact_sheet([sample()] * 200, Sheet(VIEWS, LIGHTS, cell=2048))
