"""Interpolation between measured directions for a shader: what it reads, and the GLSL that does.

The same nodes and shares as `DirectionInterpolator.node_weights`, in single precision. A search
near a boundary may take the other side; the grid and the triangles are continuous there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from btfcore.btf.interpolation.barycentric import OUTSIDE
from btfcore.btf.interpolation.interpolator import DirectionInterpolator
from btfcore.types import F4, Frozen

GRID, BARYCENTRIC, NEAREST4, NEAREST = range(4)
_KINDS = {"grid": GRID, "barycentric": BARYCENTRIC, "nearest4": NEAREST4, "nearest": NEAREST}


@dataclass(frozen=True, eq=False)
class DirectionSet(Frozen):
    """Tables of one set of directions: texels (n, 4) f4, and the numbers that describe them.

    counts: (rings,), or (triangles, edges, side of the cell table), or (directions,), filled up
    to three. low, scale: of the cell table. held: cosine of the outermost direction's angle.
    """

    kind: int
    texels: F4
    counts: tuple[int, int, int]
    low: tuple[float, float]
    scale: float
    held: float


def direction_set(interpolator: DirectionInterpolator) -> DirectionSet:
    """Return the tables that a shader looks directions up in."""
    kind = _KINDS[interpolator.method]
    held = float(np.cos(interpolator._limit))
    if kind == GRID:
        return DirectionSet(kind, *_rings(interpolator), (0.0, 0.0), 1.0, held)
    if kind == BARYCENTRIC:
        net = interpolator._net
        assert net is not None
        counts = (len(net.triangles), len(net.edges), net.side)
        low = (float(net.low[0]), float(net.low[1]))
        return DirectionSet(kind, _triangles(interpolator), counts, low, net.scale, held)
    own = interpolator._own
    texels = np.column_stack([interpolator.directions[own], own]).astype(np.float32)
    slots = interpolator.nodes
    return DirectionSet(kind, texels, (len(own), slots, 0), (0.0, 0.0), 1.0, held)


def _rings(interpolator: DirectionInterpolator) -> tuple[F4, tuple[int, int, int]]:
    """Rings (theta, first, count), then the azimuths of all (phi, node)."""
    rings = interpolator._rings
    assert rings is not None
    count = len(rings.theta)
    texels = np.zeros((count + len(rings.phi), 4), np.float32)
    texels[:count, 0] = rings.theta
    texels[:count, 1] = rings.start[:-1] + count
    texels[:count, 2] = np.diff(rings.start)
    texels[count:, 0] = rings.phi
    texels[count:, 1] = rings.member
    return texels, (count, 0, 0)


def _triangles(interpolator: DirectionInterpolator) -> F4:
    """Triangles of three texels, edges of two, cells of one, then the triangles by cell."""
    net = interpolator._net
    assert net is not None
    triangles = np.zeros((len(net.triangles), 3, 4), np.float32)
    triangles[:, :, :2] = net.affine.reshape(-1, 3, 2)  # a corner and two pairs of slopes
    triangles[:, :, 2] = net.triangles
    edges = np.zeros((len(net.edges), 2, 4), np.float32)
    edges[:, 0] = net.segment[:, :4]
    edges[:, 1, 0] = net.segment[:, 4]
    edges[:, 1, 1:3] = net.edges
    cells = np.zeros((net.side**2, 4), np.float32)
    cells[:, 0], cells[:, 1] = net.first[:-1], np.diff(net.first)
    lists = np.zeros((len(net.candidates), 4), np.float32)
    lists[:, 0] = net.candidates
    return np.concatenate([triangles.reshape(-1, 4), edges.reshape(-1, 4), cells, lists])


_HEAD = """
ivec4 patinaNode;   // numbers of the nodes of the last look-up
vec4 patinaShare;   // and how much of each
float patinaFade;   // what a light loses there by lying beyond the directions

vec4 patinaDirections(int place) {
  return texelFetch(patinaNodes, ivec2(place & DIRECTIONS_MASK, place >> DIRECTIONS_SHIFT), 0);
}

float patinaSnapped(float share) {
  return share < 1e-6 ? 0.0 : share > 1.0 - 1e-6 ? 1.0 : share;
}
"""

_GRID = """
void patinaRing(vec4 ring, int base, float azimuth, float part, out ivec2 node, out vec2 share) {
  int first = base + int(ring.y), count = int(ring.z);
  if (count == 1) {
    node = ivec2(int(patinaDirections(first).y));
    share = vec2(part, 0.0);
    return;
  }
  vec4 one = patinaDirections(first);
  int here = clamp(int((azimuth - one.x) * float(count) / AROUND), 0, count - 1);
  while (here >= 0 && patinaDirections(first + here).x > azimuth) here--;
  while (here < count - 1 && patinaDirections(first + here + 1).x <= azimuth) here++;
  int before = here >= 0 ? here : count - 1;
  int after = here < count - 1 ? here + 1 : 0;
  vec4 low = patinaDirections(first + before), high = patinaDirections(first + after);
  float from = here >= 0 ? low.x : low.x - AROUND;
  float to = here < count - 1 ? high.x : one.x + AROUND;
  float along = patinaSnapped(clamp((azimuth - from) / (to - from), 0.0, 1.0));
  node = ivec2(int(low.y), int(high.y));
  share = part * vec2(1.0 - along, along);
}

void patinaGrid(int set, vec3 d) {
  int base = SET_FIRST[set], last = SET_COUNT[set] - 1;
  float across = length(d.xy);
  float polar = atan(across, d.z);
  float azimuth = across > 0.0 ? atan(d.y, d.x) : 0.0;
  if (azimuth < 0.0) azimuth += AROUND;
  int ring = 0;
  vec4 inner = patinaDirections(base), outer = inner;
  for (int k = 1; k <= last; k++) {
    vec4 next = patinaDirections(base + k);
    outer = next;
    if (next.x > polar) break;
    ring = k;
    inner = next;
  }
  float outward = ring < last ? patinaSnapped((polar - inner.x) / (outer.x - inner.x)) : 0.0;
  ivec2 innerNode, outerNode;
  vec2 innerShare, outerShare = vec2(0.0);
  patinaRing(inner, base, azimuth, 1.0 - outward, innerNode, innerShare);
  outerNode = innerNode;
  if (ring < last) patinaRing(outer, base, azimuth, outward, outerNode, outerShare);
  patinaNode = ivec4(innerNode, outerNode);
  patinaShare = vec4(innerShare, outerShare);
  patinaFade = d.z < SET_HELD[set] ? clamp(d.z / SET_HELD[set], 0.0, 1.0) : 1.0;
}
"""

_BARYCENTRIC = """
void patinaTriangle(int set, vec3 d) {
  int base = SET_FIRST[set], triangles = SET_COUNT[set];
  int edges = base + 3 * triangles, side = SET_SIDE[set];
  int cells = edges + 2 * SET_EDGES[set], lists = cells + side * side;
  vec2 point = d.xy / (1.0 + d.z);
  ivec2 cell = ivec2(floor((point - SET_LOW[set].xy) * SET_LOW[set].z));
  int best = -1;
  float most = -2e-6;
  vec2 found = vec2(0.0);
  if (cell.x >= 0 && cell.y >= 0 && cell.x < side && cell.y < side) {
    vec4 those = patinaDirections(cells + cell.y * side + cell.x);
    int first = lists + int(those.x), count = int(those.y);
    for (int k = 0; k < count; k++) {
      int one = base + 3 * int(patinaDirections(first + k).x);
      vec2 away = point - patinaDirections(one).xy;
      float a = dot(patinaDirections(one + 1).xy, away);
      float b = dot(patinaDirections(one + 2).xy, away);
      float least = min(min(a, b), 1.0 - a - b);
      if (least > most) { best = one; most = least; found = vec2(a, b); }
      if (least >= 0.0) break;
    }
  }
  patinaFade = 1.0;
  if (best >= 0) {
    vec3 share = vec3(patinaSnapped(found.x), patinaSnapped(found.y),
                      patinaSnapped(1.0 - found.x - found.y));
    patinaNode = ivec4(int(patinaDirections(best).z), int(patinaDirections(best + 1).z),
                       int(patinaDirections(best + 2).z), 0);
    patinaShare = vec4(share / (share.x + share.y + share.z), 0.0);
    return;
  }
  float nearest = 1e30, along = 0.0;
  int edge = 0;
  vec2 held = vec2(0.0);
  for (int k = 0; k < SET_EDGES[set]; k++) {
    vec4 segment = patinaDirections(edges + 2 * k);
    float over = patinaDirections(edges + 2 * k + 1).x;
    vec2 away = point - segment.xy;
    float place = clamp(dot(away, segment.zw) * over, 0.0, 1.0);
    vec2 apart = away - place * segment.zw;
    float squaredApart = dot(apart, apart);
    if (squaredApart < nearest) {
      nearest = squaredApart; along = place; edge = k;
      held = segment.xy + place * segment.zw;
    }
  }
  along = patinaSnapped(along);
  vec4 ends = patinaDirections(edges + 2 * edge + 1);
  patinaNode = ivec4(int(ends.y), int(ends.z), 0, 0);
  patinaShare = vec4(1.0 - along, along, 0.0, 0.0);
  float squared = dot(held, held);
  float height = (1.0 - squared) / (1.0 + squared);
  if (nearest > OUTSIDE_SQUARED) patinaFade = clamp(d.z / max(height, 1e-9), 0.0, 1.0);
}
"""

_NEAREST = """
float patinaSquaredAngle(float chord) {
  float angle = 2.0 * asin(min(1.0, sqrt(chord) / 2.0));
  return angle * angle;
}

void patinaNearest(int set, vec3 d) {
  int base = SET_FIRST[set], slots = SET_EDGES[set];
  vec4 chord = vec4(1e30);
  ivec4 node = ivec4(int(patinaDirections(base).w));
  for (int k = 0; k < SET_COUNT[set]; k++) {
    vec4 other = patinaDirections(base + k);
    vec3 away = d - other.xyz;
    float apart = dot(away, away);
    int number = int(other.w);
    if (apart < chord.x) {
      chord = vec4(apart, chord.xyz); node = ivec4(number, node.xyz);
    } else if (slots > 1 && apart < chord.y) {
      chord.yzw = vec3(apart, chord.yz); node.yzw = ivec3(number, node.yz);
    } else if (slots > 2 && apart < chord.z) {
      chord.zw = vec2(apart, chord.z); node.zw = ivec2(number, node.z);
    } else if (slots > 3 && apart < chord.w) {
      chord.w = apart; node.w = number;
    }
  }
  float least = patinaSquaredAngle(chord.x);
  vec4 share = vec4(1.0, 0.0, 0.0, 0.0);
  if (least >= 1e-13) {
    if (slots > 1) share.y = least / patinaSquaredAngle(chord.y);
    if (slots > 2) share.z = least / patinaSquaredAngle(chord.z);
    if (slots > 3) share.w = least / patinaSquaredAngle(chord.w);
  }
  patinaNode = node;
  patinaShare = share / (share.x + share.y + share.z + share.w);
  patinaFade = d.z < SET_HELD[set] ? clamp(d.z / SET_HELD[set], 0.0, 1.0) : 1.0;
}
"""

_CALLS = {GRID: "patinaGrid", BARYCENTRIC: "patinaTriangle", NEAREST: "patinaNearest"}
_TEXTS = {GRID: _GRID, BARYCENTRIC: _BARYCENTRIC, NEAREST: _NEAREST}


def look_up_text(sets: list[DirectionSet], shift: int) -> str:
    """GLSL of `patinaLookUp(set, direction)`: constants, and only the methods that are in use.

    It needs the sampler `patinaNodes` and leaves patinaNode, patinaShare and patinaFade.
    """
    first, start = [], 0
    for each in sets:
        first.append(start)
        start += len(each.texels)
    kinds = [NEAREST if each.kind == NEAREST4 else each.kind for each in sets]
    used = sorted(set(kinds))
    lows = [f"vec3({each.low[0]!r}, {each.low[1]!r}, {float(each.scale)!r})" for each in sets]
    text = [
        f"#define DIRECTIONS_SHIFT {shift}",
        f"#define DIRECTIONS_MASK {(1 << shift) - 1}",
        f"#define AROUND {2 * np.pi:.9f}",
        f"#define OUTSIDE_SQUARED {OUTSIDE**2!r}",
        constants("int", "SET_KIND", [str(kind) for kind in kinds]),
        constants("int", "SET_FIRST", [str(place) for place in first]),
        constants("int", "SET_COUNT", [str(each.counts[0]) for each in sets]),
        constants("int", "SET_EDGES", [str(each.counts[1]) for each in sets]),
        constants("int", "SET_SIDE", [str(each.counts[2]) for each in sets]),
        constants("vec3", "SET_LOW", lows),
        constants("float", "SET_HELD", [f"{max(each.held, 1e-9):.9g}" for each in sets]),
        _HEAD,
        *(_TEXTS[kind] for kind in used),
        "void patinaLookUp(int set, vec3 d) {",
        *(
            f"  {'else ' if place else ''}if (SET_KIND[set] == {kind}) {_CALLS[kind]}(set, d);"
            for place, kind in enumerate(used)
        ),
        "}",
    ]
    return "\n".join(text)


def constants(kind: str, name: str, values: list[str]) -> str:
    """Declare a GLSL array of constants."""
    count = len(values)
    return f"const {kind} {name}[{count}] = {kind}[{count}]({', '.join(values)});"
