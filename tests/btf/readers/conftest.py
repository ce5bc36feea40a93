"""Decoding inside the test's own process, where only our own files are decoded."""

import importlib
import json

import pytest

from btfcore.btf.readers import decode


@pytest.fixture
def in_process(monkeypatch):
    """Run decoding tasks here rather than in a child; the options still pass through JSON."""

    def run(task, arrays, options, **_):
        module, _, name = task.partition(":")
        function = getattr(importlib.import_module(module), name)
        out, answer = function(arrays, json.loads(json.dumps(options)))
        return out, json.loads(json.dumps(answer))

    monkeypatch.setattr(decode, "run_guarded", run)
