"""Laws of the work image and of bilinear look-up."""

import numpy as np
from scipy.ndimage import map_coordinates

from btfcore.patch.connectivity import connect
from btfcore.patch.grow import grow
from btfcore.patch.resample import look_up, work_image
from tests.surfaces import constant_field, plane


def test_look_up_is_bilinear_and_clamped():
    random = np.random.default_rng(1)
    grid = random.random((9, 14, 4)).astype(np.float32)
    place = (random.random((500, 2)) * [16, 11] - 1).astype(np.float32)
    twin = np.stack(
        [
            map_coordinates(grid[..., k], [place[:, 1], place[:, 0]], order=1, mode="nearest")
            for k in range(4)
        ],
        axis=1,
    )
    assert np.abs(look_up(grid, place) - twin).max() < 1e-5


def test_work_image_reproduces_linear_functions_under_rotation():
    dense = plane(40, 40)
    net = connect(dense, constant_field(dense))
    local = np.full(1600, -1, np.int32)
    order, _ = grow(net.indptr, net.indices, 820, 10, local, 10**9)
    turn = np.exp(0.7j)
    offset = (dense.vertices[order] - dense.vertices[820])[:, :2]
    spun = (offset[:, 0] + 1j * offset[:, 1]) * turn
    point = np.stack([spun.real, -spun.imag], axis=1)
    values = np.stack([point[:, 0], 2 * point[:, 1] + 1], axis=1).astype(np.float32)
    known = dense.vertices[order, 0] < 23  # a straight border of the synthesised part
    image, mask = work_image(
        net.faces, net.face_ptr, net.face_of, order, local, point, values, known, 16
    )
    rows, columns = np.nonzero(mask)
    assert len(rows) > 150
    assert np.abs(image[0, rows, columns] - (columns - 16)).max() < 1e-4
    assert np.abs(image[1, rows, columns] - (2 * (rows - 16) + 1)).max() < 1e-4
    assert (image[:, mask == 0] == 0).all()
    # twin: a pixel is in the mask where its point, turned back, lies in the known part
    back = ((columns - 16) - 1j * (rows - 16)) / turn
    assert (back.real + dense.vertices[820, 0] <= 22 + 1e-6).all()
