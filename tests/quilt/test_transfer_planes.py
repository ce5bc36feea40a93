"""Carrying quilts over flat surfaces, where every value is known."""

import numpy as np
import pytest

from btfcore.patch.connectivity import connect
from btfcore.quilt.sheet import sheet_of
from btfcore.quilt.transfer import transfer
from btfcore.types import Quilt
from tests.quilt.test_transfer import inside
from tests.surfaces import blobs, constant_field, dense_mesh, grid_faces, plane


def rigid(dense, rate, turn, shift):
    """Positions of a plane's vertices under a turn and a shift, in texels."""
    x, y = rate * dense.vertices[:, 0], rate * dense.vertices[:, 1]
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * x + s * y + shift[0], s * x - c * y + shift[1]], axis=1)


def fine_plane(rows, columns, finer, over, seed=0):
    """A plane's surface sampled `finer` times as densely, irregularly, `over` beyond its rim."""
    rows, columns = rows * finer, columns * finer
    random = np.random.default_rng(seed)
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    at = np.stack([column, -row, 0 * row], axis=-1).reshape(-1, 3) / finer - [over, -over, 0]
    at[:, :2] += random.uniform(-0.3, 0.3, (len(at), 2)) / finer
    return dense_mesh(at, grid_faces(rows, columns))


@pytest.mark.parametrize("finer", [1, 3])
def test_rigid_pieces_go_on_exactly_inside_at_seams_and_beyond_the_rim(finer):
    old = plane(20, 24)
    field = constant_field(old)
    net, sample = connect(old, field), blobs(90, 100)
    sheet = sheet_of([sample], [1.0], match_channels=4)
    rate = 1 / old.step
    moves = [(0.3, (30.0, 12.0)), (-1.1, (60.0, 60.0)), (2.5, (50.0, 50.0))]
    patch = (old.vertices @ [1.0, 0.6, 0] > 4).astype(int)
    patch[old.vertices[:, 1] < -14 + 0.2 * old.vertices[:, 0]] = 2
    source = np.choose(patch[:, None], [rigid(old, rate, *move) for move in moves])
    angle = np.choose(patch, [move[0] for move in moves])
    quilt = Quilt(
        source.astype(np.float32), angle.astype(np.float32), np.zeros(len(patch), np.uint16),
        patch.astype(np.int32),
    )  # fmt: skip
    inside(quilt, [sample])
    new = fine_plane(20, 24, finer, 0.4)
    turned = constant_field(new, (0.6, 0.8, 0))
    for seams in (None, sheet):
        out = transfer(old, field, net, quilt, sheet, new, turned, seams=seams)
        expected = np.choose(out.patch[:, None], [rigid(new, rate, *move) for move in moves])
        assert np.abs(out.source - expected).max() < 2e-3
        angle = np.choose(out.patch, [move[0] for move in moves]) - np.arctan2(0.8, 0.6)
        assert np.abs(np.angle(np.exp(1j * (out.angle - angle)))).max() < 1e-3
        # the seams are where they were, give or take a step of the old mesh
        away = np.abs(old.vertices[None, :, :2] - new.vertices[:, None, :2]).max(axis=2) <= 1.0
        assert all(
            (patch[near] == label).any() for near, label in zip(away, out.patch, strict=True)
        )


def test_where_the_sample_ends_another_patch_takes_over():
    """A patch whose continuation leaves the sample does not reach as far as its seam did."""
    old = plane(12, 12)
    field = constant_field(old)
    net, sample = connect(old, field), blobs(40, 40)
    sheet = sheet_of([sample], [1.0], match_channels=4)
    rate = 1 / old.step
    patch = (old.vertices[:, 0] > 5.5).astype(np.int32)
    left = rigid(old, rate, 0.0, (39.0 - 5.0 * rate, 5.0))  # column 5 has the last texel
    source = np.where(patch[:, None] == 0, left, rigid(old, rate, 0.0, (4.0, 20.0)))
    zero = np.zeros(len(patch), np.float32)
    quilt = Quilt(source.astype(np.float32), zero, zero.astype(np.uint16), patch)
    new = fine_plane(11, 11, 4, 0.0)
    for seams in (None, sheet):
        out = transfer(old, field, net, quilt, sheet, new, constant_field(new), seams=seams)
        inside(out, [sample])
        assert (out.patch[new.vertices[:, 0] > 5.01] == 1).all()
        assert (out.patch[new.vertices[:, 0] < 4.99] == 0).all()


def test_the_sides_of_a_thin_wall_do_not_mix():
    def wall(rows, columns, finer, gap, lift=0.0):
        front = fine_plane(rows, columns, finer, 0.0)
        back = front.vertices - [0, 0, gap]
        points = np.concatenate([front.vertices - [0, 0, lift], back + [0, 0, lift]])
        faces = np.concatenate([front.faces, front.faces[:, ::-1] + len(back)])
        return dense_mesh(points, faces)

    # each side of the new wall is nearer to the other side of the old one
    old, new = wall(16, 20, 1, 0.05), wall(15, 19, 3, 0.05, lift=0.035)
    field, half = constant_field(old), len(old.vertices) // 2
    sheet = sheet_of([blobs(60, 60)], [1.0], match_channels=4)
    back = np.arange(2 * half) >= half
    at = old.vertices[:, :2] / old.step * [1, -1]
    # seen from behind a frame's t points the other way
    source = np.where(back[:, None], at * [1, -1] + [20, 40], at + [20, 20])
    zero = np.zeros(2 * half, np.float32)
    quilt = Quilt(source.astype(np.float32), zero, zero.astype(np.uint16), back.astype(np.int32))
    out = transfer(old, field, connect(old, field), quilt, sheet, new, constant_field(new))
    assert np.array_equal(out.patch, np.arange(len(new.vertices)) >= len(new.vertices) // 2)
