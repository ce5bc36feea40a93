"""Mutated files end in a result or a named error; `make fuzz` tries many more of them."""

from tests.btf.readers.mutate import run


def test_mutants_are_read_or_refused(tmp_path):
    for kind, (read, refused) in run(150, tmp_path).items():
        assert read + refused == 150
        assert refused > 0, kind
