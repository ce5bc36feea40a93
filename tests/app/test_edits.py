"""Painting in the window: the real engine on a small mesh, asked as tools and panels ask it."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("PyQt6.QtWidgets")


from app.document import Document, Mode  # noqa: E402
from app.operations import Operations  # noqa: E402
from app.tool_options import StrokeSpec, ToolOptions  # noqa: E402
from btfcore.btf.stack import ArrayStack  # noqa: E402
from btfcore.errors import InvalidParameter  # noqa: E402
from btfcore.files.package.write import write_package  # noqa: E402
from btfcore.paint.foreground import Painter  # noqa: E402
from btfcore.painting import open_project  # noqa: E402
from btfcore.render.modes import seam_colours  # noqa: E402
from btfcore.render.surfels import surfels  # noqa: E402
from btfcore.render.texture import atlas_texture, vertex_colours  # noqa: E402
from tests.btf.bricks import factors, images, sample  # noqa: E402
from tests.paint.scenes import MESHES, cracked, spotted, stroke  # noqa: E402

LONG = 120_000
RATE = 96


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Two pictures, each with the mask of its feature."""
    folder = tmp_path_factory.mktemp("inputs")
    for each in (cracked(), spotted()):
        image = (each.colour * 255 + 0.5).astype(np.uint8)
        Image.fromarray(image).save(folder / f"{each.name}.png")
    return folder


@pytest.fixture
def operations(qtbot, inputs):
    """A document with a small cow covered by cracked plaster, whole so far."""
    document = Document()
    made = Operations(document)
    made.told = []
    made.failed.connect(lambda text: made.told.append(text))
    document.set_knobs(rate=RATE, work_patch=16)
    for each in (cracked(), spotted()):
        document.set_mask(inputs / f"{each.name}.png", each.mask)
    made.open_mesh(MESHES / "spot.obj")
    idle(qtbot, made)
    made.offer([inputs / "cracked.png"], choose=True)
    made.synthesize()
    idle(qtbot, made)
    assert not made.told
    document.set_options(radius=5 * document.painting.document.engine.step)
    yield made
    made.close()


def idle(qtbot, operations):
    """Wait until nothing runs or waits."""
    runners = (operations.work, operations.drawing, operations.reading, operations.edits.tasks)
    qtbot.waitUntil(
        lambda: not any(each.busy for each in runners) and not operations.edits.busy, timeout=LONG
    )


def way(document, begin=2000, count=24):
    """Positions and normals of a walk over the surface."""
    walk = stroke(document.painting.document, at=begin, length=count)
    return walk.points, walk.normals


def hit(places, normals):
    return SimpleNamespace(position=places[0], normal=normals[0])


def draw(operations, begin=2000, spec=None, finish=True):
    """One stroke, point by point."""
    places, normals = way(operations.document, begin)
    assert operations.edits.begin_stroke(spec, hit(places, normals))
    for place, normal in zip(places[1:], normals[1:], strict=True):
        operations.edits.extend_stroke(place, normal)
    if finish:
        operations.edits.finish_stroke()


def quilt(operations):
    return operations.document.decoration.quilt


def bits(operations):
    """Everything of the quilt that is shown, as bytes."""
    engine = operations.document.painting.document.engine
    state = engine.state
    return b"".join(
        each.tobytes() for each in (state.source, state.angle, state.sample, state.patch)
    )


def check_pictures(operations):
    """The picture that is shown is that of the quilt, wherever it came from."""
    document = operations.document
    done = document.decoration
    assert np.array_equal(document.painting.document.quilt().source, done.quilt.source)
    colours = vertex_colours(done.quilt, done.samples)
    dense = done.canvas.prepared.dense
    wanted = atlas_texture(dense, colours, source=done.canvas.gutter)
    assert np.array_equal(document.textures[Mode.COLOUR], wanted)
    if Mode.SEAMS in document.textures:
        seams = atlas_texture(
            dense, seam_colours(dense, done.quilt, colours), source=done.canvas.gutter
        )
        assert np.array_equal(document.textures[Mode.SEAMS], seams)


def feature(operations, layer):
    """How many vertices of a layer show the feature."""
    engine = operations.document.painting.document.engine
    at = layer.vertices
    state = engine.state
    return int((engine.palette.feature_at(state.sample[at], state.source[at]) > 0.5).sum())


def test_a_synthesis_makes_a_painting_without_the_feature(operations):
    document = operations.document
    assert document.painting.names == ("background",) and document.layers == ()
    assert document.history == ("synthesise cracked",) and document.history_at == 1
    engine = document.painting.document.engine
    shown = engine.palette.feature_at(engine.state.sample, engine.state.source)
    assert (shown > 0.5).mean() < 0.002, "only the background is synthesised"
    check_pictures(operations)


def test_a_stroke_paints_the_feature_and_undo_gives_every_bit_back(qtbot, operations):
    document, before = operations.document, bits(operations)
    edited, pending = [], []
    document.surface_edited.connect(lambda vertices: edited.append(vertices))
    document.stroke_changed.connect(lambda: pending.append(document.pending))
    draw(operations)
    assert document.layers[-1].busy and document.layers[-1].uid < 0
    idle(qtbot, operations)
    (layer,) = document.layers
    assert layer.kind == "paint" and layer.sample == "background" and not layer.busy
    assert feature(operations, layer) > 0.5 * layer.figures["area"]
    assert edited and set(layer.vertices) <= set(np.concatenate(edited).tolist())
    assert pending[-1] is None and any(each is not None and each.max() == 1 for each in pending)
    check_pictures(operations)
    painted = bits(operations)
    operations.edits.undo()
    idle(qtbot, operations)
    assert bits(operations) == before and document.layers == () and document.history_at == 1
    check_pictures(operations)
    operations.edits.redo()
    idle(qtbot, operations)
    assert bits(operations) == painted and len(document.layers) == 1
    assert not operations.told


def test_three_quick_strokes_are_painted_in_order_as_if_one_waited(qtbot, operations):
    for begin in (2000, 900, 3000):
        draw(operations, begin)
    assert [layer.busy for layer in operations.document.layers] == [True] * 3
    idle(qtbot, operations)
    assert [layer.uid for layer in operations.document.layers] == [0, 1, 2]
    together = bits(operations)
    operations.edits.undo_to(1)
    idle(qtbot, operations)
    assert operations.document.layers == ()
    for begin in (2000, 900, 3000):
        draw(operations, begin)
        idle(qtbot, operations)
    first = operations.document.painting.document.engine
    assert len(operations.document.layers) == 3
    # uids went on, so that patches have other numbers; all else is the same bits
    again = first.state
    assert together.startswith(again.source.tobytes() + again.angle.tobytes())
    check_pictures(operations)


def test_what_is_drawn_live_is_what_the_stroke_gives_at_once(qtbot, operations):
    places, normals = way(operations.document)
    draw(operations)
    idle(qtbot, operations)
    edit = operations.document.layers[0].edit
    (stroke,) = edit.area.strokes
    assert np.array_equal(stroke.points, places) and np.array_equal(stroke.normals, normals)
    assert stroke.radius == operations.document.radius
    painting = operations.document.painting
    assert len(painting.document.replay()) == 0


def test_a_stamp_brings_its_sample_and_is_previewed(qtbot, operations, inputs):
    document = operations.document
    places, normals = way(document, 400)
    document.set_options(sample=inputs / "spotted.png", scale=0.8, turn=30.0)
    before = bits(operations)
    operations.edits.preview_stamp(places[0], normals[0])
    operations.edits.preview_stamp(places[1], normals[1])
    qtbot.waitUntil(lambda: bool(document.preview), timeout=LONG)
    idle(qtbot, operations)
    assert document.overlay is not None and document.texture is document.overlay
    assert not np.array_equal(document.overlay, document.textures[Mode.COLOUR])
    assert bits(operations) == before and document.history_at == 1
    shown = document.preview[0]
    operations.edits.stamp(places[1], normals[1])
    idle(qtbot, operations)
    assert document.preview == () and document.overlay is None
    (layer,) = document.layers
    assert layer.kind == "stamp" and layer.sample == "spotted" and layer.edit.scale == 0.8
    assert document.sample_names == ("background", "spotted")
    core = shown.vertices[shown.alpha > 0.9]
    assert (quilt(operations).sample[core] == 1).mean() > 0.95, "it lies where it was shown"
    assert operations.edits.sample_at(hit(places[1:], normals[1:])) == "spotted"
    assert len(document.decoration.samples) == len(document.decoration.materials) == 2
    operations.edits.stamp(places[5], normals[5])
    idle(qtbot, operations)
    assert document.sample_names == ("background", "spotted"), "it is not brought twice"
    check_pictures(operations)


@pytest.mark.parametrize("kind", ["erase", "repair", "requilt"])
def test_brushes_of_the_background(qtbot, operations, kind):
    draw(operations)
    idle(qtbot, operations)
    layer = operations.document.layers[0]
    there = feature(operations, layer)
    spec = StrokeSpec(kind, ToolOptions(radius=0.15, protect=False))
    draw(operations, spec=spec)
    idle(qtbot, operations)
    assert not operations.told
    assert operations.document.layers[1].kind == kind
    if kind == "erase":
        assert feature(operations, layer) < 0.1 * there
    check_pictures(operations)


def test_layers_are_hidden_moved_renamed_changed_copied_and_deleted(qtbot, operations):
    document, edits = operations.document, operations.edits
    bare = bits(operations)
    for begin in (2000, 900):
        draw(operations, begin)
    idle(qtbot, operations)
    both = bits(operations)
    edits.show_layer(0, False)
    edits.show_layer(1, False)
    idle(qtbot, operations)
    assert bits(operations)[: len(bare) // 2] == bare[: len(bare) // 2]
    assert [layer.visible for layer in document.layers] == [False, False]
    check_pictures(operations)
    edits.show_layer(0, True)
    edits.show_layer(1, True)
    idle(qtbot, operations)
    assert bits(operations) == both
    edits.rename_layer(1, "a crack")
    edits.move_layer(1, 0)
    idle(qtbot, operations)
    assert [layer.name for layer in document.layers] == ["a crack", "Paint 1"]
    edits.change_layer(0, weight=0.05)
    edits.duplicate_layer(1)
    idle(qtbot, operations)
    assert [layer.uid for layer in document.layers] == [1, 0, 2]
    assert document.layers[1].edit.weight == 0.05 and document.layers[2].name == "a crack copy"
    edits.remove_layer(1)
    idle(qtbot, operations)
    assert [layer.uid for layer in document.layers] == [0, 2]
    document.select(2)
    steps = document.history_at
    edits.undo_to(3)
    idle(qtbot, operations)
    assert bits(operations) == both and document.history_at == 3
    assert document.selected is None, "the selected layer is no more"
    edits.undo_to(steps)
    idle(qtbot, operations)
    assert [layer.uid for layer in document.layers] == [0, 2]
    edits.change_layer(77, weight=1.0)
    idle(qtbot, operations)
    assert "77" in operations.told[-1] and document.history_at == steps
    check_pictures(operations)


def test_another_background_is_a_step_like_any_other(qtbot, operations):
    document, edits = operations.document, operations.edits
    draw(operations)
    idle(qtbot, operations)
    first, painting = bits(operations), document.painting
    document.set_knobs(seed=5)
    operations.synthesize()
    idle(qtbot, operations)
    assert document.painting is not painting and document.layers == ()
    assert document.history == ("synthesise cracked", "add Paint 1", "synthesise cracked")
    draw(operations, 900)
    idle(qtbot, operations)
    second = bits(operations)
    edits.undo()
    edits.undo()
    idle(qtbot, operations)
    assert document.painting is painting and bits(operations) == first
    assert len(document.layers) == 1 and document.redo_label == "synthesise cracked"
    check_pictures(operations)
    edits.undo_to(0)
    idle(qtbot, operations)
    assert document.painting is None and document.decoration is None
    assert document.texture is None and not document.unsaved
    edits.undo_to(4)
    idle(qtbot, operations)
    assert bits(operations) == second and document.history_at == 4
    check_pictures(operations)
    edits.undo_to(2)
    draw(operations, 3000)
    idle(qtbot, operations)
    assert len(document.history) == 3, "a new step forgets the other background"


def test_a_project_is_saved_opened_and_gone_on_with(qtbot, operations, tmp_path):
    document = operations.document
    assert document.unsaved
    draw(operations)
    operations.save_project(tmp_path / "cow.patina")
    draw(operations, 900)
    idle(qtbot, operations)
    assert len(open_project(tmp_path / "cow.patina").document.layers) == 1
    assert document.unsaved and document.project_path == tmp_path / "cow.patina"
    operations.edits.undo()
    idle(qtbot, operations)
    assert not document.unsaved, "what is shown is what was saved"
    operations.edits.redo()
    operations.save_project()
    idle(qtbot, operations)
    assert not document.unsaved
    wanted, history = bits(operations), document.history
    operations.open_project(tmp_path / "cow.patina")
    idle(qtbot, operations)
    assert bits(operations) == wanted and not document.unsaved
    assert len(document.layers) == 2 and document.history == () != history
    check_pictures(operations)
    draw(operations, 3000)
    idle(qtbot, operations)
    assert len(document.layers) == 3 and document.unsaved
    operations.export(tmp_path / "cow.glb")
    idle(qtbot, operations)
    assert (tmp_path / "cow.glb").read_bytes()[:4] == b"glTF" and document.unsaved
    (tmp_path / "broken.patina").write_bytes((tmp_path / "cow.patina").read_bytes()[:5000])
    now = bits(operations)
    operations.open_project(tmp_path / "broken.patina")
    idle(qtbot, operations)
    assert "broken.patina" in operations.told[-1] and bits(operations) == now


def test_cancel_in_mid_stroke_leaves_the_painting_as_it_was(qtbot, operations):
    document, before = operations.document, bits(operations)
    draw(operations, finish=False)
    qtbot.waitUntil(lambda: document.pending is not None, timeout=LONG)
    draw(operations, 900)  # which ends the first one
    operations.cancel()
    idle(qtbot, operations)
    assert bits(operations) == before and document.layers == ()
    check_pictures(operations)
    draw(operations, finish=False)
    operations.edits.cancel_stroke()
    assert not operations.edits.drawing
    draw(operations, 900, finish=False)
    operations.edits.cancel_stroke()
    draw(operations, 3000)
    idle(qtbot, operations)
    assert len(document.layers) == 1, "only the strokes that were taken back are gone"
    check_pictures(operations)


@pytest.mark.parametrize("error", [RuntimeError("planted"), MemoryError()])
def test_an_error_in_a_job_is_told_and_changes_nothing(qtbot, operations, monkeypatch, error):
    before = bits(operations)

    def fail(*args, **kwargs):
        raise error

    with monkeypatch.context() as patched:
        patched.setattr(Painter, "polish", fail)
        draw(operations)
        idle(qtbot, operations)
    assert len(operations.told) == 1 and operations.document.layers == ()
    assert bits(operations) == before
    check_pictures(operations)
    draw(operations)
    idle(qtbot, operations)
    assert len(operations.document.layers) == 1


def test_strokes_beside_the_surface_are_refused_by_a_sentence(qtbot, operations):
    far = np.full((4, 3), 50.0)
    operations.edits.begin_stroke(None, SimpleNamespace(position=far[0], normal=far[0]))
    operations.edits.extend_stroke(far[1:] + 1, far[1:])
    operations.edits.extend_stroke(far[1:] * np.nan, far[1:])
    operations.edits.finish_stroke()
    idle(qtbot, operations)
    assert len(operations.told) == 1 and operations.document.layers == ()
    nowhere = SimpleNamespace(position=far[0] * np.nan, normal=far[0])
    assert not operations.edits.begin_stroke(None, nowhere)


def test_protected_vertices_are_not_asked_for(qtbot, operations):
    document = operations.document
    brush = ToolOptions(radius=0.12)
    draw(operations, spec=StrokeSpec("protect", brush))
    idle(qtbot, operations)
    mask = document.protected
    assert mask.any() and document.layers == () and document.history_at == 1
    draw(operations, spec=StrokeSpec("paint", ToolOptions(radius=0.2)))
    idle(qtbot, operations)
    (layer,) = document.layers
    assert not mask[layer.edit.area.vertices].any()
    draw(operations, spec=StrokeSpec("paint", ToolOptions(radius=0.05)))
    idle(qtbot, operations)
    assert "protected" in operations.told[-1] and len(document.layers) == 1
    draw(operations, spec=StrokeSpec("protect", ToolOptions(radius=0.3, erase_protection=True)))
    idle(qtbot, operations)
    assert document.protected is None


def test_edits_are_refused_before_a_synthesis_and_during_one(qtbot, inputs):
    document = Document()
    operations = Operations(document)
    told, noted = [], []
    operations.failed.connect(told.append)
    operations.noted.connect(noted.append)
    place = SimpleNamespace(position=np.zeros(3), normal=np.ones(3))
    assert not operations.edits.begin_stroke(None, place) and len(told) == 1
    assert not operations.edits.stamp((0, 0, 0)) and not operations.save_project()
    document.set_knobs(rate=RATE, work_patch=16)
    operations.open_mesh(MESHES / "spot.obj")
    idle(qtbot, operations)
    document.choose_sample(inputs / "cracked.png")
    operations.synthesize()
    idle(qtbot, operations)
    assert operations.synthesize()
    assert not operations.edits.begin_stroke(None, place) and noted
    assert not operations.edits.undo()
    operations.close()
    assert not operations.edits.tasks.busy


def test_close_while_painting_stops_the_thread(qtbot, operations):
    draw(operations)
    draw(operations, 900, finish=False)
    qtbot.waitUntil(lambda: operations.edits.tasks.busy, timeout=LONG)
    operations.close()
    assert operations.edits.tasks.wait(0) and not operations.edits.tasks.busy


def test_the_window_goes_on_while_the_worker_is_held(qtbot, operations, monkeypatch):
    """A stroke never waits: its points are taken while the one before is being computed."""
    go = threading.Event()
    add = Painter.fill

    def slow(self, *, progress):
        while not go.wait(0.01):
            progress(0.0, "held")
        return add(self, progress=progress)

    monkeypatch.setattr(Painter, "fill", slow)
    draw(operations)
    qtbot.waitUntil(lambda: operations.edits.tasks.busy, timeout=LONG)
    for begin in (900, 3000):
        draw(operations, begin)
    operations.edits.undo()
    assert [layer.busy for layer in operations.document.layers] == [True] * 3
    go.set()
    idle(qtbot, operations)
    assert len(operations.document.layers) == 2 and operations.document.redo_label


def test_options_are_checked_and_stay_where_they_are_wrong(operations):
    document = operations.document
    before = document.options
    for wrong in (
        {"radius": float("nan")}, {"hardness": 1.5}, {"scale": 0.0}, {"mirror": "xx"},
        {"orientation": "up"}, {"seed": -1}, {"transition": -1.0},
    ):  # fmt: skip
        with pytest.raises(InvalidParameter):
            document.set_options(**wrong)
    assert document.options is before
    with pytest.raises(InvalidParameter, match="dance"):
        document.set_tool("dance")
    with pytest.raises(InvalidParameter, match="dance"):
        StrokeSpec("dance")


@pytest.mark.parametrize("kind", ["paint", "erase"])
def test_a_stroke_that_jumps_is_one_edit_of_two_polylines(qtbot, operations, kind):
    document, edits = operations.document, operations.edits
    if kind == "erase":
        draw(operations)
        idle(qtbot, operations)
    one, two = way(document), way(document, 900)
    spec = StrokeSpec(kind, document.options)
    edits.begin_stroke(spec, hit(*one), 0.5)
    edits.extend_stroke(one[0][1:], one[1][1:], np.full(len(one[0]) - 1, 0.8))
    edits.lift_stroke()
    edits.extend_stroke(two[0], two[1], np.full(len(two[0]), 1.0))
    edits.finish_stroke()
    idle(qtbot, operations)
    assert not operations.told
    strokes = document.layers[-1].edit.area.strokes
    assert [len(each.points) for each in strokes] == [len(one[0]), len(two[0])]
    assert strokes[0].pressure[0] == 0.5 and (strokes[1].pressure == 1.0).all()
    assert len(document.painting.document.replay()) == 0
    check_pictures(operations)


def test_light_follows_what_is_painted_and_new_samples_are_lit(qtbot, operations, inputs):
    document = operations.document
    document.set_mode(Mode.LIT)
    idle(qtbot, operations)
    first = document.relighter
    assert first is not None and document.lit is first
    draw(operations)
    idle(qtbot, operations)
    done = document.decoration
    dense, field = done.canvas.prepared.dense, done.canvas.prepared.field
    assert document.relighter is first, "it is brought up to date, not made anew"
    anew = surfels(dense, field, done.quilt, first.place)
    for name in ("frame", "source", "sample"):
        assert np.array_equal(getattr(first.surfels, name), getattr(anew, name)), name
    document.set_options(sample=inputs / "spotted.png")
    place, normal = way(document, 900)
    operations.edits.preview_stamp(place[0], normal[0])
    qtbot.waitUntil(lambda: document.overlay is not None, timeout=LONG)
    assert document.lit is None, "a preview is shown in colours"
    operations.edits.stamp(place[0], normal[0])
    idle(qtbot, operations)
    idle(qtbot, operations)
    assert document.lit is not None and document.lit is not first
    assert len(document.lit.materials) == 2
    operations.edits.undo_to(0)
    idle(qtbot, operations)
    assert document.mode is Mode.COLOUR and document.lit is None


def test_a_btf_is_painted_and_a_picture_joins_it(qtbot, inputs, tmp_path):
    bricks = sample(
        factors=factors(height=96, width=96), stack=ArrayStack(images(5, 12, 96, 96), sound=True)
    )
    package = write_package(tmp_path / "bricks.btfz", bricks)
    document = Document()
    operations = Operations(document)
    told, noted = [], []
    operations.failed.connect(told.append)
    operations.noted.connect(noted.append)
    document.set_knobs(rate=RATE, work_patch=16)
    document.set_mask(package, cracked().mask)
    document.set_mask(inputs / "spotted.png", spotted().mask)
    operations.open_mesh(MESHES / "spot.obj")
    idle(qtbot, operations)
    document.choose_sample(package)
    operations.synthesize()
    idle(qtbot, operations)
    draw(operations, spec=StrokeSpec("paint", ToolOptions(radius=0.13)))
    idle(qtbot, operations)
    assert not told and len(document.layers) == 1
    check_pictures(operations)
    place, normal = way(document, 900)
    operations.edits.stamp(place[0], normal[0], ToolOptions(sample=inputs / "spotted.png"))
    idle(qtbot, operations)
    assert not told and [layer.sample for layer in document.layers] == ["background", "spotted"]
    assert any("by their colours" in text for text in noted)
    assert [layer.figures["vertices"] > 0 for layer in document.layers] == [True, True]
    check_pictures(operations)
    operations.close()
