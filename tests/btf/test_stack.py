"""What stacks read is linear radiance, whatever they keep; materialising changes no image."""

from collections import namedtuple

import numpy as np
import pytest

from btfcore.btf.colour import linear_to_srgb, srgb_to_linear, xyz_to_linear
from btfcore.btf.materialize import Flaws, blocks, flaws, held_mb, materialize
from btfcore.btf.stack import ArrayStack, block_size
from btfcore.errors import Cancelled, InvalidBtf, OutputFailed
from tests.btf.bricks import images, sample


class Dear:
    """A stack that counts how often each of its images is asked for."""

    dear = True

    def __init__(self, stored):
        self.stored = stored
        self.asked = np.zeros(len(stored), int)

    @property
    def shape(self):
        return self.stored.shape[:3]

    def read(self, numbers):
        self.asked[numbers] += 1
        return self.stored[numbers].astype(np.float32)


def test_srgb_and_linear_are_inverse():
    codes = np.arange(256, dtype=np.uint8)
    assert np.array_equal(np.round(linear_to_srgb(srgb_to_linear(codes)) * 255), codes)
    deep = np.arange(0, 65536, 7, dtype=np.uint16)
    assert np.abs(linear_to_srgb(srgb_to_linear(deep)) * 65535 - deep).max() < 0.1
    assert srgb_to_linear(np.array([0.5]))[0] == pytest.approx(0.2140411, abs=1e-6)


def test_white_of_d65_is_white():
    white = xyz_to_linear(np.array([0.95047, 1.0, 1.08883]))
    assert white == pytest.approx([1, 1, 1], abs=1e-4)


def test_kinds_of_numbers_read_as_radiance():
    codes = np.array([[[[0, 128, 255]]]], np.uint8)
    assert ArrayStack(codes).read([0])[0, 0, 0] == pytest.approx([0, 0.2158605, 1], abs=1e-6)
    assert ArrayStack(codes, linear=True).read([0])[0, 0, 0, 1] == pytest.approx(128 / 255)
    half = images()[:3].astype(np.float16)
    scaled = ArrayStack(half, scale=np.array([1, 2, 4], np.float32)).read([2, 0])
    assert np.array_equal(scaled[0], half[2].astype(np.float32) * 4)


@pytest.mark.parametrize(
    "bad", [np.zeros((2, 3, 4)), np.zeros((1, 2, 2, 4)), np.zeros((0, 2, 2, 3))]
)
def test_arrays_of_other_shapes_are_refused(bad):
    with pytest.raises(InvalidBtf, match="shape"):
        ArrayStack(bad)


def test_arrays_of_other_numbers_are_refused():
    with pytest.raises(InvalidBtf, match="int32"):
        ArrayStack(np.zeros((1, 2, 2, 3), np.int32))


def test_values_that_are_no_radiance_are_mended_and_counted():
    stored = images()
    stored[3, 0, 0] = (np.nan, np.inf, -0.5)
    stack = ArrayStack(stored)
    assert np.array_equal(stack.read([3])[0, 0, 0], (0, 65504, 0))
    assert np.array_equal(stack.read([4])[0], stored[4])
    assert flaws(stack) == Flaws(1, 1, 1)


def test_blocks_cover_every_image_once():
    stack = ArrayStack(images())
    size = 6 * 8 * 12 / 2**20
    assert block_size(stack, budget_mb=7.5 * size) == 7
    for budget in (1e-9, 7 * size, 1.0):
        numbers = list(blocks(stack, block_mb=budget))
        assert np.array_equal(np.concatenate(numbers), np.arange(60))


@pytest.mark.parametrize(
    ("budget_mb", "exact"), [(1.0, True), (0.02, False), (1e-6, False)], ids=["f4", "f2", "file"]
)
def test_dear_images_are_read_once_and_kept(budget_mb, exact):
    stored = images()
    stored[5, 2, 2, 1] = 1e6  # beyond half floats
    stack = Dear(stored)
    kept = materialize(sample(stack=stack), memory_mb=budget_mb)
    assert (stack.asked == 1).all()
    assert not kept.stack.dear
    assert isinstance(kept.stack.images, np.memmap) == (budget_mb == 1e-6)
    got = kept.stack.read(np.arange(60))
    if exact:
        assert np.array_equal(got, stored)
    else:
        # a half float is exact to 2^-11 of the value, or to 2^-25 of its image's scale
        assert (np.abs(got - stored) <= stored * 2.0**-11 + 16 * 2.0**-24).all()
    assert (stack.asked == 1).all()


def test_cheap_images_are_left_where_they_are():
    whole = sample()
    assert materialize(whole) is whole


def test_materialising_can_be_cancelled():
    def stop(fraction, label):
        raise Cancelled

    with pytest.raises(Cancelled):
        materialize(sample(stack=Dear(images())), progress=stop)


def test_images_that_do_not_fit_into_memory_take_none():
    dear = Dear(images())
    kept = materialize(sample(stack=dear), memory_mb=0)
    assert isinstance(kept.stack.images, np.memmap) and held_mb(kept.stack) == 0
    assert held_mb(materialize(sample(stack=Dear(images()))).stack) == dear.stored.nbytes / 2**20


def test_a_full_temporary_folder_is_told(monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage(9, 9, 0))
    with pytest.raises(OutputFailed, match="random: its images take"):
        materialize(sample(stack=Dear(images())), memory_mb=0)
