"""What every test may ask for: the folder of real inputs, and reproducible hypothesis runs."""

from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]

# A deadline would be a time in a test, and a suite that draws anew each time fails for others.
settings.register_profile("patina", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("patina")


def shared_data() -> Path:
    """Folder of real meshes and textures beside the repository; skips where it is absent."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(
            "the folder of real inputs, ../shared/data, is not here", allow_module_level=True
        )
    return folder


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real inputs; the test is skipped where it is absent."""
    return shared_data()
