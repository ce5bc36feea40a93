"""The Khronos validator for tests of glTF files."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

_VERSION = "2.0.0-dev.3.10"


@pytest.fixture(scope="session")
def gltf_issues():
    """Return a function that lists the Khronos validator's errors and warnings of a GLB.

    The validator is fetched once into the user's cache; without node, npm or a network the
    tests that need it are skipped.
    """
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("node and npm, which run the Khronos glTF validator, are not installed")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "patina" / f"gltf-validator-{_VERSION}"
    if not (folder / "node_modules" / "gltf-validator" / "package.json").exists():
        folder.mkdir(parents=True, exist_ok=True)
        command = [npm, "install", "--no-audit", "--no-fund", "--prefix", str(folder)]
        try:
            done = subprocess.run(
                [*command, f"gltf-validator@{_VERSION}"], capture_output=True, timeout=90
            )
        except subprocess.TimeoutExpired:
            pytest.skip("the Khronos glTF validator could not be fetched within 90 s")
        if done.returncode != 0:
            pytest.skip("the Khronos glTF validator could not be fetched with npm")

    def issues(path):
        script = Path(__file__).with_name("validate_gltf.js")
        done = subprocess.run(
            [node, str(script), str(folder), str(path)], capture_output=True, check=True
        )
        (report,) = json.loads(done.stdout)
        return [each for each in report["issues"]["messages"] if severe(each)]

    def severe(message):
        return not isinstance(message, dict) or message["severity"] <= 1

    return issues
