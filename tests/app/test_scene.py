"""Pictures without a display; PyQt6 must not be needed for them."""

import io
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from app.scene import BACK, FRONT, render, render_preview
from btfcore.errors import OutputFailed
from btfcore.files.surface import export_input
from btfcore.render.modes import chart_colours, field_colours, seam_colours
from btfcore.render.texture import atlas_texture, vertex_colours
from tests.app.fakes import quilt
from tests.surfaces import blobs


@pytest.fixture(scope="module")
def drawn(ring):
    """Surface, and the atlas image of every mode."""
    mesh, atlas, dense, field = ring
    sample = blobs()
    done = quilt(dense, sample)
    colours = vertex_colours(done, [sample])
    modes = {
        "colour": colours,
        "seams": seam_colours(dense, done, colours),
        "charts": chart_colours(dense),
        "field": field_colours(dense, field),
    }
    return export_input(mesh, atlas), {k: atlas_texture(dense, v) for k, v in modes.items()}


def test_every_mode_shows_another_picture(drawn):
    surface, textures = drawn
    pictures = [render(surface, each, [FRONT], size=(120, 90))[0] for each in textures.values()]
    for place, picture in enumerate(pictures):
        assert picture[..., 3].max() == 255 and picture[0, 0, 3] == 0
        inside = picture[picture[..., 3] == 255][:, :3].astype(float)
        assert inside.mean() > 40
        for other in pictures[:place]:
            assert np.abs(picture.astype(int) - other).max() > 60
            assert np.array_equal(picture[..., 3], other[..., 3])


def test_a_lit_texture_keeps_its_colour(drawn):
    surface, textures = drawn
    flat = np.full_like(textures["colour"], [180, 90, 40])
    picture = render(surface, flat, [FRONT], size=(160, 120))[0]
    inside = picture[picture[..., 3] == 255][:, :3].astype(float)
    ratio = inside / [180, 90, 40]
    assert np.ptp(ratio, axis=1).max() < 0.06  # the light is white
    assert 0.9 < np.quantile(ratio, 0.9) < 1.15
    assert np.median(ratio) > 0.75


def test_the_texture_is_upright_on_the_surface(drawn):
    """The atlas's upper rows lie where uv says: on the torus, row 0 is the outer rim."""
    surface, textures = drawn
    size = len(textures["colour"])
    marked = np.full_like(textures["colour"], 40)
    marked[size // 8 : size // 2 - size // 8] = [250, 40, 40]  # v < 0: the torus' lower half
    above = render(surface, marked, [type(FRONT)(0, 85)], size=(90, 90))[0][..., 0]
    below = render(surface, marked, [type(FRONT)(0, -85)], size=(90, 90))[0][..., 0]
    assert below.mean() > 2 * above.mean()


def test_previews_are_the_same_every_time_and_whole(drawn, tmp_path):
    surface, textures = drawn
    target = tmp_path / "p.png"
    first = render_preview(target, surface, textures["colour"], sample=blobs(), size=(240, 180))
    again = render_preview(None, surface, textures["colour"], sample=blobs(), size=(240, 180))
    assert first.shape == (180, 240, 3)
    assert np.array_equal(first, again)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(target.read_bytes()))), first)
    assert [each.name for each in tmp_path.iterdir()] == ["p.png"]


def test_front_and_back_differ_and_seams_add_a_view(drawn):
    surface, textures = drawn
    marked = textures["colour"].copy()
    marked[:, : marked.shape[1] // 2] = 255
    front, back = render(surface, marked, [FRONT, BACK], size=(100, 100))
    assert np.abs(front.astype(int) - back).mean() > 5
    wide = render_preview(
        None, surface, textures["colour"], seams=textures["seams"], size=(300, 100)
    )
    yellow = (wide[..., 0] > 150) & (wide[..., 1] > 120) & (wide[..., 2] < 60)
    assert yellow[:, 200:].sum() > 20 and yellow[:, :200].sum() < 5


def test_far_and_tiny_surfaces_look_the_same(drawn, ring):
    mesh, atlas, *_ = ring
    surface, textures = drawn
    moved = type(mesh)(mesh.vertices * 1e-3 + 1e4, mesh.faces)
    other = export_input(moved, type(atlas)(moved, atlas.uv, atlas.chart, atlas.size))
    one, two = (render(s, textures["colour"], [FRONT], size=(100, 80))[0] for s in (surface, other))
    assert np.abs(one.astype(int) - two).mean() < 2


def test_a_preview_that_cannot_be_written_is_named(drawn, tmp_path):
    surface, textures = drawn
    with pytest.raises(OutputFailed, match="nowhere"):
        render_preview(tmp_path / "nowhere" / "p.png", surface, textures["colour"], size=(60, 40))


def test_the_scene_needs_no_qt_and_no_display():
    code = (
        "import sys, numpy as np\n"
        "from tests.app.fakes import torus\n"
        "from btfcore.files.surface import export_input\n"
        "from app.scene import render_preview\n"
        "mesh, atlas, *_ = torus(32, 8)\n"
        "texture = np.full((32, 32, 3), 200, np.uint8)\n"
        "picture = render_preview(None, export_input(mesh, atlas), texture, size=(80, 60))\n"
        "assert np.ptp(picture) > 50\n"
        "assert not {'PyQt6', 'pyvistaqt'} & set(sys.modules)\n"
    )
    environment = {"PATH": "/usr/bin:/bin", "HOME": "/tmp"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
