"""The bounced light against a plain gathering, and what must hold of spreading work."""

import threading

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from btfcore.btf.bake.bounce import add_light, gather
from btfcore.btf.bake.relief import relief
from btfcore.btf.bake.shade import LANES, ROWS
from btfcore.btf.bake.spread import cores, spread
from btfcore.errors import Cancelled
from tests.btf.bake import fields, reference

STEP = 1 / 64


def plainly(made, ways, tangents, received):
    """What `gather` gathers, texel by texel and by small steps."""
    rows, columns = made.height.shape
    out = np.zeros((received.shape[1], rows * columns, 3))
    top = made.level[1]
    for k in range(rows * columns):
        row, column = divmod(k, columns)
        z = float(made.height[row, column])
        normal = made.maps[row, column, :3].astype(float) * [1, -1, 1]  # rows go down
        for way in ways:
            for tangent in tangents:
                direction = np.array([*way, tangent]) / np.sqrt(1 + tangent**2)
                far = 60.0 if tangent <= 0 else min(60.0, (top - z) / tangent + 1)
                s = np.arange(1, max(2, int(far / STEP))) * STEP
                x, y = column + way[0] * s, row + way[1] * s
                above = z + tangent * s - reference.height_at(made.height, x, y)
                if above[0] <= 0 or (above > 0).all() or normal @ direction <= 0:
                    continue
                first = np.argmax(above <= 0)
                part = above[first - 1] / (above[first - 1] - above[first])
                hit = s[first - 1] + part * STEP
                there = (
                    int(np.round(row + way[1] * hit)) % rows,
                    int(np.round(column + way[0] * hit)) % columns,
                )
                share = normal @ direction * 4 / (len(ways) * len(tangents))
                albedo = made.maps[there][3:6]
                arrived = received[there[0] * columns + there[1]]
                out[:, k] += share * albedo * arrived[:, None]
    return out


@pytest.mark.parametrize("height", [fields.bumps(6, 7, 1.0), fields.blocks(16)[::2, ::2]])
def test_gathering_is_what_small_steps_gather(height):
    made = relief(fields.colourful(*height.shape, height=height, depth=3.0, normal=None))
    random = np.random.default_rng(0)
    received = random.random((height.size, 2), np.float32)
    angle = random.random(5) * 2 * np.pi
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tangents = np.array([-1.7, -0.6, -0.15, 0.2, 0.7, 1.9])
    out = np.full((2, height.size, 3), -1, np.float32)
    place = made.height, made.ceiling, made.level[1], made.maps
    gather(*place, ways, tangents, received, out, np.array([0, height.size - 2]))
    assert (out[:, -2:] == -1).all()
    wanted = plainly(made, ways, tangents, received)[:, :-2]
    assert wanted.max() > 0.1
    assert (
        np.isclose(out[:, :-2], wanted, atol=1e-5).mean() > 0.97
    )  # a hit may be rounded to another texel
    assert out[:, :-2].mean() == pytest.approx(wanted.mean(), rel=0.02)


def test_nothing_is_gathered_on_a_plain():
    made = relief(fields.plain(np.zeros((4, 4), np.float32)))
    out = np.full((1, 16, 3), -1, np.float32)
    ways, tangents = np.array([[1.0, 0], [0, -1.0]]), np.array([-0.5, 0.5])
    place = made.height, made.ceiling, made.level[1], made.maps
    gather(*place, ways, tangents, np.ones((16, 1), np.float32), out, np.array([0, 16]))
    assert (out == 0).all()


def test_bounced_light_is_read_bilinearly():
    random = np.random.default_rng(1)
    bounced = random.random((5, 6, 3), np.float32)
    x, y = random.random((2, 300)) * [[6], [5]]
    seen = random.random((2, ROWS, LANES), np.float32)
    image = np.ones((310, 3), np.float32)
    add_light(bounced, x, y, seen, image, 4)
    light = np.stack(
        [
            map_coordinates(part, [y, x], order=1, mode="grid-wrap")
            for part in bounced.T.swapaxes(1, 2)
        ],
        axis=1,
    )
    albedo = seen.transpose(1, 0, 2).reshape(ROWS, -1)[3:6, :300].T
    assert np.allclose(image[4:304], 1 + albedo * light, atol=1e-5)
    assert (image[:4] == 1).all() and (image[304:] == 1).all()


def test_work_is_done_once_and_reported():
    done, told = [], []
    spread(done.append, range(20), threads=3, progress=lambda part, label: told.append(part))
    assert sorted(done) == list(range(20))
    assert told == [k / 20 for k in range(1, 21)]
    assert cores() >= 1


def test_a_cancelled_piece_of_work_leaves_out_the_rest():
    begun, gate = [], threading.Event()

    def task(item):
        begun.append(item)
        if item > 0:
            gate.wait(5)

    def stop(fraction, label):
        gate.set()
        raise Cancelled

    with pytest.raises(Cancelled):
        spread(task, range(1000), threads=2, progress=stop)
    assert len(begun) < 1000

    def fail(item):
        raise ValueError(item)

    with pytest.raises(ValueError):
        spread(fail, [1, 2], threads=2)
