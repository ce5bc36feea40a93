"""Bakes of PBR sets that others made."""

import numpy as np
import pytest

from btfcore.btf.bake.build import baked
from btfcore.btf.bake.maps import resized
from btfcore.btf.bake.relief import relief
from btfcore.btf.readers.pbr_files import read_pbr
from tests.btf.bake.fields import direction

# in texels of 512; what their makers' previews suggest, and what the normal maps say
DEPTHS = {"Bricks102": 7, "bark": 6.8, "seaside_rocks": 7.3, "rustymetal": 1, "facade": 0.6}


@pytest.mark.parametrize("name", [*DEPTHS, "Metal049A", "godot_bricks", "wool"])
def test_real_sets_bake_soundly(name, data):
    made = read_pbr(data / "textures" / f"pbr_{name}")
    field = relief(made)
    if name in DEPTHS:
        assert field.depth == pytest.approx(DEPTHS[name], rel=0.15)
    assert field.flat == (name == "Metal049A")
    assert not any("seems" in note for note in field.notes)  # the reader settled that
    small = resized(made, 64)
    assert relief(small).depth == pytest.approx(field.depth / 8)
    views = [direction(0, 0), direction(60, 30), direction(75, 200)]
    lights = [direction(15, 100), direction(60, 300), direction(75, 45)]
    sample = baked(small, views, lights)
    found = sample.stack.read(np.arange(9))
    assert np.isfinite(found).all() and (found >= 0).all()
    assert 0.005 < np.median(found[0]) < 1.5
    matt = baked(small, views[:1], lights[:1], reflectance=0).image(0, 0).mean(axis=2)
    if made.metallic is None:  # seen and lit from above it is the albedo, hardly shaded
        albedo = small.albedo.mean(axis=2)
        assert np.corrcoef(matt.ravel(), albedo.ravel())[0, 1] > 0.7
