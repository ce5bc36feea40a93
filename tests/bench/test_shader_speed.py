"""The measurement of the shader runs anywhere and says on what."""

from app.backend import is_software
from tests.bench.shader import measure_shader


def test_it_draws_and_names_the_renderer():
    found = measure_shader((64, 48), 96, 0.05, rank=4, layout="ubo81", lights=2)
    assert found.frames >= 2 and found.frames_a_second > 0
    assert found.renderer and found.software == is_software(found.renderer)
    assert 0.1 < found.covered < 0.9
    assert (found.size, found.rate, found.rank, found.lights) == ((64, 48), 96, 4, 2)
