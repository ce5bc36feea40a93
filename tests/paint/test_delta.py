"""What an edit changed and read: taken off and put on again, it leaves the same bits."""

import numpy as np
import pytest

from btfcore.paint.delta import Recorder, put, slots_of, values_of
from btfcore.patch.connectivity import connect
from btfcore.quilt.state import QuiltState
from tests.surfaces import constant_field, sphere

FIELDS = ("source", "angle", "sample", "patch", "ghost")


@pytest.fixture
def quilt():
    """A connectivity and a random quilt on it, whose last writers are numbers, too."""
    dense = sphere(2)
    net = connect(dense, constant_field(dense))
    random = np.random.default_rng(0)
    state = QuiltState.bare(net)
    scramble(state, net, np.arange(len(state.patch), dtype=np.int32), random)
    return net, state, random.integers(0, 9, len(state.patch)).astype(np.int32), random


def scramble(state, net, vertices, random):
    """Write random values at `vertices` and the half-edges that leave them."""
    count, slots = len(vertices), slots_of(net.indptr, vertices)
    state.source[vertices] = random.random((count, 2))
    state.angle[vertices] = random.random(count)
    state.sample[vertices] = random.integers(0, 4, count)
    state.patch[vertices] = random.integers(-1, 99, count)
    state.ghost[slots] = random.random((len(slots), 2))


def bits(state):
    return tuple(getattr(state, name).tobytes() for name in FIELDS)


def some(random, count, most):
    return random.permutation(count)[:most].astype(np.int32)


def test_slots_are_the_rows_one_after_another(quilt):
    net, state, _, random = quilt
    vertices = some(random, len(state.patch), 20)
    rows = [np.arange(net.indptr[v], net.indptr[v + 1]) for v in vertices]
    assert slots_of(net.indptr, vertices).tolist() == np.concatenate(rows).tolist()
    assert not len(slots_of(net.indptr, np.zeros(0, np.int32)))


def test_values_go_out_and_in(quilt):
    net, state, _, random = quilt
    vertices, before = some(random, len(state.patch), 30), bits(state)
    kept = values_of(net, state, vertices)
    scramble(state, net, vertices, random)
    assert bits(state) != before
    put(net, state, vertices, kept)
    assert bits(state) == before


def test_a_delta_is_taken_off_and_put_on_bit_for_bit(quilt):
    net, state, writer, random = quilt
    before, writers = bits(state), writer.copy()
    recorder = Recorder(net, state, writer)
    written = []
    for _ in range(4):  # several patches, which overlap
        vertices = some(random, len(state.patch), 40)
        looked = some(random, len(state.patch), 60)
        recorder.reads(looked)
        recorder.writes(vertices)
        scramble(state, net, vertices, random)
        written += [vertices, looked]
    everything = np.unique(np.concatenate(written))
    changed = np.unique(np.concatenate(written[::2]))
    assert recorder.written(changed).all() and recorder.looked.tolist() == everything.tolist()
    delta = recorder.finish(77)
    after = bits(state)
    assert delta.vertices.tolist() == changed.tolist()
    assert delta.reads.tolist() == everything.tolist()
    assert delta.read_writers.tolist() == writers[everything].tolist()
    assert (writer[changed] == 77).all()
    for _ in range(2):
        delta.take_off(net, state, writer)
        assert bits(state) == before and writer.tolist() == writers.tolist()
        assert delta.fits(writer)
        delta.put_on(net, state, writer)
        assert bits(state) == after and (writer[changed] == 77).all()
    assert not delta.fits(writer)
    arrays = sum(getattr(delta.after, name).nbytes for name in FIELDS)
    assert delta.nbytes >= 2 * arrays


def test_it_fits_where_what_it_read_was_written_by_the_same(quilt):
    net, state, writer, random = quilt
    recorder = Recorder(net, state, writer)
    recorder.reads(np.arange(10, 20, dtype=np.int32))
    recorder.writes(np.arange(12, 15, dtype=np.int32))
    scramble(state, net, np.arange(12, 15, dtype=np.int32), random)
    delta = recorder.finish(50)
    delta.take_off(net, state, writer)
    other = writer.copy()
    other[5] = 60
    assert delta.fits(other)
    other[19] = 60
    assert not delta.fits(other)


def test_vertices_that_are_as_they_were_are_left_out(quilt):
    net, state, writer, random = quilt
    recorder = Recorder(net, state, writer)
    vertices = np.arange(30, 50, dtype=np.int32)
    state.source[45, 0] = 0.0
    recorder.writes(vertices)
    state.angle[31] += 1
    state.ghost[net.indptr[40]] += 1
    state.source[45, 0] = -0.0  # not the bits of 0.0
    tokens = writer.copy()
    delta = recorder.finish(88)
    assert delta.vertices.tolist() == [31, 40, 45]
    assert delta.reads.tolist() == vertices.tolist()
    assert np.flatnonzero(writer != tokens).tolist() == [31, 40, 45]
    for name in FIELDS[:4]:
        assert len(getattr(delta.before, name)) == 3
    assert len(delta.before.ghost) == len(slots_of(net.indptr, delta.vertices))


def test_recording_can_be_taken_back(quilt):
    net, state, writer, random = quilt
    before, writers = bits(state), writer.tobytes()
    recorder = Recorder(net, state, writer)
    for _ in range(3):
        vertices = some(random, len(state.patch), 40)
        recorder.writes(vertices)
        scramble(state, net, vertices, random)
    recorder.undo()
    assert bits(state) == before and writer.tobytes() == writers


def test_an_edit_that_wrote_nothing_is_a_delta_too(quilt):
    net, state, writer, _ = quilt
    before = bits(state)
    recorder = Recorder(net, state, writer)
    recorder.reads(np.arange(5, dtype=np.int32))
    delta = recorder.finish(3)
    assert not len(delta.vertices) and delta.reads.tolist() == [0, 1, 2, 3, 4]
    delta.take_off(net, state, writer)
    delta.put_on(net, state, writer)
    assert bits(state) == before
