"""What is left out of a picture cannot have been seen in it."""

from __future__ import annotations

import numpy as np
import pytest

from btfcore.errors import InvalidParameter
from btfcore.render.cull import CullTable, cull_table, seen_faces, seen_surfels
from btfcore.types import F8
from tests.render.decorated import Scene, scene

EYES = [
    np.array([0.3, 0.4, 2.5, 1.0]), np.array([-1.5, 0.1, -0.2, 1.0]), np.array([0.0, 1, 0.2, 0]),
]  # fmt: skip


@pytest.mark.parametrize("name", ["spot.obj", "open_box.obj"])
@pytest.mark.parametrize("eye", EYES)
def test_pictures_of_what_is_seen_do_not_change(name: str, eye: F8) -> None:
    here = scene(name)
    table = cull_table(here.prepared.atlas, here.gutter, here.place)
    seen = seen_surfels(table, eye)
    assert 0.2 < len(seen) / len(here.surfels) < 0.9
    assert (np.diff(seen) > 0).all()
    face, uv = points(here, 20)
    corner = table.vertices[table.faces[face, 0]]
    facing = ((eye[:3] - eye[3] * corner) * table.normal[face]).sum(axis=1) > 0
    colour = np.random.default_rng(1).random((len(here.surfels), 3))
    culled = np.full_like(colour, np.nan)
    culled[seen] = colour[seen]
    whole, part = (fetched(values[here.gutter], uv[facing]) for values in (colour, culled))
    assert np.array_equal(whole, part)


def test_faces_that_look_away_are_left_out_and_others_are_not() -> None:
    here = scene()
    table = cull_table(here.prepared.atlas, here.gutter, here.place)
    for eye in EYES:
        away = eye[:3] - eye[3] * table.vertices[table.faces].mean(axis=1)
        sine = (away * table.normal).sum(axis=1) / np.linalg.norm(away, axis=1)
        seen = seen_faces(table, eye)
        assert seen[sine > 0].all()
        assert not seen[sine < -1e-3].any()
        assert seen_faces(table, eye, two_sided=True).all()
    assert len(seen_surfels(table, EYES[0], two_sided=True)) == len(here.surfels)


def test_faces_beside_the_picture_are_left_out() -> None:
    here = scene()
    table = cull_table(here.prepared.atlas, here.gutter, here.place)
    # a camera at (0, 0, 2) that looks along -z and shows a fifth of the scene
    narrow = np.array([[8.0, 0, 0, 1.0], [0, 8, 0, 0], [0, 0, 1, 0], [0, 0, -1, 2.0]])
    eye = np.array([0.0, 0.0, 2.0, 1.0])
    homogeneous = np.concatenate([table.vertices, np.ones((len(table.vertices), 1))], axis=1)
    clip = homogeneous @ narrow.T
    inside = (np.abs(clip[:, :2]) <= clip[:, 3:]).all(axis=1)
    seen = seen_faces(table, eye, two_sided=True, projection=narrow)
    assert seen[inside[table.faces].any(axis=1)].all()
    right = (clip[:, 0] > clip[:, 3])[table.faces].all(axis=1)
    assert right.any()
    assert not seen[right].any()
    assert 0 < seen.mean() < 0.9


def test_every_surfel_belongs_to_a_face_of_the_table() -> None:
    here = scene()
    table = cull_table(here.prepared.atlas, here.gutter, here.place)
    assert table.count == len(here.surfels)
    assert len(np.unique(table.surfel)) == table.count
    for face in range(0, len(table.faces), 97):
        own = table.surfel[table.start[face] : table.start[face + 1]]
        assert len(np.unique(own)) == len(own)
        on_it = np.flatnonzero(here.prepared.dense.face == face)
        assert np.isin(on_it, own).all()


def test_faces_without_a_normal_always_count() -> None:
    flat = CullTable(
        np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32), np.zeros((1, 3)),
        np.array([0, 1]), np.array([0], np.int32), 1,
    )  # fmt: skip
    assert seen_surfels(flat, EYES[0]).tolist() == [0]


def test_a_gutter_of_another_atlas_is_refused() -> None:
    here = scene()
    with pytest.raises(InvalidParameter, match="gutter"):
        cull_table(here.prepared.atlas, here.gutter[:-1], here.place)


def points(here: Scene, each: int) -> tuple[np.ndarray, F8]:
    """Random points of every face, its corners and edges too: faces (n,), places in the atlas."""
    rng = np.random.default_rng(0)
    uv = here.prepared.atlas.uv
    share = rng.dirichlet([0.4, 0.4, 0.4], (len(uv), each))
    share[:, :3] = np.eye(3)
    place = np.einsum("fek,fkc->fec", share, uv)
    return np.repeat(np.arange(len(uv)), each), place.reshape(-1, 2)


def fetched(image: F8, place: F8) -> F8:
    """Bilinear values of an image at (column, row); a texel of share 0 is not read."""
    size = len(image)
    low = np.floor(place).astype(int)
    share = place - low
    out = np.zeros((len(place), 3))
    for down in (0, 1):
        for right in (0, 1):
            part = (share[:, 0] if right else 1 - share[:, 0]) * (
                share[:, 1] if down else 1 - share[:, 1]
            )
            row = np.clip(low[:, 1] + down, 0, size - 1)
            column = np.clip(low[:, 0] + right, 0, size - 1)
            out += part[:, None] * np.where(part[:, None] > 0, image[row, column], 0)
    return out
