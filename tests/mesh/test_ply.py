"""PLY in all its encodings, with polygons of mixed size and triangle strips."""

import struct

import numpy as np
import pytest

from btfcore.errors import InvalidMesh
from btfcore.mesh.ply import read_ply

VERTICES = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0)]
MIXED = [[0, 1, 2, 3], [3, 2, 4]]
EVEN = [[0, 1, 2], [0, 2, 3], [3, 2, 4]]


def ply(polygons, encoding, *, faces_name="face", extra=True):
    """A PLY file with a colour per vertex and texture coordinates per polygon."""
    header = [
        "ply",
        f"format {encoding} 1.0",
        "comment made by a test",
        f"element vertex {len(VERTICES)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(["property uchar red"] if extra else []),
        f"element {faces_name} {len(polygons)}",
        "property list uchar int vertex_indices",
        *(["property list uchar float texcoord"] if extra else []),
        "end_header",
    ]
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[encoding]
    body = b""
    for vertex in VERTICES:
        numbers = (*vertex, 7) if extra else vertex
        if order is None:
            body += " ".join(map(str, numbers)).encode() + b"\n"
        else:
            body += struct.pack(order + ("fffB" if extra else "fff"), *numbers)
    for polygon in polygons:
        uv = [0.25] * (2 * len(polygon)) if extra else []
        if order is None:
            rows = [len(polygon), *polygon] + ([len(uv), *uv] if extra else [])
            body += " ".join(map(str, rows)).encode() + b"\n"
        else:
            body += struct.pack(f"{order}B{len(polygon)}i", len(polygon), *polygon)
            body += struct.pack(f"{order}B{len(uv)}f", len(uv), *uv) if extra else b""
    return "\n".join(header).encode() + b"\n" + body


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("extra", [True, False])
@pytest.mark.parametrize("polygons", [MIXED, EVEN])
def test_encodings_agree(encoding, extra, polygons):
    vertices, faces = read_ply(ply(polygons, encoding, extra=extra))
    assert vertices.tolist() == [list(map(float, row)) for row in VERTICES]
    assert faces.tolist() == EVEN


def test_strips_restart_and_keep_their_winding():
    strips = [[0, 1, 3, 2, 4, -1, 4, 3, 2]]
    _, faces = read_ply(ply(strips, "binary_little_endian", faces_name="tristrips", extra=False))
    assert faces.tolist() == [[0, 1, 3], [2, 3, 1], [3, 2, 4], [4, 3, 2]]


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("polygons", [MIXED, EVEN])
def test_data_cut_off_anywhere_is_refused(encoding, polygons):
    whole = ply(polygons, encoding)
    start = whole.index(b"end_header") + len("end_header\n")
    for end in range(0, len(whole) - 5, 3):
        if encoding == "ascii" and end >= start and whole[end : end + 1] not in b" \n":
            continue  # a number cut short is another number
        with pytest.raises(InvalidMesh, match="PLY"):
            read_ply(whole[:end])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"element vertex 5", b"element vertex 4000000000", "4000000000 rows"),
        (b"element vertex 5", b"element vertex -5", "-5 rows"),
        (b"element vertex 5", b"element vertex many", "many"),
        (b"property float x", b"property quaternion x", "quaternion"),
        (b"property float x", b"property float w", "no x"),
        (b"format ascii", b"form ascii", "form ascii"),
        (b"\n4 0 1 2 3", b"\n-4 0 1 2 3", "-4 entries"),
        (b"\n4 0 1 2 3", b"\n4e15 0 1 2 3", "4e+15 entries"),
    ],
)
def test_nonsense_is_refused_with_its_words(old, new, words):
    with pytest.raises(InvalidMesh) as caught:
        read_ply(ply(MIXED, "ascii").replace(old, new))
    assert words in str(caught.value)


def test_random_damage_never_ends_in_another_exception():
    whole = np.frombuffer(ply(MIXED, "binary_little_endian"), np.uint8)
    rng = np.random.default_rng(0)
    for _ in range(400):
        damaged = whole.copy()
        damaged[rng.integers(0, len(whole), 3)] = rng.integers(0, 256, 3)
        try:
            read_ply(damaged.tobytes())
        except InvalidMesh:
            continue
