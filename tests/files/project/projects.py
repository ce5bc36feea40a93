"""A small project made by formula, and its comparison with another, bit by bit."""

from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from btfcore.btf.factor.stack import FactorStack
from btfcore.btf.sample import BtfFactors, Encoding, from_picture
from btfcore.files.project.changes import expected
from btfcore.files.project.value import Material, Project, StoredEdit
from btfcore.paint.delta import Recorder
from btfcore.paint.edits import (
    Area,
    EraseEdit,
    PaintEdit,
    RepairEdit,
    RequiltEdit,
    StampEdit,
    Stroke,
    Symmetry,
)
from btfcore.patch.connectivity import Connectivity, connect
from btfcore.quilt.layout import Borders
from btfcore.quilt.parameters import QuiltParameters
from btfcore.quilt.state import QuiltState
from btfcore.regions import Plan
from btfcore.types import Atlas, Mesh, Prepared, Sample
from tests.boxes import box, quilt_on
from tests.btf.bricks import sample


def surface(regions=False):
    """A cube of 216 dense vertices, prepared; perhaps with two regions."""
    atlas, dense = box(side=6, gap=2)
    mesh = atlas.mesh
    if regions:
        half = (np.arange(len(mesh.faces)) >= 6).astype(np.int32)
        mesh = Mesh(mesh.vertices, mesh.faces, half, ("low", "hïgh"))
    face = np.where(dense.chart < 6, 2 * dense.chart, 0).astype(np.int32)
    dense = replace(dense, face=face)
    return Prepared(mesh, Atlas(mesh, atlas.uv, atlas.chart, atlas.size), dense,
                    quilt_on(dense)[1])  # fmt: skip


def materials(seed=0):
    """A factorised BTF, and a picture with a mask."""
    random = np.random.default_rng(seed)
    known = BtfFactors(  # no decomposition, whose bits would be this machine's
        (random.random((6, 8, 4)) - 0.5).astype(np.float32),
        (random.random((60, 3, 4)) - 0.5).astype(np.float32),
        random.random((60, 3)).astype(np.float32), np.array([9.0, 4.0, 2.0, 1.0]),
        Encoding("sqrt"), error=0.125,
    )  # fmt: skip
    whole = sample(
        stack=FactorStack(known), factors=known, licence="CC0", citation="none", texel_size=0.5
    )
    weights = whole.factors.weights
    stone = Sample("stone", random.random((6, 8, 3), np.float32), weights * np.float32(0.1), True)
    colour = random.random((7, 5, 3), np.float32)
    mask = (random.random((7, 5)) > 0.6).astype(np.float32)
    crack = Sample("crack", colour, colour, mask=mask)
    return (
        Material("background", stone, 1.0, whole, "stone.btfz"),
        Material("crack", crack, 0.5, from_picture("crack", colour, mask=mask), "a/crack.jpg"),
    )


def edits():
    """One edit of every kind, with every knob off its default."""
    stroke = Stroke(
        np.array([[0.1, 0.2, 0.5], [1 / 3, -0.25, 0.5]]), 0.1, np.array([[0.0, 0, 1]] * 2),
        np.array([1.0, 0.1]), 0.25,
    )  # fmt: skip
    dab = Stroke(np.array([[1e-17, -0.0, 5e300]]), np.pi)
    mirrored = Symmetry("xz", 3, "z", (0.1, 0.2, 0.3))
    return (
        PaintEdit(
            area=Area((stroke, dab)), sample=1, weight=0.3, transition=0.01, orientation="search",
            protect=False, work_patch=9, name="Kratzer ⛏", seed=2**32 - 1, symmetry=mirrored,
        ),
        StampEdit(
            point=(0.1, 0.2, 0.5), sample=1, normal=(0.0, 0.0, 1.0), rotation=-30.5, scale=2.0,
            feature=None, weight=2.5, protect=False,
        ),
        EraseEdit(area=Area(region="hïgh", faces=np.array([3, 1, 4], np.int32))),
        RepairEdit(
            area=Area(vertices=np.array([5, 2], np.int32), rate=16), protect=False, visible=False
        ),
        RequiltEdit(area=Area(everywhere=True), tries=3, symmetry=Symmetry(origin=(0.0, 1.0, 2.0))),
    )  # fmt: skip


def background(net, count, samples, patches=7, seed=3):
    """A quilt of random patches with ghosts of its own at seams and at one other place."""
    random = np.random.default_rng(seed)
    state = QuiltState.bare(net)
    state.patch[:] = random.integers(-1, patches, count)
    state.source[:] = random.normal(size=(count, 2))
    state.angle[:] = random.normal(size=count)
    state.sample[:] = random.integers(0, samples, count)
    state.patches = patches
    ghost(net, state, np.arange(len(net.indices)), random)
    state.ghost[5] = [0.5, -0.0]
    return state


def ghost(net, state, slots, random):
    """Ghosts as a quilt has them: the other end's source within a patch."""
    plain = expected(net, state, slots)
    tail = np.searchsorted(net.indptr, slots, side="right") - 1
    head = net.indices[slots]
    seam = (state.patch[tail] != state.patch[head]) & (state.patch[tail] >= 0)
    plain[seam] = random.normal(size=(int(seam.sum()), 2))
    state.ghost[slots] = plain


def painted(net, state, count, samples, uids, visible, seed=4):
    """Deltas of random changes, as an engine records them; `state` is painted afterwards."""
    random = np.random.default_rng(seed)
    writer = np.full(count, -1, np.int32)
    out = []
    for token, (uid, shown) in enumerate(zip(uids, visible, strict=True), 1):
        recorder = Recorder(net, state, writer)
        chosen = random.choice(count, 40, replace=False).astype(np.int32)
        recorder.reads(random.choice(count, 90, replace=False).astype(np.int32))
        recorder.writes(chosen)
        state.source[chosen] = random.normal(size=(40, 2))
        state.angle[chosen], state.patch[chosen] = 0.5, (1 << 20) + uid * 65536
        state.sample[chosen] = random.integers(0, samples)
        slots = np.concatenate([np.arange(net.indptr[v], net.indptr[v + 1]) for v in chosen])
        ghost(net, state, slots, random)
        delta = recorder.finish(token)
        if not shown:
            delta.take_off(net, state, writer)
        out.append(delta)
    return out


def project(regions=False):
    """A project with every part; the second edit is hidden, the third one not computed."""
    prepared = surface(regions)
    parameters = QuiltParameters(seed=5, swing=(0.0, 30.0), border=2)
    plan = net = None
    if regions:
        borders = Borders(True, np.array([[0, 1]], np.int32), np.array([True]))
        plan = Plan(("low", "hïgh"), (Path("a.btfz"), Path("b.png")), (1.0, 0.5), (0, 1), borders)
        layout = plan.layout(prepared.mesh, prepared.dense, prepared.field, parameters.border)
        net = layout.net
    else:
        net = connect(prepared.dense, prepared.field)
    count = len(prepared.dense.vertices)
    state = background(net, count, 2)
    if regions:
        state.layout = layout
        state.sample[:] = layout.home
    kept = copy_of(state)
    # 3 is hidden and was painted before 4 was: the ground below it is still what it was; 9 is
    # hidden too, but was computed on top of an edit that is gone
    uids, shown = [3, 4, 8, 9], [True, False, False, False]
    deltas = painted(net, state, count, 2, uids[:2], shown[:2])
    _, lost = painted(net, copy_of(state), count, 2, [8, 9], [True, True], seed=9)
    lost = replace(lost, token=77)
    wanted = edits()
    stored = [
        StoredEdit(replace(wanted[0], uid=3), deltas[0], {"patches": 2, "notes": ("a", "b")}),
        StoredEdit(replace(wanted[1], uid=4, visible=False), deltas[1], {"seam": 0.1}),
        StoredEdit(replace(wanted[2], uid=5, visible=False)),
        StoredEdit(replace(wanted[3], uid=9), lost, {}),
        StoredEdit(replace(wanted[4], uid=10, visible=False)),
    ]
    return Project(
        prepared, parameters, materials(), kept, tuple(stored), 12, 80, 123, plan
    )  # fmt: skip


def copy_of(state):
    """A copy of a quilt under construction."""
    return QuiltState(
        state.source.copy(), state.patch.copy(), state.ghost.copy(), state.angle.copy(),
        state.patches, state.sample.copy(), state.layout,
    )  # fmt: skip


def differences(one, other, where=""):
    """Places at which two values differ in any bit or kind; empty where they are the same."""
    if isinstance(one, np.ndarray):
        same = (
            isinstance(other, np.ndarray)
            and one.dtype == other.dtype
            and one.shape == other.shape
            and one.tobytes() == other.tobytes()
        )
        return [] if same else [where]
    if type(one) is not type(other):
        return [f"{where}: {type(one)} and {type(other)}"]
    if is_dataclass(one):
        return [
            each
            for item in fields(one)
            if not isinstance(getattr(other, item.name), Connectivity)  # told by the rest
            for each in differences(
                getattr(one, item.name), getattr(other, item.name), f"{where}.{item.name}"
            )
        ]
    if isinstance(one, (tuple, list)):
        if len(one) != len(other):
            return [f"{where}: {len(one)} and {len(other)}"]
        return [
            each
            for at, (a, b) in enumerate(zip(one, other, strict=True))
            for each in differences(a, b, f"{where}[{at}]")
        ]
    if isinstance(one, dict):
        if one.keys() != other.keys():
            return [f"{where}: {sorted(one)} and {sorted(other)}"]
        return [each for key in one for each in differences(one[key], other[key], f"{where}.{key}")]
    if hasattr(one, "read") and hasattr(one, "shape"):  # a stack of images
        every = np.arange(one.shape[0])
        return differences(one.read(every), other.read(every), where)
    same = one == other or (one != one and other != other)
    return [] if same else [f"{where}: {one!r} and {other!r}"]
