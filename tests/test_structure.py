"""The layout: imports point down, the wheel's only top-level name is lutgen, no heavy import on a light path."""

import ast
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import lutgen

ROOT = Path(__file__).parent.parent
LEVELS = [
    {"cli"},
    {"commands"},
    {"benchmark", "checking"},
    {"charts", "exports", "render", "planning"},
    {"baking", "fitting"},
    {"solvers"},
    {"subject", "tone"},
    {"painting", "mapping"},
    {"placing"},
    {"probing", "head", "maps", "environment"},
    {"pictures"},
    {"folders", "manifest", "preview", "paper", "device", "exr", "lutset", "expansion"},
    {"config", "scene", "glsl", "mesh", "complexion", "paths", "profiles", "quadrature", "burley", "lighting"},
    {"axes", "tissue", "color", "sculpt", "hair", "pores", "surroundings", "cache", "hdr", "landmarks"},
    {"chromophores"},
    {"extras"},
    {"progress", "errors"},
]
HEAVY = {
    "pyopencl": {"device"}, "OpenEXR": {"exr"}, "colour": {"data"}, "scipy": {"data"}, "matplotlib": {"charts"},
    "trimesh": {"mesh"}, "pooch": {"mesh"}, "moderngl": set(), "glfw": set(), "imgui_bundle": set(),
}  # fmt: skip


def modules():
    for path in sorted((ROOT / "lutgen").rglob("*.py")):
        yield path, path.relative_to(ROOT / "lutgen").parts[0].removesuffix(".py")


def imported(path: Path) -> list[tuple[str, bool]]:
    """Full names that a file imports, and whether at the top of the module."""
    tree = ast.parse(path.read_text())
    found = []
    for node in ast.walk(tree):
        top = node in tree.body
        if isinstance(node, ast.Import):
            found += [(alias.name, top) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found += [(f"{node.module}.{alias.name}", top) for alias in node.names]
    return found


def level(name: str) -> int:
    return next(i for i, names in enumerate(LEVELS) if name in names)


def test_imports_point_down():
    upward = []
    for path, name in modules():
        if name in ("__init__", "data"):
            continue
        for full, _ in imported(path):
            parts = full.split(".")
            if parts[0] == "lutgen" and len(parts) > 1 and parts[1] not in ("data", "kernels", "luts", "load"):
                target = parts[1]
                if any(target in names for names in LEVELS) and level(target) < level(name):
                    upward.append((name, target))
    assert not upward


@pytest.mark.parametrize(("package", "allowed"), HEAVY.items())
def test_heavy_packages_have_one_room(package, allowed):
    users = {name for path, name in modules() for full, _ in imported(path) if full.split(".")[0] == package}
    assert users <= allowed


def test_the_viewer_imports_nothing_that_bakes():
    """Only what `lutgen/` has below its baking, no device and no pictures of other rooms (DESIGN)."""
    above = set().union(*LEVELS[: level("baking") + 1], {"solvers", "device", "preview", "paper"})
    for path in sorted((ROOT / "viewer").glob("*.py")):
        names = {full.split(".")[1] for full, _ in imported(path) if full.split(".")[0] == "lutgen"}
        assert not names & above, path.name


def test_pictures_need_neither_opencl_nor_a_window():
    pytest.importorskip("moderngl")
    code = (
        "import sys, importlib; [importlib.import_module(f'lutgen.viewer.{n}') for n in ('app', 'laws', 'timing')];"
        "bad = {'pyopencl', 'colour', 'scipy', 'matplotlib', 'glfw', 'imgui_bundle', 'trimesh'} & set(sys.modules);"
        "sys.exit(str(bad) if bad else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_numpy_modules_import_neither_opencl_nor_colour():
    code = (
        "import sys, lutgen; luts = lutgen.load(); luts.color(.02, .7, .01); luts.profile(.02, .7, .01);"
        "luts.expand(oxygenation=.5);"
        "bad = {'pyopencl', 'colour', 'scipy', 'rich', 'PIL', 'matplotlib'} & set(sys.modules);"
        "sys.exit(str(bad) if bad else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_swatch_and_bake_do_not_import_colour(tmp_path):
    code = (
        "import sys; from lutgen.cli import main; main(['swatch', '--preset', 'light']);"
        "main(['bake', '--quality', 'draft', '--photons', '2048', '--out', sys.argv[1]]);"
        "bad = {'colour', 'scipy', 'matplotlib'} & set(sys.modules); sys.exit(str(bad) if bad else 0)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "set")], check=True, capture_output=True)


def test_a_fit_needs_numpy_only():
    code = (
        "import sys; from lutgen.cli import main; main(['fit', '#b89985', '--json']);"
        "bad = {'colour', 'scipy', 'matplotlib', 'pyopencl', 'PIL', 'OpenEXR'} & set(sys.modules);"
        "sys.exit(str(bad) if bad else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_modules_stay_short():
    for path in [*(ROOT / "lutgen").rglob("*.py"), *(ROOT / "viewer").glob("*.py")]:
        assert len(path.read_text().splitlines()) <= 300, path.name
    for path in (ROOT / "kernels").glob("*.cl"):
        assert len(path.read_text().splitlines()) <= 200, path.name


def test_public_functions_have_docstrings():
    for path in [*(path for path, _ in modules()), *(ROOT / "viewer").glob("*.py")]:
        tree = ast.parse(path.read_text())
        for node in tree.body if path.parent.name == "viewer" else ast.walk(tree):  # a window's callbacks have none
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{path.name}: {node.name}"


def test_every_public_name_shows_an_example():
    shown = [getattr(lutgen, name) for name in lutgen.__all__ if callable(getattr(lutgen, name))]
    methods = [value for name, value in vars(lutgen.LutSet).items() if callable(value) and not name.startswith("_")]
    for thing in (*shown, *methods):
        assert ">>>" in (thing.__doc__ or ""), thing.__name__


def test_wheel_holds_one_name_and_its_data(tmp_path):
    clean = tmp_path / "source"  # a build leaves files in its source, which the next one would pack
    shutil.copytree(
        ROOT, clean, ignore=shutil.ignore_patterns(".*", "build", "*.egg-info", "__pycache__", "node_modules")
    )
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(clean)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info" not in name} == {"lutgen"}
    for name in (
        "kernels/path_table.cl", "luts/bake.toml", "luts/default/manifest.json", "luts/default/paths.exr",
        "exports/templates/page.html", "exports/templates/gather.frag.glsl",
        "data/quadrature.csv", "data/color_tables.csv", "data/hemoglobin_prahl_1998.csv", "viewer/__init__.py",
        "data/plan.csv", "data/plan.exr",
        "exports/templates/import_lutgen.py.txt", "exports/templates/LutgenImporter.cs",
    ):  # fmt: skip
        assert f"lutgen/{name}" in names


def test_no_lock_file_and_no_path_of_a_machine():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    assert not {Path(name).name for name in listed} & {"uv.lock", "poetry.lock", "package-lock.json", "yarn.lock"}
    tops = {name.split("/")[0] for name in listed if name}
    assert {t for t in tops if not t.startswith(".")} <= {
        "pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "lutgen", "kernels", "viewer", "luts", "tests",
    }  # fmt: skip


def test_the_readme_has_no_gap_and_its_pictures_exist():
    text = (ROOT / "README.md").read_text()
    assert "@@" not in text
    pictures = re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)
    assert pictures
    assert all((ROOT / picture).is_file() for picture in pictures)
