"""The decomposition's bits are those of one thread, however many numpy may use."""

import numpy as np
import pytest

import btfcore.btf.bonn.svd as svd
from btfcore.btf.bonn.one_thread import _door, one_thread
from btfcore.progress import silent


@pytest.fixture
def threads():
    """Set the number of OpenBLAS' threads; it is put back afterwards."""
    door = _door()
    if door is None:
        pytest.skip("numpy is not linked with OpenBLAS")
    before = door[0]()
    yield door[1]
    door[1](before)


def test_the_setting_is_put_back(threads):
    threads(2)
    read = _door()[0]
    with pytest.raises(ZeroDivisionError), one_thread():
        assert read() == 1
        raise ZeroDivisionError
    assert read() == 2


@pytest.mark.parametrize("gram", [4096, 1])
def test_factors_do_not_depend_on_threads(threads, monkeypatch, gram):
    monkeypatch.setattr(svd, "MOST_GRAM", gram)  # 1: by the randomised way
    values = np.random.default_rng(3).normal(size=(150, 1100, 1)).astype(np.float32)
    matrices = svd.Matrices(lambda where: values[where], 150, 1100, [20], 60)
    found = []
    for count in (1, 2):
        threads(count)
        found += svd.factorise(matrices, seed=0, progress=silent)
    assert np.array_equal(found[0].left, found[1].left)
    assert np.array_equal(found[0].right, found[1].right)
