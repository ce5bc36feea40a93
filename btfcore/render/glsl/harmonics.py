"""GLSL of real spherical and hemispherical harmonics, and of radiance from them.

An environment's harmonics are integrated as the reference does: by a quadrature in scene
coordinates, its points constants and what they are lit with a uniform.
"""

from __future__ import annotations

import numpy as np

from btfcore.btf.harmonics.basis import LARGEST_ORDER, evaluate
from btfcore.errors import InvalidParameter
from btfcore.render.reference import quadrature
from btfcore.types import F8

MOST_POINTS = 4 * 23  # four share a matrix; 7 rings of 13 are what orders 6 and 6 need

# The recurrences of `btfcore.btf.harmonics.basis.evaluate`, with the coefficient of each function
# added as soon as it is known. What a texel's weights make of the coefficients is the same for
# every light.
BASIS = """
vec3 patinaCoefficient[MOST_FUNCTIONS];  // of the texel that is being shaded

vec3 patinaSeries(int which, vec3 d) {
  int order = ORDER[which];
  float z = clamp(d.z, 0.0, 1.0), height = d.z, stretch = 1.0, scale = sqrt(0.5 / AROUND);
  if (SPHERICAL[which] == 0) {
    height = 2.0 * z - 1.0;
    stretch = 2.0 * sqrt(z / (1.0 + z));
    scale = sqrt(1.0 / AROUND);
  }
  vec2 around = d.xy * stretch, turn = vec2(scale, 0.0);
  vec3 sum = vec3(0.0);
  for (int m = 0; m <= order; m++) {
    if (m > 0) {
      turn = vec2(turn.x * around.x - turn.y * around.y, turn.x * around.y + turn.y * around.x);
      turn *= sqrt((2.0 * float(m) + 1.0) / (2.0 * float(m)));
    }
    float before = 0.0, now = 1.0, mm = float(m * m);
    for (int l = m; l <= order; l++) {
      if (l > m) {
        float ll = float(l * l), lower = float((l - 1) * (l - 1));
        float a = sqrt((4.0 * ll - 1.0) / max(ll - mm, 1.0));
        float b = sqrt(max(lower - mm, 0.0) / max(4.0 * lower - 1.0, 1.0));
        float next = a * (height * now - b * before);
        before = now;
        now = next;
      }
      int middle = l * l + l;
      if (m == 0) {
        sum += turn.x * now * patinaCoefficient[middle];
      } else {
        sum += sqrt(2.0) * turn.x * now * patinaCoefficient[middle + m];
        sum += sqrt(2.0) * turn.y * now * patinaCoefficient[middle - m];
      }
    }
  }
  return sum;
}
"""

HARMONIC = """
vec3 patinaHarmonic(int which, vec3 light) {
  float horizon = OUTERMOST[which];
  float gain = min(light.z / horizon, 1.0);
  if (light.z < horizon) {
    float least = sqrt(1.0 - min(horizon, 1.0) * min(horizon, 1.0));
    light = vec3(light.xy * (least / max(length(light.xy), 1e-30)), horizon);
  }
  return max(patinaSeries(which, light), 0.0) * gain;
}
"""

SKY = """
#ifdef SKY_POINTS
vec3 patinaSkyLight(int which, mat3 frame) {
  vec3 sum = vec3(0.0);
  for (int q = 0; q < SKY_POINTS; q++) {
    vec3 local = patinaUnit(SKY_POINT[q] * frame);
    if (SPHERICAL[which] == 0 && local.z <= 0.0) continue;
    sum += patinaSky[q / 4][q % 4].xyz * patinaSeries(which, local);
  }
  return sum;
}
#endif
"""


def order_of(harmonics: F8) -> int:
    """Order of an environment's coefficients (M, 3); raises `InvalidParameter`."""
    order = int(np.sqrt(len(harmonics))) - 1
    if order > LARGEST_ORDER:
        raise InvalidParameter(f"an environment of order {order}, a shader takes {LARGEST_ORDER}")
    return order


def sky_points(degree: int) -> str:
    """Declare the points of the quadrature that is exact up to `degree`."""
    points, _ = quadrature(degree)
    texts = [f"vec3({x:.9f}, {y:.9f}, {z:.9f})" for x, y, z in points]
    count = len(points)
    return (
        f"#define SKY_POINTS {count}\n"
        f"const vec3 SKY_POINT[{count}] = vec3[{count}]({', '.join(texts)});"
    )


def sky_values(harmonics: F8, degree: int) -> list[float]:
    """Return the uniform `patinaSky`: MOST_POINTS / 4 matrices of four columns, flat.

    A column is what one point of `sky_points` is lit with: the environment's radiance there over
    π, times the point's share of the sphere.
    """
    points, share = quadrature(degree)
    light = np.einsum("qm,mc->qc", evaluate(points, order_of(harmonics)), harmonics)
    values = np.zeros((MOST_POINTS, 4))
    values[: len(points), :3] = light * share[:, None] / np.pi
    return [float(each) for each in values.ravel()]
