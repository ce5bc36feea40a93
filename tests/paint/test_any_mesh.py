"""Edits of all kinds on shipped meshes: nothing crashes, strays, or cannot be taken back."""

import pytest

from btfcore.pipeline import load_mesh
from tests.paint.scenes import MESHES, spotted
from tests.paint_corpus import painted


@pytest.mark.parametrize("name", ["knot.obj", "open_box.obj", "torus.obj"])
def test_all_kinds_of_edits_on_shipped_meshes(name):
    assert painted(load_mesh(MESHES / name)[0], spotted(), 64) == []
