"""The meshes and texture samples that ship with Patina (credits: resources/CREDITS.md)."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from btfcore.errors import PatinaError


def resource_folder() -> Path:
    """Folder with `meshes`, `samples`, `textures` and CREDITS.md: a checkout's or an installed one.

    Raises `PatinaError` where an installation lacks it.
    """
    source_tree = Path(__file__).resolve().parents[1] / "resources"
    if (source_tree / "CREDITS.md").is_file():
        return source_tree
    package = find_spec("patina_resources")
    for place in (package and package.submodule_search_locations) or ():
        if (Path(place) / "CREDITS.md").is_file():
            return Path(place)
    raise PatinaError(f"no library of samples: neither {source_tree} nor an installed one")


def meshes() -> list[Path]:
    """Shipped meshes, sorted by name."""
    return _visible(resource_folder() / "meshes")


def samples() -> list[Path]:
    """Shipped texture samples (pictures), sorted by name."""
    return _visible(resource_folder() / "textures")


def btf_samples() -> list[Path]:
    """Shipped BTF samples (packages), sorted by name; some have a feature mask."""
    folder = resource_folder() / "samples"
    return [path for path in _visible(folder) if path.suffix == ".btfz"] if folder.is_dir() else []


def _visible(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.name[0] not in "._")
