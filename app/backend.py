"""What evaluates a lit surface on this machine: the graphics card's shader, or the processor.

Drawing programs on the processor (llvmpipe and the like) run the shader 10 to 100 times slower
than the evaluation in atlas space does, so they are known by name and never get it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from btfcore.errors import InvalidParameter

VARIABLE = "PATINA_BACKEND"
KINDS = ("auto", "shader", "software")
LEAST_SIDE = 4096  # texels; what the smallest tables and atlases need
SAMPLERS = 8
LEAST_VERSION = (3, 2)  # of OpenGL, whose shading language is 1.50

# what drivers without a graphics card call themselves, in lower case
_SOFTWARE = (
    "llvmpipe",
    "softpipe",
    "swrast",
    "software rasterizer",
    "swiftshader",
    "openswr",
    "mesa offscreen",
    "microsoft basic render",
    "gdi generic",
    "apple software renderer",
    "lavapipe",
)
_SWR = re.compile(r"\bswr\b")  # Mesa's "SWR (LLVM 11.0, 256 bits)"


@dataclass(frozen=True)
class Machine:
    """What an OpenGL context says of itself.

    renderer: GL_RENDERER; version: GL_VERSION, as text; side: GL_MAX_TEXTURE_SIZE; samplers:
    GL_MAX_TEXTURE_IMAGE_UNITS. All zero or empty where there is no context.
    """

    renderer: str = ""
    version: str = ""
    side: int = 0
    samplers: int = 0


@dataclass(frozen=True)
class Backend:
    """`kind` is "shader" or "software"; `reason` is a sentence for the user."""

    kind: str
    reason: str

    @property
    def is_shader(self) -> bool:
        """Whether the fragment shader draws."""
        return self.kind == "shader"


def detect(machine: Machine, wanted: str | None = None) -> Backend:
    """Choose the backend of a machine.

    wanted : "shader" or "software" is taken as it is, unless the machine has no OpenGL that
    could run the shader; "auto" goes by the machine; None: the environment variable `VARIABLE`
    decides, "auto" where it is not set. Raises `InvalidParameter` for other words.
    """
    asked = wanted or os.environ.get(VARIABLE, "").strip().lower() or "auto"
    if asked not in KINDS:
        where = "backend" if wanted else VARIABLE
        raise InvalidParameter(f"{where} is {asked!r}; it can be {', '.join(KINDS)}")
    if asked == "software":
        return Backend("software", "The processor was asked for.")
    lacking = _lacking(machine)
    if lacking:
        return Backend("software", lacking)
    if asked == "shader":
        return Backend("shader", f"The shader was asked for; it runs on {machine.renderer}.")
    if is_software(machine.renderer):
        return Backend(
            "software", f"{machine.renderer} draws on the processor, where a shader is slower."
        )
    return Backend("shader", f"The shader runs on {machine.renderer}.")


def is_software(renderer: str) -> bool:
    """Whether a GL_RENDERER names a driver that draws on the processor."""
    name = renderer.lower()
    return any(each in name for each in _SOFTWARE) or _SWR.search(name) is not None


def version_of(text: str) -> tuple[int, int]:
    """Major and minor number of a GL_VERSION; (0, 0) for OpenGL ES and what is no version."""
    found = re.match(r"\s*([0-9]+)\.([0-9]+)", text)
    return (int(found[1]), int(found[2])) if found else (0, 0)


def _lacking(machine: Machine) -> str:
    """What the machine has too little of to run the shader, as a sentence, or ""."""
    if not machine.renderer:
        return "There is no OpenGL context, so the processor draws."
    if version_of(machine.version) < LEAST_VERSION:
        return (
            f"{machine.renderer} has OpenGL {machine.version or 'of an unknown version'}; the"
            f" shader needs {LEAST_VERSION[0]}.{LEAST_VERSION[1]}."
        )
    if machine.side < LEAST_SIDE:
        return (
            f"{machine.renderer} takes textures of {machine.side} texels a side; the shader needs"
            f" {LEAST_SIDE}."
        )
    if machine.samplers < SAMPLERS:
        return (
            f"{machine.renderer} reads {machine.samplers} textures at a time; the shader needs"
            f" {SAMPLERS}."
        )
    return ""
