"""The scripts that run inside Unreal and Unity: their syntax, their calls against the documented API, what they set.

Unreal's script runs against a module that has only what the documentation lists, and records. Unity's is parsed, and
every type, member and number of arguments looked up.
"""

import json
import math
import re
import runpy
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import tree_sitter
import tree_sitter_c_sharp

from lutgen.cli import main
from lutgen.exports import unreal
from lutgen.exports.engine_textures import template

# dev.epicgames.com, Unreal Python API, the pages of these classes for 5.1 to 5.7. A property's type is a Python type,
# an enum or a class of this table.
TEXTURE = {
    "srgb": bool, "never_stream": bool, "mip_gen_settings": "TextureMipGenSettings", "filter": "TextureFilter",
    "compression_settings": "TextureCompressionSettings",
}  # fmt: skip
UNREAL_PROPERTIES = {
    "AssetImportTask": {
        "filename": str, "destination_path": str, "destination_name": str, "automated": bool, "save": bool,
        "replace_existing": bool, "replace_existing_settings": bool, "async_": bool,
    },
    "Texture2D": TEXTURE | {"address_x": "TextureAddress", "address_y": "TextureAddress"},
    "VolumeTexture": TEXTURE | {
        "address_mode": "TextureAddress", "source2d_texture": "Texture2D", "source2d_tile_size_x": int,
        "source2d_tile_size_y": int,
    },
    "VolumeTextureFactory": {}, "SubsurfaceProfileFactory": {},
    "SubsurfaceProfile": {"settings": "SubsurfaceProfileStruct"},
    "SubsurfaceProfileStruct": {
        "surface_albedo": "LinearColor", "mean_free_path_color": "LinearColor", "mean_free_path_distance": float,
        "world_unit_scale": float, "enable_burley": bool, "enable_mean_free_path": bool, "tint": "LinearColor",
        "boundary_color_bleed": "LinearColor", "extinction_scale": float, "normal_scale": float,
        "scattering_distribution": float, "ior": float, "roughness0": float, "roughness1": float, "lobe_mix": float,
        "transmission_tint_color": "LinearColor",
    },
}  # fmt: skip
UNREAL_ENUMS = {
    "TextureMipGenSettings": ("TMGS_FROM_TEXTURE_GROUP", "TMGS_NO_MIPMAPS", "TMGS_LEAVE_EXISTING_MIPS"),
    "TextureCompressionSettings": ("TC_DEFAULT", "TC_HDR", "TC_HDR_COMPRESSED", "TC_HDR_F32", "TC_HALF_FLOAT"),
    "TextureFilter": ("TF_DEFAULT", "TF_NEAREST", "TF_BILINEAR", "TF_TRILINEAR"),
    "TextureAddress": ("TA_WRAP", "TA_CLAMP", "TA_MIRROR"),
}
SCRIPT = template("import_lutgen.py.txt")


class Thing:
    """An object of the engine: takes the properties of its class and no others, each of its type."""

    def __init__(self, kind: str, name: str = ""):
        self.kind, self.name, self.properties, self.saved = kind, name, {}, None

    def set_editor_property(self, name, value):
        expected = UNREAL_PROPERTIES[self.kind][name]
        if isinstance(expected, str):
            kind = value.split(".")[0] if isinstance(value, str) else getattr(value, "kind", None)
            assert kind == expected, (name, value)
        else:
            assert type(value) is expected, (name, value)
        self.properties[name] = value
        if name == "source2d_texture":  # the engine guesses a cube of the strip's pixels
            self.properties |= {"source2d_tile_size_x": 27, "source2d_tile_size_y": 27}

    def get_editor_property(self, name):
        value = self.properties[name]
        if isinstance(value, Thing):  # a struct comes out as a copy
            value = Thing(value.kind)
            value.properties = dict(self.properties[name].properties)
        return value


class Editor:
    """What the script sees as `unreal`, documented names alone, and what it left in the project."""

    def __init__(self):
        self.assets, self.created, self.logged = {}, [], []
        library = SimpleNamespace(
            load_asset=self.assets.get, does_asset_exist=self.assets.__contains__, save_loaded_asset=self.save
        )
        tools = SimpleNamespace(create_asset=self.create, import_asset_tasks=self.run)
        kinds = {name: self.kind(name) for name in UNREAL_PROPERTIES}
        enums = {name: SimpleNamespace(**{v: f"{name}.{v}" for v in values}) for name, values in UNREAL_ENUMS.items()}
        helpers = SimpleNamespace(get_asset_tools=lambda: tools)
        self.module = SimpleNamespace(
            **kinds, **enums, EditorAssetLibrary=library, AssetToolsHelpers=helpers, LinearColor=self.color,
            log=self.logged.append,
        )  # fmt: skip

    @staticmethod
    def kind(name):
        return type(name, (Thing,), {"__init__": lambda self: Thing.__init__(self, name)})

    @staticmethod
    def color(r, g, b, a):
        thing = Thing("LinearColor")
        thing.properties = {"rgba": (r, g, b, a)}
        return thing

    def create(self, name, path, kind, factory):
        assert factory.kind == f"{kind.__name__}Factory"
        thing = Thing(kind.__name__, name)
        if thing.kind == "SubsurfaceProfile":
            thing.properties["settings"] = Thing("SubsurfaceProfileStruct")
        self.created.append(name)
        self.assets[f"{path}/{name}"] = thing
        return thing

    def run(self, tasks):
        for task in tasks:
            file, options = Path(task.properties["filename"]), task.properties
            assert options["automated"]
            assert options["replace_existing"]
            if file.exists():  # Interchange names the asset by its file
                path = f"{options['destination_path']}/{file.stem}"
                self.assets.setdefault(path, Thing("Texture2D", file.stem))

    def save(self, asset, only_if_dirty):
        assert only_if_dirty is False
        asset.saved = dict(asset.properties)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("exports") / "all"
    assert main(["export", "--to", "unreal,unity", "--out", str(out)]) == 0
    return out


@pytest.fixture
def editor(monkeypatch):
    editor = Editor()
    monkeypatch.setitem(sys.modules, "unreal", editor.module)
    return editor


def test_unreals_script_imports_everything_with_the_right_settings(folder, editor):
    assert (folder / "unreal/import_lutgen.py").read_text() == SCRIPT
    runpy.run_path(str(folder / "unreal/import_lutgen.py"))
    values = json.loads((folder / "unreal/lutgen.json").read_text())
    content = "/Game/Lutgen"
    textures = {f"{content}/T_LutgenColor", f"{content}/T_LutgenProfile", f"{content}/VT_LutgenColor"}
    assert set(editor.assets) == textures | {f"{content}/{name}" for name in values["subsurface_profiles"]}
    assert all(asset.saved == asset.properties for asset in editor.assets.values())  # nothing is set after it is saved
    plain = {"srgb": False, "mip_gen_settings": "TextureMipGenSettings.TMGS_NO_MIPMAPS", "never_stream": True}
    clamp, hdr = "TextureAddress.TA_CLAMP", "TextureCompressionSettings.TC_HDR"
    flat = plain | {"address_x": clamp, "address_y": clamp}
    strip = editor.assets[f"{content}/T_LutgenColor"]
    assert strip.properties == flat | {"compression_settings": hdr, "filter": "TextureFilter.TF_BILINEAR"}
    profile = editor.assets[f"{content}/T_LutgenProfile"].properties
    assert profile == flat | {"compression_settings": f"{hdr}_F32", "filter": "TextureFilter.TF_NEAREST"}
    assert editor.assets[f"{content}/VT_LutgenColor"].properties == plain | {
        "compression_settings": hdr, "filter": "TextureFilter.TF_BILINEAR", "address_mode": clamp,
        "source2d_texture": strip, "source2d_tile_size_x": 16, "source2d_tile_size_y": 8,
    }  # fmt: skip
    for name, expected in values["subsurface_profiles"].items():
        settings = editor.assets[f"{content}/{name}"].properties["settings"].properties
        plain_values = {k: list(v.properties["rgba"][:3]) if isinstance(v, Thing) else v for k, v in settings.items()}
        assert plain_values == expected
    assert editor.logged == ["lutgen: imported into /Game/Lutgen"]


def test_unreals_script_run_again_makes_nothing_new(folder, editor):
    runpy.run_path(str(folder / "unreal/import_lutgen.py"))
    first = dict(editor.assets)
    runpy.run_path(str(folder / "unreal/import_lutgen.py"))
    assert editor.assets == first
    assert len(editor.created) == len(set(editor.created)) == 10


def test_unreals_script_says_what_was_not_imported(folder, editor, tmp_path):
    for name in ("import_lutgen.py", "lutgen.json", "T_LutgenColor.exr"):
        (tmp_path / name).write_bytes((folder / "unreal" / name).read_bytes())
    with pytest.raises(RuntimeError, match=r"T_LutgenProfile\.exr was not imported"):
        runpy.run_path(str(tmp_path / "import_lutgen.py"))


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("TextureFilter.TF_NEAREST", "TextureFilter.TF_POINT"),
        ("unreal.VolumeTextureFactory()", "unreal.VolumeFactory()"),
        ("save_loaded_asset(asset", "save_asset_now(asset"),
        (".import_asset_tasks(", ".import_assets_now("),
        ('"source2d_tile_size_x"', '"source_2d_tile_size_x"'),
        ("asset.set_editor_property", "asset.set_property"),
    ],
)
def test_an_undocumented_name_is_found_in_unreals_script(folder, editor, tmp_path, right, wrong):
    """The tests above run every line of the script, and the module that they run it against has no such name."""
    assert right in SCRIPT
    shutil.copytree(folder / "unreal", tmp_path / "unreal")
    script = tmp_path / "unreal/import_lutgen.py"
    script.write_text(SCRIPT.replace(right, wrong))
    with pytest.raises((AttributeError, KeyError)):
        runpy.run_path(str(script))


def test_every_property_of_a_profile_is_documented(folder):
    values = json.loads((folder / "unreal/lutgen.json").read_text())["subsurface_profiles"]
    for name, properties in values.items():
        assert re.fullmatch(r"SSP_Lutgen_[A-Za-z]+", name)
        assert set(properties) <= set(UNREAL_PROPERTIES["SubsurfaceProfileStruct"])
        assert all(math.isfinite(v) for v in properties["mean_free_path_color"])
        assert min(properties["mean_free_path_color"]) >= unreal.LEAST


# docs.unity3d.com, Scripting API, 2021.3 to 6000.0, and .NET's own: members of each type, a method with the number of
# arguments that the script gives it, a constructor as new.
UNITY = """
AssetDatabase: FindAssets(1) GUIDToAssetPath(1) LoadAssetAtPath(1) SaveAssets(0) CreateAsset(2) ImportAsset(2)
AssetImporter: GetAtPath(1) SaveAndReimport(0)
TextureImporter: ReadTextureSettings(1) SetTextureSettings(1) GetDefaultPlatformTextureSettings(0)
    SetPlatformTextureSettings(1)
TextureImporterSettings: new(0) textureType textureShape flipbookColumns flipbookRows sRGBTexture mipmapEnabled
    readable npotScale alphaIsTransparency wrapMode filterMode
TextureImporterPlatformSettings: format textureCompression maxTextureSize
TextureImporterType: Default
TextureImporterShape: Texture2D Texture3D
TextureImporterFormat: RGBAHalf RGBAFloat
TextureImporterCompression: Uncompressed
TextureImporterNPOTScale: None
TextureWrapMode: Clamp
FilterMode: Point Bilinear
TextureFormat: RGBAHalf
ImportAssetOptions: ForceUpdate
Texture3D: new(5) name wrapMode filterMode SetPixels(1) Apply(0) GetPixel(3)
Color: new(4) r g b a
Mathf: Abs(1) Max(2)
Debug: Log(1) LogError(1)
JsonUtility: FromJson(1)
EditorUtility: CopySerialized(2)
ScriptableObject: CreateInstance(1)
SerializedObject: new(1) FindProperty(1) ApplyModifiedPropertiesWithoutUndo(0)
SerializedProperty: colorValue floatValue
MenuItem: new(1)
Serializable: new(0)
File: ReadAllText(1) ReadAllLines(1)
Path: GetFileName(1) GetFileNameWithoutExtension(1)
FileNotFoundException: new(1)
CultureInfo: InvariantCulture
string: Substring(2) LastIndexOf(1) Split(1) Length
int: Parse(2)
float: Parse(2)
char: IsDigit(1)
bool:
"""
SHARP = template("LutgenImporter.cs")
PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_c_sharp.language()))


def documented() -> dict[str, dict[str, int | None]]:
    """Members of each type: how many arguments a method takes, None for what is no method."""
    types = {}
    for entry in re.split(r"\n(?=\S)", UNITY.strip()):
        name, members = entry.split(":", 1)
        calls = re.findall(r"(\w+)(?:\((\d)\))?", members)
        types[name] = {member: int(count) if count else None for member, count in calls}
    return types


def nodes(node, *kinds: str) -> Iterator[Any]:
    """The node and all below it that are of these kinds, from top to bottom."""
    if node.type in kinds:
        yield node
    for child in node.children:
        yield from nodes(child, *kinds)


def text(node, field: str = "") -> str:
    part = node.child_by_field_name(field) if field else node
    return part.text.decode() if part else ""


def own(root) -> dict[str, dict[str, int | None]]:
    """The script's own classes, innermost last: their fields and methods."""
    types = {}
    for kind in nodes(root, "class_declaration"):
        body = kind.child_by_field_name("body").children
        fields = [
            text(v, "name") for f in body if f.type == "field_declaration" for v in nodes(f, "variable_declarator")
        ]
        methods = {
            text(m, "name"): len(list(nodes(m.child_by_field_name("parameters"), "parameter")))
            for m in body if m.type == "method_declaration"
        }  # fmt: skip
        types[text(kind, "name")] = dict.fromkeys(fields) | methods
    return types


def undocumented_in_unity(script: str) -> list[str]:
    """What of a C# script neither the table above nor the script itself has: "syntax", types, members, calls with
    another number of arguments. A member of a named type must be that type's, any other one that of some type."""
    root = PARSER.parse(script.encode()).root_node
    types = documented() | own(root)
    anyone = {(member, count) for members in types.values() for member, count in members.items()}
    wrong = ["syntax"] if root.has_error else []
    for node in nodes(root, "variable_declaration", "parameter", "foreach_statement", "type_argument_list"):
        kind = text(node, "type") or text(node).strip("<>")
        wrong += [] if kind.removesuffix("[]") in types else [kind]
    for node in nodes(root, "attribute", "object_creation_expression"):
        kind = text(node, "name") or text(node, "type")
        arguments = node.child_by_field_name("arguments")
        count = len(list(arguments.named_children)) if arguments else None
        fits = "new" in types.get(kind, {}) and count in (None, types[kind]["new"])
        wrong += [] if fits else [f"new {kind}({count})"]
    for node in nodes(root, "invocation_expression", "member_access_expression"):
        count = None
        if node.type == "invocation_expression":
            arguments, node = node.child_by_field_name("arguments"), node.child_by_field_name("function")
            count = arguments.named_child_count
        elif node.parent.type == "invocation_expression" and node.parent.child_by_field_name("function") == node:
            continue
        member, receiver = re.sub("<.*", "", text(node, "name") or text(node)), text(node, "expression")
        fits = types[receiver].get(member, -1) == count if receiver in types else (member, count) in anyone
        wrong += [] if fits else [f"{receiver}.{member}({count})"]
    return wrong


def test_unitys_importer_uses_the_documented_api_only(folder):
    assert (folder / "unity/Editor/LutgenImporter.cs").read_text() == SHARP
    assert undocumented_in_unity(SHARP) == []


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("settings.npotScale", "settings.nPOTScale"),
        ("FilterMode.Point", "FilterMode.Nearest"),
        ("AssetDatabase.FindAssets(", "AssetDatabase.FindAllAssets("),
        ("texture.Apply()", "texture.Apply(1, 2, 3)"),
        ("importer.SaveAndReimport();", "importer.SaveAndReimport()"),
        ("LoadAssetAtPath<Texture3D>(color)", "LoadAssetAtPath<Texture4D>(color)"),
        ("texel.r -", "texel.red -"),
        ("export.profiles)", "export.presets)"),
        ("Number(words[0])", "Number(words[0], 1)"),
        ("multiplier.floatValue", "multiplier.singleValue"),
        ("new Texture3D(size, size, size, TextureFormat.RGBAHalf, false)", "new Texture3D(size, size, size)"),
        ('MenuItem("Tools', 'MenuEntry("Tools'),
        (
            "(Texture3D cube, string path)\n    {",
            "(Texture3D cube, string path)\n    {\n        Renderer other = null;",
        ),
    ],
)
def test_what_unity_does_not_have_is_found(right, wrong):
    assert right in SHARP
    assert undocumented_in_unity(SHARP.replace(right, wrong, 1))


def test_the_importer_reads_what_the_export_writes(folder):
    """JsonUtility fills fields by name and leaves out, without a word, what it does not find."""
    written = json.loads((folder / "unity/lutgen.json").read_text())
    fields = own(PARSER.parse(SHARP.encode()).root_node)
    assert set(fields["Export"]) == {"columns", "size", "corners", "profiles"} <= set(written)
    assert set(fields["Profile"]) <= set(written["profiles"][0])
    assert written["size"] == [16, 8, 16]  # melanin, eumelanin, hemoglobin
    assert written["columns"] == written["size"][2]
    assert len(written["corners"]) == 24
    for name in re.findall(r'folder \+ "/([\w.]+\.(?:exr|cube))"', SHARP):
        assert (folder / "unity" / name).exists()
