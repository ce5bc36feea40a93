"""A decorated surface packed for a shader, and the shader's main part.

Three maps of the atlas, the gutter filled: where in which sample a texel lies, and the frame's
s and n. A fragment takes the texel that it falls into, or blends the radiance of the four around
it: places in a sample are never blended.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from btfcore.errors import InvalidParameter
from btfcore.render.glsl.harmonics import order_of, sky_points
from btfcore.render.glsl.samples import PackedSamples
from btfcore.render.lights import Lights
from btfcore.render.surfels import BARE, Surfels
from btfcore.render.tonemap import CURVES, toned
from btfcore.types import F4, F8, I4, I8, Frozen

U1 = NDArray[np.uint8]

MOST_LIGHTS = 64  # two share a matrix, and 32 matrices are half of what the least card has
SAMPLERS = (
    "patinaQuilt",
    "patinaColumn",
    "patinaNormal",
    "patinaWeights",
    "patinaTable",
    "patinaNodes",
)
SHADOWS = ("patinaShadowLow", "patinaShadowHigh")  # of lights 0 to 3 and 4 to 7
MOST_SHADOWED = 8


@dataclass(frozen=True, eq=False)
class PackedMaps(Frozen):
    """Maps (size, size, 4) f4 of an atlas, row 0 on top.

    quilt: column and row in the sample, its number; column, normal: s and n of the frame.
    """

    quilt: F4
    column: F4
    normal: F4


def pack_maps(surfels: Surfels, gutter: I4, samples: PackedSamples) -> PackedMaps:
    """Maps of an atlas whose texel shows surfel `gutter` (size, size), see `gutter_source`.

    Raises `InvalidParameter` where a surfel names a sample that is not there.
    """
    number = surfels.sample.astype(np.int64)
    number[surfels.sample == BARE] = samples.bare
    if len(number) and int(number.max()) > samples.bare:
        raise InvalidParameter(
            f"a surfel names sample {int(number.max())}, {samples.bare} are given"
        )
    place = np.empty((len(number), 4), np.float32)
    place[:, :2] = _inside(surfels.source.astype(np.float64), number, samples)
    place[:, 2] = number
    place[:, 3] = 1.0
    frames = np.zeros((2, len(number), 4), np.float32)
    frames[0, :, :3], frames[1, :, :3] = surfels.frame[:, 0], surfels.frame[:, 2]
    return PackedMaps(place[gutter], frames[0][gutter], frames[1][gutter])


def _inside(source: F8, number: I8, samples: PackedSamples) -> F8:
    """Positions brought into their sample: wrapped where it tiles, held at its border else.

    In double precision and once, where a shader would do it in single for every fragment.
    """
    rows, columns, tiles = (np.array(each) for each in zip(*samples.shapes, strict=True))
    size = np.stack([columns[number], rows[number]], axis=1).astype(np.float64)
    return np.where(tiles[number][:, None], source % size, np.clip(source, 0, size - 1))


def pack_shadows(visible: F4, gutter: I4) -> tuple[U1, U1]:
    """Maps (size, size, 4) u8 of how much of lights 0 to 3 and 4 to 7 arrives.

    visible (L, n) f4 in 0–1 of every surfel; L is at most `MOST_SHADOWED`, else it raises
    `InvalidParameter`. Lights past L are not shadowed.
    """
    if len(visible) > MOST_SHADOWED:
        raise InvalidParameter(
            f"cast shadows of {len(visible)} lights, where a shader takes {MOST_SHADOWED}"
        )
    values = np.full((visible.shape[1], MOST_SHADOWED), 255, np.uint8)
    values[:, : len(visible)] = np.rint(np.clip(visible, 0, 1) * 255).T
    low, high = np.ascontiguousarray(values[:, :4]), np.ascontiguousarray(values[:, 4:])
    return low[gutter], high[gutter]


def unfit_lights(lights: Lights) -> str:
    """Why a shader cannot draw under these lights, or "" where it can."""
    if len(lights) > MOST_LIGHTS:
        return f"{len(lights)} lights, where the shader takes {MOST_LIGHTS}"
    return ""


def sky_degree(samples: PackedSamples, lights: Lights) -> int:
    """Degree up to which an environment's harmonics are integrated, -1 where none are.

    Samples of harmonics take them in place of the lights that stand for the environment.
    """
    if lights.harmonics is None or samples.order < 0:
        return -1
    return order_of(lights.harmonics) + samples.order


def tone_values(exposure: float, curve: str, white: float) -> tuple[float, float, float, float]:
    """Return the uniform `patinaTone`: factor, number of the curve, white point, 0.

    exposure in stops, curve and white as in `btfcore.render.tonemap`; raises
    `InvalidParameter`.
    """
    toned(np.zeros(3), curve, white=white)  # it checks them
    if not np.isfinite(exposure):
        raise InvalidParameter(f"an exposure of {exposure} stops")
    factor = 2.0 ** float(np.clip(exposure, -120.0, 120.0))
    return factor, float(CURVES.index(curve)), float(white), 0.0


def light_values(lights: Lights) -> list[float]:
    """Return the uniform `patinaLight`: MOST_LIGHTS / 2 matrices of four columns, flat.

    Two columns a light, direction and intensity. Raises `InvalidParameter` for too many.
    """
    if len(lights) > MOST_LIGHTS:
        raise InvalidParameter(f"{len(lights)} lights, where a shader takes {MOST_LIGHTS}")
    values = np.zeros((MOST_LIGHTS, 2, 4))
    values[: len(lights), 0, :3] = lights.direction
    values[: len(lights), 1, :3] = np.minimum(lights.intensity, 3e38)
    return [float(each) for each in values.ravel()]


def program(
    samples: PackedSamples,
    size: int,
    *,
    shadows: bool = False,
    smooth: bool = False,
    sky: int = -1,
) -> str:
    """GLSL 1.50 functions that colour a fragment; `COLOUR` calls them.

    smooth : blend the radiance of the four texels around a fragment, else the nearest one's.
    sky : `sky_degree` of the lights; where it is not -1 the uniforms patinaSky (mat4[23]) and
    patinaSampled are needed too.
    It needs the samplers `SAMPLERS`, with `shadows` also `SHADOWS`, and the uniforms patinaLight
    (mat4[32]), patinaLightCount, patinaEye (homogeneous, in scene coordinates) and patinaTone.
    `COLOUR` reads the texture coordinates `uv` and the scene position `patinaPlace`.
    """
    head = [f"#define ATLAS_SIZE {size}"]
    head += [f"#define {name}" for name, on in (("SHADOWS", shadows), ("SMOOTH", smooth)) if on]
    head += [sky_points(sky)] if sky >= 0 else []
    return "\n".join([*head, _LIGHTS, samples.text, _FRAGMENT])


_LIGHTS = """
float patinaArriving[8];  // share of each light that reaches the texel

vec3 patinaLightDirection(int k) { return patinaLight[k / 2][2 * (k % 2)].xyz; }
vec3 patinaLightIntensity(int k) {
  vec3 intensity = patinaLight[k / 2][2 * (k % 2) + 1].xyz;
#ifdef SHADOWS
  if (k < 8) intensity *= patinaArriving[k];
#endif
  return intensity;
}
"""

_FRAGMENT = """
ivec2 patinaTexel(vec2 uv) {
  return clamp(ivec2(floor(uv * float(ATLAS_SIZE))), ivec2(0), ivec2(ATLAS_SIZE - 1));
}

vec3 patinaRadiance(ivec2 texel, vec3 place) {
  vec4 quilt = texelFetch(patinaQuilt, texel, 0);
  vec3 s = texelFetch(patinaColumn, texel, 0).xyz;
  vec3 n = texelFetch(patinaNormal, texel, 0).xyz;
  mat3 frame = mat3(s, cross(n, s), n);
#ifdef SHADOWS
  vec4 low = texelFetch(patinaShadowLow, texel, 0), high = texelFetch(patinaShadowHigh, texel, 0);
  for (int k = 0; k < 4; k++) { patinaArriving[k] = low[k]; patinaArriving[k + 4] = high[k]; }
#endif
  vec3 away = patinaEye.xyz - patinaEye.w * place;
  vec3 found = patinaSurface(int(quilt.z + 0.5), quilt.xy, away, frame);
  // a comparison with what is not a number is false
  return mix(vec3(0.0), min(found, 3e38), greaterThan(found, vec3(0.0)));
}

#ifdef SMOOTH
vec3 patinaSeen(vec2 uv, vec3 place) {
  vec2 where = uv * float(ATLAS_SIZE) - 0.5;
  ivec2 first = ivec2(floor(where));
  vec2 part = where - vec2(first);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 4; k++) {
    ivec2 next = ivec2(k & 1, k >> 1);
    ivec2 texel = clamp(first + next, ivec2(0), ivec2(ATLAS_SIZE - 1));
    vec2 share = mix(1.0 - part, part, vec2(next));
    sum += share.x * share.y * patinaRadiance(texel, place);
  }
  return sum;
}
#else
vec3 patinaSeen(vec2 uv, vec3 place) { return patinaRadiance(patinaTexel(uv), place); }
#endif

vec3 patinaShown(vec3 radiance) {
  vec3 x = min(radiance * patinaTone.x, 1e30);
  if (patinaTone.y == 1.0) {
    x = x / (1.0 + x) * (1.0 + (x / patinaTone.z) / patinaTone.z);
  } else if (patinaTone.y == 2.0) {
    vec3 inverted = 1.0 / max(x, 1e-15);
    vec3 fit = (2.51 + 0.03 * inverted) / (2.43 + (0.59 + 0.14 * inverted) * inverted);
    x = mix(vec3(0.0), fit, greaterThan(x, vec3(0.0)));
  }
  x = clamp(x, 0.0, 1.0);
  vec3 high = 1.055 * pow(max(x, 1e-9), vec3(1.0 / 2.4)) - 0.055;
  return mix(high, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}
"""

COLOUR = "patinaShown(patinaSeen(uv, patinaPlace))"
