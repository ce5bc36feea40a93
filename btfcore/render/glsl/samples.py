"""Samples packed for a shader: weights of all in one list, tables of all in another.

A texel has ⌈K/4⌉ four-vectors of weights. A row of a table holds the mean's colour and then,
for every four weights, three four-vectors: what they add to red, green and blue. A sample of
factors has a row per pair of nodes; one of harmonics a row per function, and weights per view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from btfcore.btf.colour import LUMINANCE
from btfcore.btf.factor.encoding import knobs
from btfcore.btf.sample import Encoding
from btfcore.errors import InvalidParameter
from btfcore.render.glsl.directions import (
    DirectionSet,
    constants,
    direction_set,
    look_up_text,
)
from btfcore.render.glsl.harmonics import BASIS, HARMONIC, SKY
from btfcore.render.glsl.layout import LARGEST, List, in_fours, listed, shift_of
from btfcore.render.material import FactorMaterial, HarmonicMaterial, Material, bare_material
from btfcore.types import F4, Frozen

MOST_FACTORS = 128


@dataclass(frozen=True, eq=False)
class PackedSamples(Frozen):
    """All samples of a surface, and one more that bare texels take: number `bare`.

    weights, table, nodes: the lists that the shader reads; text: GLSL that declares their
    layout and defines `vec3 patinaSurface(int which, vec2 source, vec3 view, mat3 frame)`, the
    linear radiance of a texel under the lights (it needs the samplers and the lights' uniforms).
    shapes: (rows, columns, tiles) of every sample. order: highest of the harmonics, -1: none.
    """

    weights: List
    table: List
    nodes: List
    text: str
    shapes: tuple[tuple[int, int, bool], ...]
    bare: int
    order: int = -1


def unfit(materials: Sequence[Material], *, size: int, largest: int = LARGEST) -> str:
    """Why a shader cannot draw these samples on an atlas of `size`, or "" where it can."""
    if size > largest:
        return f"an atlas of {size} x {size} texels is larger than the card's {largest}"
    for each in materials:
        if not isinstance(each, FactorMaterial | HarmonicMaterial):
            return f"{each.name}: raw images are too many for a shader; render it from factors"
        if each.rank > MOST_FACTORS:
            return f"{each.name}: {each.rank} factors, a shader takes {MOST_FACTORS}"
    for what, texels in (
        ("weights", sum(_weight_texels(each) for each in materials)),
        ("tables", sum(_table_texels(each) for each in materials)),
    ):
        try:
            shift_of(texels + 8, largest)
        except InvalidParameter as error:
            return f"the samples' {what} do not fit on the card: {error}"
    return ""


def pack(materials: Sequence[Material], *, largest: int = LARGEST) -> PackedSamples:
    """Pack samples, by number, for a shader; raises `InvalidParameter` where they do not fit."""
    reason = unfit(materials, size=1, largest=largest)
    if reason:
        raise InvalidParameter(reason)
    every = [*materials, bare_material()]
    sets: list[DirectionSet] = []
    numbers = [_sets_of(each, sets) for each in every]
    weights = listed([_weights(each) for each in every], largest)
    table = listed([_table(each) for each in every], largest)
    nodes = listed([each.texels for each in sets], largest)
    text = "\n".join(
        [
            look_up_text(sets, nodes.shift),
            _constants(every, numbers, weights.shift, table.shift),
            _READ,
            *([BASIS, HARMONIC, SKY] if _order(every) >= 0 else []),
            _SURFACE,
        ]
    )
    shapes = tuple((*each.shape, each.tiles) for each in every)
    return PackedSamples(weights, table, nodes, text, shapes, len(every) - 1, _order(every))


# --- inside


def _order(materials: Sequence[Material]) -> int:
    """Highest order of the harmonics, -1 without."""
    orders = [each.order for each in materials if isinstance(each, HarmonicMaterial)]
    return max(orders, default=-1)


def _blocks(material: Material) -> int:
    assert isinstance(material, FactorMaterial | HarmonicMaterial)
    return -(-material.rank // 4)


def _weight_texels(material: Material) -> int:
    views = len(material.weights) if isinstance(material, HarmonicMaterial) else 1
    return views * material.shape[0] * material.shape[1] * _blocks(material)


def _table_texels(material: Material) -> int:
    if isinstance(material, HarmonicMaterial):
        rows = (material.order + 1) ** 2
    else:
        assert isinstance(material, FactorMaterial)
        rows = material.table.shape[0] * material.table.shape[1]
    return rows * (1 + 3 * _blocks(material))


def _weights(material: Material) -> F4:
    assert isinstance(material, FactorMaterial | HarmonicMaterial)
    count = material.weights.size // max(material.rank, 1)
    return in_fours(material.weights.reshape(count, material.rank)).reshape(-1, 4)


def _table(material: Material) -> F4:
    """Rows of a sample's table, one after the other: (n, 4) f4."""
    if isinstance(material, HarmonicMaterial):
        rows = np.moveaxis(material.components, 0, 2)  # (M, 3, K + 1)
    else:
        assert isinstance(material, FactorMaterial)
        rows = material.table.reshape(-1, 3, material.rank + 1)
    rank = rows.shape[2] - 1
    blocks = -(-rank // 4)
    out = np.zeros((len(rows), 1 + 3 * blocks, 4), np.float32)
    out[:, 0, :3] = rows[:, :, rank]
    if blocks:
        fours = in_fours(rows[:, :, :rank].reshape(-1, rank)).reshape(-1, 3, blocks, 4)
        out[:, 1:] = np.moveaxis(fours, 1, 2).reshape(len(rows), -1, 4)
    return out.reshape(-1, 4)


def _sets_of(material: Material, sets: list[DirectionSet]) -> tuple[int, int]:
    """Numbers of the sample's sets of views and lights, which are added to `sets`."""
    sets.append(direction_set(material.views))
    views = len(sets) - 1
    if isinstance(material, FactorMaterial):
        sets.append(direction_set(material.lights))
    return views, len(sets) - 1


def _constants(
    materials: Sequence[Material], sets: list[tuple[int, int]], weights: int, table: int
) -> str:
    """Declare what the shader must know of every sample."""
    weight_first = np.cumsum([0, *(_weight_texels(each) for each in materials)])
    table_first = np.cumsum([0, *(_table_texels(each) for each in materials)])
    whole: dict[str, list[str]] = {}
    broken: dict[str, list[str]] = {}

    def put(into: dict[str, list[str]], name: str, value: float) -> None:
        into.setdefault(name, []).append(f"{value:d}" if into is whole else f"{value:.9g}")

    for place, each in enumerate(materials):
        factors = isinstance(each, FactorMaterial)
        encoding = each.encoding if isinstance(each, FactorMaterial) else Encoding("linear")
        code, epsilon, knee = knobs(encoding)
        put(whole, "FIRST_WEIGHT", int(weight_first[place]))
        put(whole, "FIRST_ROW", int(table_first[place]))
        put(whole, "BLOCKS", _blocks(each))
        put(whole, "WIDTH", each.shape[1])
        put(whole, "HEIGHT", each.shape[0])
        put(whole, "TILES", int(each.tiles))
        put(whole, "VIEWS", sets[place][0])
        put(whole, "LIGHTS", sets[place][1])
        put(whole, "LIGHT_NODES", each.table.shape[1] if isinstance(each, FactorMaterial) else 0)
        put(whole, "CODE", code)
        put(whole, "COSINE", int(each.cosine) if isinstance(each, FactorMaterial) else 1)
        put(whole, "ORDER", -1 if factors else each.order)  # type: ignore[union-attr]
        spherical = factors or each.kind == "spherical"  # type: ignore[union-attr]
        put(whole, "SPHERICAL", int(spherical))
        put(broken, "EPSILON", float(epsilon))
        put(broken, "KNEE", float(knee))
        put(broken, "OUTERMOST", 1.0 if factors else each.horizon)  # type: ignore[union-attr]
    most = max(1, *(_blocks(each) for each in materials))
    red, green, blue = (float(each) for each in LUMINANCE)
    lines = [
        f"#define WEIGHT_SHIFT {weights}",
        f"#define WEIGHT_MASK {(1 << weights) - 1}",
        f"#define TABLE_SHIFT {table}",
        f"#define TABLE_MASK {(1 << table) - 1}",
        f"#define MOST_BLOCKS {most}",
        f"const vec3 LUMINANCE = vec3({red}, {green}, {blue});",
        *(constants("int", name, values) for name, values in whole.items()),
        *(constants("float", name, values) for name, values in broken.items()),
    ]
    order = _order(materials)
    if order >= 0:
        lines += ["#define HARMONICS", f"#define MOST_FUNCTIONS {(order + 1) ** 2}"]
    return "\n".join(lines)


_READ = """
// of the texel that is being shaded; loops over it have a constant bound, so that a card's
// compiler can keep it in registers
vec4 patinaWeight[MOST_BLOCKS];

vec4 patinaStored(int place) {
  return texelFetch(patinaWeights, ivec2(place & WEIGHT_MASK, place >> WEIGHT_SHIFT), 0);
}

vec4 patinaEntry(int place) {
  return texelFetch(patinaTable, ivec2(place & TABLE_MASK, place >> TABLE_SHIFT), 0);
}

// adds the weights of one map, bilinear in (column, row), times `share`
void patinaGather(int which, int map, vec2 source, float share) {
  int width = WIDTH[which], height = HEIGHT[which], blocks = BLOCKS[which];
  ivec2 low = min(ivec2(floor(source)), ivec2(width - 1, height - 1));
  vec2 part = source - vec2(low);
  ivec2 high = low + 1;
  if (TILES[which] == 1) {
    if (high.x == width) high.x = 0;
    if (high.y == height) high.y = 0;
  } else {
    high = min(high, ivec2(width - 1, height - 1));
  }
  int base = FIRST_WEIGHT[which] + map * width * height * blocks;
  ivec2 row = base + ivec2(low.y, high.y) * width * blocks;
  ivec2 column = ivec2(low.x, high.x) * blocks;
  for (int k = 0; k < MOST_BLOCKS; k++) {
    if (k >= blocks) break;
    ivec2 above = row.x + column + k, below = row.y + column + k;
    vec4 upper = mix(patinaStored(above.x), patinaStored(above.y), part.x);
    vec4 lower = mix(patinaStored(below.x), patinaStored(below.y), part.x);
    patinaWeight[k] += share * mix(upper, lower, part.y);
  }
}

// colour that the weights give under one row of the table
vec3 patinaRow(int which, int number) {
  int blocks = BLOCKS[which];
  int place = FIRST_ROW[which] + number * (1 + 3 * blocks);
  vec3 value = patinaEntry(place).rgb;
  for (int k = 0; k < MOST_BLOCKS; k++) {
    if (k >= blocks) break;
    vec4 weight = patinaWeight[k];
    value += vec3(dot(weight, patinaEntry(place + 1)), dot(weight, patinaEntry(place + 2)),
                  dot(weight, patinaEntry(place + 3)));
    place += 3;
  }
  return value;
}

vec3 patinaDecoded(int which, vec3 code) {
  float epsilon = EPSILON[which], knee = KNEE[which];
  vec3 value;
  if (CODE[which] == 1) {
    value = clamp(code, 0.0, 1.7e19);
    value *= value;
  } else if (CODE[which] == 2) {
    value = max(exp(clamp(code, -87.0, 88.3)) - epsilon, 0.0);
  } else if (CODE[which] == 3) {
    float luminance = exp(clamp(code.r, -87.0, 85.0));
    vec2 share = clamp(code.gb, 0.0, 16.0) * luminance;
    float green = (luminance - LUMINANCE.r * share.x - LUMINANCE.b * share.y) / LUMINANCE.g;
    value = max(vec3(share.x, green, share.y) - epsilon, 0.0);
  } else {
    value = clamp(code, 0.0, 3e38);
  }
  if (knee > 0.0) {
    vec3 bent = min(knee * exp(min(value / knee - 1.0, 88.3)), 3e38);
    value = mix(value, bent, greaterThan(value, vec3(knee)));
  }
  return value;
}

vec3 patinaUnit(vec3 d) {
  float size = max(max(abs(d.x), abs(d.y)), abs(d.z));
  return size > 0.0 ? normalize(d / size) : vec3(1.0, 0.0, 0.0);
}
"""

_SURFACE = """
// radiance under one light of intensity 1 from `light` in the texel's frame, light.z > 0
vec3 patinaLit(int which, ivec4 view, vec4 share, vec3 light) {
#ifdef HARMONICS
  if (ORDER[which] >= 0) return patinaHarmonic(which, light);
#endif
  patinaLookUp(LIGHTS[which], light);
  vec3 code = vec3(0.0);
  for (int a = 0; a < 4; a++) {
    if (share[a] == 0.0) continue;
    for (int b = 0; b < 4; b++) {
      float both = share[a] * patinaShare[b];
      if (both == 0.0) continue;
      code += both * patinaRow(which, view[a] * LIGHT_NODES[which] + patinaNode[b]);
    }
  }
  return patinaDecoded(which, code) * (COSINE[which] == 1 ? patinaFade : light.z);
}

vec3 patinaSurface(int which, vec2 source, vec3 away, mat3 frame) {
  vec3 local = away * frame;
  local.z = max(local.z, 0.0);
  patinaLookUp(VIEWS[which], patinaUnit(local));
  ivec4 view = patinaNode;
  vec4 share = patinaShare;
  for (int k = 0; k < MOST_BLOCKS; k++) patinaWeight[k] = vec4(0.0);
#ifdef HARMONICS
  if (ORDER[which] >= 0) {
    for (int a = 0; a < 4; a++)
      if (share[a] != 0.0) patinaGather(which, view[a], source, share[a]);
    int functions = (ORDER[which] + 1) * (ORDER[which] + 1);
    for (int m = 0; m < functions; m++) patinaCoefficient[m] = patinaRow(which, m);
  } else
#endif
  patinaGather(which, 0, source, 1.0);
  vec3 sum = vec3(0.0);
  int count = patinaLightCount;
#ifdef SKY_POINTS
  if (ORDER[which] >= 0) {
    sum = patinaSkyLight(which, frame);
    count -= patinaSampled;
  }
#endif
  for (int k = 0; k < count; k++) {
    vec3 light = patinaUnit(patinaLightDirection(k) * frame);
    if (light.z <= 0.0) continue;
    sum += patinaLit(which, view, share, light) * patinaLightIntensity(k);
  }
  return sum;
}
"""
