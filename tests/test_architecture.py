"""The house: a module imports only from lower floors, and foreign libraries have doors.

The table below is the law; a new room or module is placed here, once, by its prefix.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("btfcore", "app")
LONGEST_FILE = 400

# Longest prefix wins. A room may import itself and every room of a lower floor.
FLOORS = {
    "btfcore": 0,  # the package's own docstring and version
    "btfcore.types": 0,
    "btfcore.errors": 0,
    "btfcore.progress": 0,
    "btfcore.phases": 0,
    "btfcore.guard": 0,
    "btfcore.library": 1,
    "btfcore.guide": 1,
    "btfcore.connection": 1,
    "btfcore.spread": 1,
    "btfcore.hermitian": 1,
    "btfcore.mincut": 1,
    "btfcore.mesh": 1,
    "btfcore.btf.directions": 1,
    "btfcore.btf": 2,
    "btfcore.dense": 2,
    "btfcore.clusters": 2,
    "btfcore.upright": 2,
    "btfcore.field": 2,
    "btfcore.patch": 2,
    "btfcore.quilt": 3,
    "btfcore.paint": 3,
    "btfcore.texton": 3,
    "btfcore.render": 3,
    "btfcore.files": 4,
    "btfcore.samples": 4,
    "btfcore.regions": 4,
    "btfcore.painting": 4,
    "btfcore.pipeline": 4,
    "btfcore.report": 4,
    "btfcore.relighting": 4,
    "app": 5,  # the package's own docstring
    "app.backend": 5,
    "app.console": 5,
    "app.close_guard": 5,
    "app.reports": 5,
    "app.recovery": 5,
    "app.sessions": 5,
    "app.snapshots": 5,
    "app.picking": 5,
    "app.units": 5,
    "app.store": 5,
    "app.settings": 5,
    "app.pressure": 5,
    "app.navigation": 5,
    "app.keys": 5,
    "app.key_table": 5,
    "app.benches": 5,
    "app.contact": 5,
    "app.document": 5,
    "app.layer_views": 5,
    "app.lighting": 5,
    "app.tool_options": 5,
    "app.values": 5,
    "app.commands": 5,
    "app.tasks": 5,
    "app.key_sheet": 5,
    "app.key_events": 5,
    "app.theme": 5,
    "app.edits": 6,
    "app.operations": 6,
    "app.steering": 6,
    "app.lit": 7,
    "app.lit_shader": 7,
    "app.scene": 7,
    "app.shader": 7,
    "app.viewport": 7,
    "app.tools": 7,
    "app.panels": 7,
    "app.preview": 8,
    "app.window": 8,
    "app.workspace": 8,
    "app.menus": 8,
    "app.demo": 8,
    "app.gui": 8,
    "app.paint_cli": 9,
    "app.render_cli": 9,
    "app.sample_cli": 9,
    "app.cli": 9,
    "app.__main__": 9,
}

# Neighbours on one floor, importer first; all other rooms of a floor do not know each other.
BESIDE = {
    ("btfcore.guard", "btfcore.errors"),
    ("btfcore.guard", "btfcore.progress"),
    ("btfcore.paint", "btfcore.quilt"),
    ("btfcore.field", "btfcore.clusters"),
    ("btfcore.field", "btfcore.upright"),
    ("btfcore.upright", "btfcore.clusters"),
    ("btfcore.files", "btfcore.regions"),
    ("btfcore.painting", "btfcore.files"),
    ("btfcore.painting", "btfcore.pipeline"),
    ("btfcore.painting", "btfcore.regions"),
    ("btfcore.painting", "btfcore.samples"),
    ("btfcore.pipeline", "btfcore.files"),
    ("btfcore.pipeline", "btfcore.samples"),
    ("btfcore.pipeline", "btfcore.regions"),
    ("btfcore.relighting", "btfcore.files"),
    ("btfcore.relighting", "btfcore.painting"),
    ("btfcore.relighting", "btfcore.pipeline"),
    ("btfcore.relighting", "btfcore.samples"),
    ("btfcore.report", "btfcore.regions"),
    ("btfcore.samples", "btfcore.files"),
    ("btfcore.report", "btfcore.pipeline"),
    ("app.document", "app.tasks"),
    ("app.document", "app.commands"),
    ("app.document", "app.layer_views"),
    ("app.document", "app.lighting"),
    ("app.document", "app.tool_options"),
    ("app.document", "app.values"),
    ("app.operations", "app.edits"),
    ("app.recovery", "app.reports"),
    ("app.recovery", "app.sessions"),
    ("app.recovery", "app.snapshots"),
    ("app.recovery", "app.tasks"),
    ("app.tasks", "app.reports"),
    ("app.settings", "app.backend"),
    ("app.settings", "app.navigation"),
    ("app.settings", "app.pressure"),
    ("app.settings", "app.units"),
    ("app.keys", "app.key_table"),
    ("app.key_events", "app.keys"),
    ("app.key_sheet", "app.key_table"),
    ("app.key_sheet", "app.keys"),
    ("app.key_sheet", "app.navigation"),
    ("app.panels", "app.viewport"),
    ("app.viewport", "app.lit"),
    ("app.viewport", "app.scene"),
    ("app.lit", "app.scene"),
    ("app.lit", "app.lit_shader"),
    ("app.lit", "app.shader"),
    ("app.lit_shader", "app.scene"),
    ("app.lit_shader", "app.shader"),
    ("app.scene", "app.shader"),
    ("app.tools", "app.scene"),
    ("app.tools", "app.viewport"),
    ("app.window", "app.menus"),
    ("app.window", "app.workspace"),
    ("app.demo", "app.window"),
    ("app.gui", "app.window"),
    ("app.gui", "app.demo"),
    ("app.__main__", "app.cli"),
    ("app.cli", "app.paint_cli"),
    ("app.cli", "app.render_cli"),
    ("app.cli", "app.sample_cli"),
}

# Prefixes that are no rooms: a module `btfcore.new` needs a line of its own above.
EXACT = {"btfcore", "app"}

# Who may import a foreign library; everybody may import those that are not listed.
DOORS = {
    "maxflow": ("btfcore.mincut",),
    "xatlas": ("btfcore.dense.xatlas_door",),
    "igl": ("btfcore.patch.lscm", "btfcore.dense", "btfcore.mesh"),
    "trimesh": ("btfcore.mesh.trimesh_door",),
    "PIL": ("btfcore.btf.pillow_door", "btfcore.files.png", "app"),
    "OpenImageIO": ("btfcore.btf.oiio_door", "btfcore.files.exr"),
    "pydantic": (
        "btfcore.files.package.manifest",
        "btfcore.files.edits_json",
        "btfcore.files.edits_schema",
        "btfcore.files.project",
    ),
    "av": ("btfcore.files.movie",),
    "imageio_ffmpeg": ("btfcore.files.movie",),
    "mitsuba": (),
    "PyQt6": ("app",),
    "pyvistaqt": ("app.viewport",),
    "pyvista": ("app.scene", "app.viewport", "app.tools"),
    "vtk": ("app.scene", "app.shader", "app.viewport", "app.tools"),
    "vtkmodules": ("app.scene", "app.shader", "app.viewport", "app.tools"),
    "typer": ("app",),
    "rich": ("app",),
    "matplotlib": (),
    "cv2": (),
}

# What the command line's help must not wait for.
HEAVY = (
    "PyQt6", "pyvista", "vtkmodules", "numba", "igl", "maxflow", "scipy", "trimesh", "xatlas",
    "OpenImageIO", "pydantic", "av",
)  # fmt: skip


@dataclass(frozen=True)
class Import:
    """One import: `module` imports `target`; `level` > 0 when it is relative."""

    module: str
    target: str
    line: int
    level: int = 0


def modules(root: Path) -> dict[str, Path]:
    """Every module of the packages under `root` by its dotted name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            parts = list(path.relative_to(root).with_suffix("").parts)
            if parts[-1] == "__init__":
                parts.pop()
            found[".".join(parts)] = path
    return found


def imports(module: str, source: str, known: set[str]) -> list[Import]:
    """All imports of a source text, also inside functions and under TYPE_CHECKING."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [Import(module, each.name, node.lineno) for each in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            for each in node.names:
                inner = f"{base}.{each.name}"
                target = inner if inner in known else base
                found.append(Import(module, target, node.lineno, node.level))
    return found


def room(module: str) -> str | None:
    """Longest prefix of `module` in the table, or None where it has no place."""
    parts = module.split(".")
    for length in range(len(parts), 0, -1):
        prefix = ".".join(parts[:length])
        if prefix in FLOORS and (prefix == module or prefix not in EXACT):
            return prefix
    return None


def inside(module: str, prefixes: tuple[str, ...]) -> bool:
    return any(module == each or module.startswith(each + ".") for each in prefixes)


def breaches(root: Path) -> list[str]:
    """Every breach of the house's rules under `root`, each a sentence with its place."""
    files = modules(root)
    found = []
    for module, path in files.items():
        where = path.relative_to(root)
        source = path.read_text(encoding="utf-8")
        length = len(source.splitlines())
        if length > LONGEST_FILE:
            found.append(f"{where} has {length} lines, more than {LONGEST_FILE}")
        home = room(module)
        if home is None:
            found.append(f"{where} has no place in the table of floors")
            continue
        for each in imports(module, source, set(files)):
            found += [f"{where}:{each.line} {what}" for what in judge(each, home, set(files))]
    return found


def judge(each: Import, home: str, known: set[str]) -> list[str]:
    if each.level:
        return ["is a relative import"]
    top = each.target.split(".")[0]
    if top in DOORS and not inside(each.module, DOORS[top]):
        return [f"imports {top}, whose doors are {', '.join(DOORS[top]) or 'none'}"]
    if top not in PACKAGES:
        return []
    if each.target not in known:
        return [f"imports {each.target}, which does not exist"]
    target = room(each.target)
    if target is None or target == home:
        return []
    here, there = FLOORS[home], FLOORS[target]
    if there > here or (there == here and (home, target) not in BESIDE):
        return [f"(floor {here}) imports {each.target} of floor {there}"]
    return []


def test_the_house_has_no_breach():
    assert breaches(ROOT) == []


def test_there_is_a_house():
    assert len(modules(ROOT)) > 20


def test_neighbours_share_a_floor_and_look_one_way():
    for here, there in BESIDE:
        assert FLOORS[here] == FLOORS[there], (here, there)
        assert (there, here) not in BESIDE


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        ("btfcore/mesh/plant.py", "import btfcore.quilt.plant", "floor 1) imports btfcore.quilt"),
        ("btfcore/mesh/plant.py", "from btfcore.quilt import plant", "floor 1) imports"),
        ("btfcore/mesh/plant.py", "def f():\n    from btfcore import pipeline", "of floor 4"),
        ("btfcore/render/plant.py", "from PyQt6.QtGui import QImage", "imports PyQt6"),
        ("btfcore/render/plant.py", "def f():\n    import pyvista as pv", "imports pyvista"),
        ("btfcore/render/plant.py", "import vtkmodules.all", "imports vtkmodules"),
        ("btfcore/files/plant.py", "import rich.console", "imports rich"),
        ("btfcore/files/plant.py", "import typer", "imports typer"),
        ("btfcore/quilt/plant.py", "import maxflow", "doors are btfcore.mincut"),
        ("btfcore/quilt/plant.py", "import xatlas", "doors are btfcore.dense.xatlas_door"),
        ("btfcore/quilt/plant.py", "import igl", "imports igl"),
        ("app/panels/plant.py", "import pyvista", "doors are app.scene"),
        ("app/document.py", "from app.window import Window", "floor 5) imports app.window"),
        ("btfcore/field.py", "from btfcore.dense import x", "floor 2) imports btfcore.dense"),
        ("btfcore/mesh/plant.py", "from . import topology", "relative import"),
        ("btfcore/mesh/plant.py", "import btfcore.nowhere", "does not exist"),
        ("btfcore/plant.py", "", "no place"),
        ("app/plant.py", "", "no place"),
        ("btfcore/mesh/plant.py", "\n" * 401, "401 lines"),
    ],
)
def test_a_planted_breach_is_found(tmp_path, path, source, expected):
    others = ("quilt/plant.py", "dense/__init__.py", "pipeline.py")
    for other in (*(f"btfcore/{each}" for each in others), "app/window.py", path):
        file = tmp_path / other
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(source if other == path else "", encoding="utf-8")
    found = breaches(tmp_path)
    assert len(found) == 1
    assert expected in found[0]


def test_lower_floors_and_open_doors_are_no_breach(tmp_path):
    sources = {
        "btfcore/types.py": "import numpy",
        "btfcore/mincut.py": "import maxflow\nfrom btfcore.types import F8",
        "btfcore/patch/lscm.py": "def f():\n    import igl",
        "btfcore/quilt/one.py": "from btfcore.quilt import two\nfrom btfcore import mincut",
        "btfcore/quilt/two.py": "",
        "app/scene.py": "import pyvista\nfrom btfcore.quilt.one import x",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source, encoding="utf-8")
    assert breaches(tmp_path) == []


def test_help_waits_for_no_heavy_library():
    code = (
        "import sys\n"
        "from app.__main__ import main\n"
        "sys.argv = ['patina', '--help']\n"
        "try:\n"
        "    main()\n"
        "except SystemExit as stop:\n"
        "    assert not stop.code, stop.code\n"
        f"loaded = sorted(set({HEAVY!r}) & set(sys.modules))\n"
        "print('loaded:', loaded)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "decorate" in done.stdout
    assert done.stdout.splitlines()[-1] == "loaded: []"


def test_every_package_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = set(project["tool"]["setuptools"]["packages"]) - {"patina_resources"}
    folders = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
    }
    assert listed == folders
