"""Memory of mapped files is given back, and nothing that was in it is lost."""

import numpy as np
import pytest

from btfcore.btf.factor.mapped import release
from btfcore.btf.stack import ArrayStack, CropStack, SubsetStack


@pytest.mark.parametrize("mode", ["r", "r+", "c"])
def test_nothing_is_lost(mode, tmp_path):
    path = tmp_path / "images"
    values = np.random.default_rng(0).random((6, 8, 9, 3)).astype(np.float16)
    path.write_bytes(values.tobytes())
    mapped = np.memmap(path, np.float16, mode, shape=values.shape)
    if mode != "r":
        mapped[2] = values[2] = 0.25
    for stack in (ArrayStack(mapped), ArrayStack(np.asarray(mapped)[:])):
        release(stack)
        assert np.array_equal(stack.read(np.arange(6)), values.astype(np.float32))
    window = CropStack(SubsetStack(ArrayStack(mapped), [3, 2]), slice(1, 4), slice(0, 9))
    before = window.read([0, 1])
    release(window)
    assert np.array_equal(window.read([0, 1]), before)


def test_arrays_in_memory_and_other_stacks_are_left_alone():
    class Other:
        shape, dear = (1, 2, 2), True

        def read(self, numbers):
            return np.ones((len(numbers), 2, 2, 3), np.float32)

    release(ArrayStack(np.ones((1, 2, 2, 3), np.float32)))
    release(Other())
