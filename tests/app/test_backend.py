"""Which backend a machine gets, and why."""

from dataclasses import replace

import pytest

from app.backend import VARIABLE, Machine, detect, is_software, version_of
from btfcore.errors import InvalidParameter

CARD = Machine("NVIDIA GeForce RTX 3060/PCIe/SSE2", "4.6.0 NVIDIA 535.183.01", 32768, 32)
SOFTWARE = (
    "llvmpipe (LLVM 15.0.6, 256 bits)",
    "softpipe",
    "SWR (LLVM 11.0.0, 256 bits)",
    "Google SwiftShader",
    "ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader driver)",
    "Microsoft Basic Render Driver",
    "D3D12 (Microsoft Basic Render Driver)",
    "GDI Generic",
    "Software Rasterizer",
    "Apple Software Renderer",
    "virgl (LLVMPIPE (LLVM 15.0.7 256 bits))",
)
CARDS = (
    "NVIDIA H100 80GB HBM3/PCIe/SSE2",
    "AMD Radeon RX 6800 XT (navi21, LLVM 15.0.7, DRM 3.49, 6.1.0)",
    "Mesa Intel(R) UHD Graphics 620 (KBL GT2)",
    "Apple M2",
    "D3D12 (NVIDIA GeForce RTX 3060)",
    "zink Vulkan 1.3 (NVIDIA RTX A2000 (NVIDIA_PROPRIETARY))",
)


@pytest.fixture(autouse=True)
def nothing_asked(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)


@pytest.mark.parametrize("renderer", SOFTWARE)
def test_drivers_that_draw_on_the_processor_evaluate_there(renderer):
    assert is_software(renderer)
    found = detect(replace(CARD, renderer=renderer))
    assert found.kind == "software" and not found.is_shader
    assert renderer in found.reason


@pytest.mark.parametrize("renderer", CARDS)
def test_graphics_cards_run_the_shader(renderer):
    assert not is_software(renderer)
    found = detect(replace(CARD, renderer=renderer))
    assert found.is_shader and renderer in found.reason


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"renderer": ""}, "no OpenGL context"),
        ({"version": "2.1 INTEL-18.8.4"}, "OpenGL 2.1 INTEL-18.8.4; the shader needs 3.2"),
        ({"version": "3.1"}, "needs 3.2"),
        ({"version": "OpenGL ES 3.2 Mesa"}, "needs 3.2"),
        ({"version": ""}, "of an unknown version"),
        ({"side": 2048}, "2048 texels a side; the shader needs 4096"),
        ({"samplers": 4}, "reads 4 textures"),
    ],
)
def test_a_machine_that_lacks_something_is_told_what(change, words):
    machine = replace(CARD, **change)
    for wanted in (None, "auto", "shader"):
        found = detect(machine, wanted)
        assert found.kind == "software" and words in found.reason


def test_arguments_and_the_environment_override(monkeypatch):
    slow = replace(CARD, renderer="llvmpipe")
    assert detect(CARD, "software").kind == "software"
    assert detect(slow, "shader").kind == "shader"
    monkeypatch.setenv(VARIABLE, " Shader ")
    assert detect(slow).kind == "shader"
    assert detect(slow, "auto").kind == "software"  # an argument counts more
    monkeypatch.setenv(VARIABLE, "")
    assert detect(slow).kind == "software"
    monkeypatch.setenv(VARIABLE, "vulkan")
    with pytest.raises(InvalidParameter, match="PATINA_BACKEND is 'vulkan'; it can be auto, sh"):
        detect(CARD)
    with pytest.raises(InvalidParameter, match="backend is 'gpu'"):
        detect(CARD, "gpu")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("4.6.0 NVIDIA 535", (4, 6)),
        ("3.2", (3, 2)),
        ("4.1 Metal - 88", (4, 1)),
        ("", (0, 0)),
        ("?", (0, 0)),
    ],
)
def test_versions(text, expected):
    assert version_of(text) == expected
