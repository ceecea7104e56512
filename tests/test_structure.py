"""The layout: imports point down, the wheel's only top-level name is lutgen, no heavy import on a light path."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import lutgen

ROOT = Path(__file__).parent.parent
ROOMS = (
    {"errors"},
    {"color", "device"},
    {"files"},
    {"skin"},
    {"solvers"},
    {"tables"},
    {"fitting", "planning"},
    {"head"},
    {"scene"},
    {"render", "viewer", "exports"},
    {"charts"},
    {"commands"},
    {"cli", "__init__"},
    {"__main__"},
)
"""From the ground up: a room imports from those before its line, and from itself."""
HEAVY = {
    "pyopencl": {"device"}, "OpenEXR": {"files"}, "colour": {"tables"}, "scipy": {"planning", "tables"},
    "matplotlib": {"charts"}, "trimesh": {"head"}, "pooch": {"head"}, "moderngl": {"viewer"}, "glfw": {"viewer"},
    "imgui_bundle": {"viewer"},
}  # fmt: skip


def modules():
    """Every module's path, and the room that it lies in."""
    for path in sorted((ROOT / "lutgen").rglob("*.py")):
        yield path, path.relative_to(ROOT / "lutgen").parts[0].removesuffix(".py")
    for path in sorted((ROOT / "viewer").rglob("*.py")):
        yield path, "viewer"


def imported(path: Path) -> list[str]:
    """Full names that a file imports; relative ones stay in its room."""
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def height(room: str) -> int:
    return next(i for i, rooms in enumerate(ROOMS) if room in rooms)


def test_imports_point_one_way_between_rooms():
    upward = []
    for path, room in modules():
        if path.name.startswith("make_"):  # scripts that measure what a table holds, from above
            continue
        for name in imported(path):
            package, _, target = name.partition(".")
            target = target.split(".")[0]
            known = package == "lutgen" and any(target in rooms for rooms in ROOMS) and target != room
            if known and height(target) >= height(room):
                upward.append(f"{path.relative_to(ROOT)}: {name}")
    assert not upward


@pytest.mark.parametrize(("package", "allowed"), HEAVY.items())
def test_heavy_packages_have_one_room(package, allowed):
    users = {room for path, room in modules() for name in imported(path) if name.split(".")[0] == package}
    assert users <= allowed


def test_the_viewer_imports_nothing_that_bakes():
    """A viewer runs where there is no OpenCL; what it takes from solvers is NumPy alone (the next test)."""
    for path in sorted((ROOT / "viewer").rglob("*.py")):
        rooms = {name.split(".")[1] for name in imported(path) if name.split(".")[0] == "lutgen"}
        assert not rooms & {"device", "planning", "render", "charts"}, path.name


def test_pictures_need_neither_opencl_nor_a_window():
    pytest.importorskip("moderngl")
    code = (
        "import sys, importlib; [importlib.import_module(f'lutgen.viewer.{n}') for n in "
        "('app', 'measure.scattering_laws', 'measure.timing')];"
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


def test_public_functions_have_docstrings():
    for path, room in modules():
        tree = ast.parse(path.read_text())
        for node in tree.body if room == "viewer" else ast.walk(tree):  # a window's callbacks have none
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
        "kernels/solvers/path_table.cl", "kernels/common/surface.cl", "viewer/shaders/lut.glsl",
        "luts/bake.toml", "luts/default/manifest.json", "luts/default/paths.exr",
        "exports/templates/page.html", "exports/templates/gather.frag.glsl",
        "tables/quadrature.csv", "color_tables.csv", "skin/hemoglobin_prahl_1998.csv", "viewer/__init__.py",
        "planning/plan.csv", "planning/plan.exr",
        "exports/templates/import_lutgen.py.txt", "exports/templates/LutgenImporter.cs", "py.typed",
    ):  # fmt: skip
        assert f"lutgen/{name}" in names


def test_no_lock_file_and_no_path_of_a_machine():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    assert not {Path(name).name for name in listed} & {"uv.lock", "poetry.lock", "package-lock.json", "yarn.lock"}
    paths = subprocess.run(["git", "grep", "-nIE", "/(work|root|home)/[a-z]"], cwd=ROOT, capture_output=True, text=True)
    assert (paths.returncode, paths.stdout) == (1, "")  # 1: no line matches
    tops = {name.split("/")[0] for name in listed if name}
    assert {t for t in tops if not t.startswith(".")} <= {
        "pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "lutgen", "kernels", "viewer",
        "luts", "tests",
    }  # fmt: skip


def test_the_citation_names_this_version():
    cited = dict(re.findall(r"^([a-z-]+): (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert [cited[key] for key in ("title", "version", "license")] == [
        project[k] for k in ("name", "version", "license")
    ]


def test_colour_science_is_an_extra():
    """100 MB that no default path needs: only what makes and checks the built-in tables."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert not re.search("colour|scipy|matplotlib|xarray", " ".join(project["dependencies"]))
    assert re.search("colour-science.*scipy", " ".join(extras["color"]))
    assert all(re.search(r"lutgen\[.*\bcolor\b.*\]", " ".join(extras[name])) for name in ("all", "test"))
