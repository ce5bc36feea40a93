"""Every numba kernel of the dense mesh against a plain twin."""

from collections import Counter

import numpy as np
import pytest

from btfcore.dense.check import dense_counts, input_counts
from btfcore.dense.corners import assign
from btfcore.dense.cut import cut_into_disks, label_parts
from btfcore.dense.edge_table import count_edge, edge_count, new_table
from btfcore.dense.flips import flip
from btfcore.dense.grid import COLUMN, ROW, build_grid, joined
from btfcore.dense.grow import grow
from btfcore.dense.rasterise import rasterise
from btfcore.dense.salvage import manifold_part
from btfcore.dense.walk import outer_walks
from btfcore.dense.zipper import POINT, without_points, zip_rows
from btfcore.mesh.topology import twins
from tests.dense import shapes
from tests.dense.laws import topology


@pytest.fixture(scope="module")
def sampled():
    atlas = shapes.one_view(shapes.plane_with_holes(), 60)
    pieces = cut_into_disks(atlas)
    face, bary = rasterise(atlas.uv, pieces.piece, pieces.count, atlas.size)
    covered = face >= 0
    corner = atlas.mesh.vertices[atlas.mesh.faces[face[covered]]]
    points = (corner * bary[covered][..., None]).sum(1)
    return atlas, pieces, face, bary, build_grid(atlas.uv, pieces, face, points), points


def test_rasterise_finds_the_face_of_every_texel(sampled):
    atlas, pieces, face, bary, _, _ = sampled
    for row in range(atlas.size):
        for column in range(atlas.size):
            a, b, c = atlas.uv.transpose(1, 0, 2)
            edge, other, way = b - a, c - a, [column, row] - a
            area = edge[:, 0] * other[:, 1] - edge[:, 1] * other[:, 0]
            two = (way[:, 0] * other[:, 1] - way[:, 1] * other[:, 0]) / area
            three = (edge[:, 0] * way[:, 1] - edge[:, 1] * way[:, 0]) / area
            least = np.minimum(np.minimum(two, three), 1 - two - three)
            if least.max() < -1e-7:
                assert face[row, column] == -1
            elif least.max() > 1e-7:
                assert least[face[row, column]] > -1e-7
                found = bary[row, column] @ atlas.uv[face[row, column]]
                assert np.allclose(found, [column, row], atol=1e-6)


def test_cut_pieces_are_connected_disks(sampled):
    atlas, pieces, *_ = sampled
    assert pieces.count > 1
    for piece in range(pieces.count):
        faces = atlas.mesh.faces[pieces.piece == piece]
        parts, _ = topology(faces)
        assert len(parts) == 1
        assert parts[0][1] == 1 or parts[0][2] == 1  # a disk, perhaps touching itself
    assert np.array_equal(label_parts(pieces.inner)[0], pieces.piece)
    border = np.flatnonzero(pieces.ahead >= 0)
    assert np.array_equal(pieces.behind[pieces.ahead[border]], border)
    assert np.array_equal(border, np.flatnonzero(pieces.inner < 0))
    for half in border:
        stop = atlas.mesh.faces.reshape(-1)[half - 2 if half % 3 == 2 else half + 1]
        assert atlas.mesh.faces.reshape(-1)[pieces.ahead[half]] == stop


def test_grid_edges_are_those_no_border_crosses(sampled):
    atlas, pieces, face, _, grid, _ = sampled
    half = np.flatnonzero(pieces.inner < 0)
    start = atlas.uv.reshape(-1, 2)[half]
    stop = np.roll(atlas.uv, -1, axis=1).reshape(-1, 2)[half]
    owner = pieces.piece[half // 3]
    for v, (row, column) in enumerate(grid.texel.tolist()):
        for way in (0, 6):
            r, c = row + ROW[way], column + COLUMN[way]
            w = grid.number[r, c] if r < atlas.size and c < atlas.size else -1
            if w < 0 or grid.piece[w] != grid.piece[v]:
                assert not (grid.edges[v] >> way) & 1
                continue
            axis = 0 if way == 6 else 1  # the coordinate that stays
            line, low = (column, row) if way == 6 else (row, column)
            p, q = start[owner == grid.piece[v]], stop[owner == grid.piece[v]]
            through = (p[:, axis] - line) * (q[:, axis] - line) < 0
            p, q = p[through], q[through]
            t = (line - p[:, axis]) / (q[:, axis] - p[:, axis])
            at = p[:, 1 - axis] + t * (q[:, 1 - axis] - p[:, 1 - axis]) - low
            assert ((grid.edges[v] >> way) & 1) == (not ((at > 0) & (at < 1)).any())


def test_grid_triangles_are_the_blocks(sampled):
    _, _, _, _, grid, points = sampled
    wanted = Counter()
    number = grid.number

    def side(a, b):
        return a >= 0 and b >= 0 and joined(a, b, grid.texel, grid.edges)

    for row in range(len(number) - 1):
        for column in range(len(number) - 1):
            ring = [(row, column), (row + 1, column), (row + 1, column + 1), (row, column + 1)]
            a, c, d, b = (int(number[p]) for p in ring)
            sides = [side(a, c), side(c, d), side(d, b), side(b, a)]
            loop = [a, c, d, b]
            if all(sides):
                rising = ((points[b] - points[c]) ** 2).sum()
                falling = ((points[a] - points[d]) ** 2).sum()
                split = [(a, c, b), (b, c, d)] if rising <= falling else [(a, c, d), (a, d, b)]
            else:
                split = []
                for k in range(4):
                    three = loop[k + 1 :] + loop[:k]
                    odd = loop[k] < 0 or grid.piece[loop[k]] != grid.piece[three[0]]
                    if odd and sides[(k + 1) % 4] and sides[(k + 2) % 4]:
                        split = [tuple(three)]
            for t in split:
                low = t.index(min(t))
                wanted[t[low:] + t[:low]] += 1
    got = Counter()
    for t in grid.faces.tolist():
        low = t.index(min(t))
        got[tuple(t[low:] + t[:low])] += 1
    assert got == wanted


def test_walks_pass_every_free_side_once(sampled):
    _, pieces, _, _, grid, points = sampled
    walks = outer_walks(grid, pieces.count, points)
    sides = Counter()
    for a, b, c in grid.faces.tolist():
        sides.update([(a, b), (b, c), (c, a)])
    for walk in range(len(walks.start) - 1):
        line = walks.vertex[walks.start[walk] : walks.start[walk + 1]]
        assert len(set(grid.piece[line])) == 1
        if walk < pieces.count:
            assert grid.piece[line[0]] == walk
        if len(line) > 1:
            sides.update(zip(np.roll(line, -1).tolist(), line.tolist(), strict=True))
    # seen from both sides, each edge of the planar map has a triangle or a walk
    assert set(sides.values()) == {1}
    assert all((b, a) in sides for a, b in sides)
    assert np.array_equal(np.unique(walks.vertex), np.flatnonzero(grid.filled != 255))


def test_islands_are_bridged_into_one_walk():
    mask = np.zeros((12, 20), bool)
    mask[2:5, 2:6] = mask[7:9, 3:5] = mask[3, 9] = mask[4:6, 12:15] = mask[6, 10] = True
    grid, points = _flat_grid(mask)
    walks = outer_walks(grid, 1, points)
    line = walks.vertex
    assert len(walks.start) == 2
    assert set(line) == set(np.flatnonzero(grid.filled != 255))
    edges = {frozenset(e) for e in zip(line.tolist(), np.roll(line, -1).tolist(), strict=True)}
    bridges = [e for e in edges if not joined(*e, grid.texel, grid.edges)]
    assert len(bridges) == 4  # five islands make a tree
    assert sum(len(e) == 2 for e in edges) * 2 >= len(line)


def _flat_grid(mask):
    """Planar map of one piece that covers the texels of a mask."""
    from btfcore.dense.grid import TexelGrid, _blocks

    number = np.full(mask.shape, -1, np.int32)
    number[mask] = np.arange(mask.sum())
    square = np.full((max(mask.shape),) * 2, -1, np.int32)
    square[: mask.shape[0], : mask.shape[1]] = number
    texel = np.argwhere(mask).astype(np.int32)
    piece = np.zeros(len(texel), np.int32)
    points = np.concatenate([texel, np.zeros((len(texel), 1))], 1).astype(float)
    edges, filled, faces = _blocks(square, piece, np.zeros_like(square, np.uint8), points)
    return TexelGrid(square, texel, piece, edges, filled, faces), points


@pytest.mark.parametrize("seed", range(12))
def test_corners_go_to_the_cheapest_monotone_places(seed):
    rng = np.random.default_rng(seed)
    length, count = int(rng.integers(2, 9)), int(rng.integers(1, 5))
    walk = rng.integers(0, 9, (length, 2)).astype(np.int32)
    target = rng.uniform(0, 9, (count, 2))
    far = ((walk[None, :, ::-1] - target[:, None]) ** 2).sum(-1)

    def best(corner, low, high):
        if corner == count:
            return 0.0
        return min(
            far[corner, i % length] + best(corner + 1, i, high) for i in range(low, high + 1)
        )

    least = min(far[0, i] + best(1, i, i + length) for i in range(length))
    along = assign(target, walk)
    assert (np.diff(along) >= 0).all() and along[-1] - along[0] <= length
    assert far[np.arange(count), along % length].sum() == pytest.approx(least)


@pytest.mark.parametrize("seed", range(8))
def test_rows_are_zipped_at_the_least_length(seed):
    rng = np.random.default_rng(seed)
    m, n = rng.integers(0, 6, 2)
    points = rng.normal(size=(m + n + 2, 3))
    one, other = np.arange(m + 1, dtype=np.int32), np.arange(m + 1, m + n + 2, dtype=np.int32)
    length = np.linalg.norm(points[one][:, None] - points[other][None], axis=-1)
    cost = np.full((m + 1, n + 1), np.inf)
    for i in range(m + 1):
        for j in range(n + 1):
            before = min(cost[i - 1, j] if i else np.inf, cost[i, j - 1] if j else np.inf)
            cost[i, j] = length[i, j] + (before if i or j else 0)
    i = j = 0
    total = length[0, 0]
    for step in zip_rows(points, one, other):
        i, j = (i + 1, j) if step else (i, j + 1)
        total += length[i, j]
    assert (i, j) == (m, n)
    assert total == pytest.approx(cost[m, n])


def test_edge_table_counts_like_a_counter():
    rng = np.random.default_rng(0)
    keys, counts = new_table(500)
    twin = Counter()
    for a, b, change in rng.integers(0, 25, (2000, 3)).tolist():
        count_edge(keys, counts, a, b, change)
        twin[min(a, b), max(a, b)] += change
    for a in range(25):
        for b in range(25):
            assert edge_count(keys, counts, a, b) == twin[min(a, b), max(a, b)]


def test_flips_keep_partners_and_surface():
    shape = shapes.torus(9, 7)
    faces, twin = shape.faces.copy(), twins(shape.faces)
    rng = np.random.default_rng(1)
    for half in rng.integers(0, len(twin), 60):
        a, b = faces[half // 3, half % 3], faces[twin[half] // 3, twin[half] % 3]
        c = faces[half // 3, (half % 3 + 2) % 3]
        d = faces[twin[half] // 3, (twin[half] % 3 + 2) % 3]
        there = {frozenset(e) for t in faces.tolist() for e in zip(t, t[1:] + t[:1], strict=True)}
        if c == d or frozenset((int(c), int(d))) in there:
            continue
        assert frozenset((int(a), int(b))) in there
        flip(faces, twin, half)
        assert np.array_equal(twin, twins(faces))
    assert topology(faces) == topology(shape.faces)


def test_triangles_with_a_side_of_no_length_vanish():
    # two triangles on either side of a third whose side (2, 2) is a point
    faces = np.array([(0, 1, 2), (2, 2, 1), (1, 3, 2)], np.int32)
    twin = np.array([-1, 5, -1, POINT, 8, 1, -1, -1, 4], np.int32)
    left, partner = without_points(faces, twin, np.zeros(3, bool))
    assert left.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert partner.tolist() == [-1, 5, -1, -1, -1, 1]


@pytest.mark.parametrize("make", [shapes.plane_with_holes, shapes.genus_two, shapes.cylinder])
def test_counts_per_component(make):
    shape = shapes.joined(make(), shapes.tetrahedron())
    twin = twins(shape.faces)
    component, count = label_parts(twin)
    wanted, _ = topology(shape.faces)
    got = input_counts(shape.faces, twin, component, len(shape.vertices))
    assert sorted(zip(got.euler, got.loops, strict=True)) == sorted((e, n) for _, e, n in wanted)
    owner = np.zeros(len(shape.vertices), np.int32)
    owner[shape.faces] = component[:, None]
    everywhere = np.ones(len(owner), bool)
    same, wrong = dense_counts(shape.faces, everywhere, owner, count)
    assert not wrong.any()
    for name in ("faces", "euler", "loops"):
        assert np.array_equal(getattr(same, name), getattr(got, name))
    extra = np.concatenate([shape.faces, shape.faces[:1, ::-1]])
    assert dense_counts(extra, everywhere, owner, count)[1][shape.faces[0]].any()


def test_only_the_manifold_part_is_salvaged():
    shape = shapes.icosphere(2)
    rng = np.random.default_rng(2)
    noise = rng.integers(0, len(shape.vertices), (60, 3))
    faces = np.concatenate([shape.faces, noise]).astype(np.int32)
    kept = manifold_part(faces)
    assert np.array_equal(faces[kept], shape.faces)
    mixed = faces[rng.permutation(len(faces))]
    assert topology(mixed[manifold_part(mixed)])[1]
    assert len(manifold_part(faces[:0])) == 0


def test_grown_texels_show_the_nearest_point(sampled):
    atlas, pieces, face, bary, _, _ = sampled
    wanted = np.zeros(pieces.count, bool)
    wanted[0] = True
    more, weights = grow(atlas.uv, pieces.piece, wanted, face, bary)
    new = np.argwhere((more >= 0) & (face < 0))
    assert len(new) and np.array_equal(more[face >= 0], face[face >= 0])
    grid = np.linspace(0, 1, 60)
    s, t = np.meshgrid(grid, grid)
    inside = (s + t <= 1).ravel()
    s, t = s.ravel()[inside], t.ravel()[inside]
    mine = atlas.uv[pieces.piece == 0]
    a, b, c = (mine[None, :, k] for k in range(3))
    dense = a + s[:, None, None] * (b - a) + t[:, None, None] * (c - a)
    for row, column in new:
        assert pieces.piece[more[row, column]] == 0
        assert weights[row, column].min() >= 0 and weights[row, column].sum() == pytest.approx(1)
        shown = weights[row, column] @ atlas.uv[more[row, column]]
        near = np.linalg.norm(dense - [column, row], axis=-1).min()
        assert np.linalg.norm(shown - [column, row]) <= near + 1e-9
