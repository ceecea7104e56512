"""The scripts that run inside Unreal and Unity: their syntax, their calls against the documented API, what they set.

Unreal's script runs against a module that has only what the documentation lists, and records. Unity's is parsed, the
type of each expression followed, and each member looked up.
"""

import ast
import json
import math
import re
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

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
UNREAL_FUNCTIONS = {
    "EditorAssetLibrary": ("load_asset", "does_asset_exist", "save_loaded_asset"),
    "AssetToolsHelpers": ("get_asset_tools",),
}
ASSET_TOOLS = ("create_asset", "import_asset_tasks")
SCRIPT = template("import_lutgen.py.txt")


class Thing:
    """An object of the engine: takes the properties of its class and no others, each of its type."""

    def __init__(self, kind: str, name: str = ""):
        self.kind, self.name, self.properties, self.saved = kind, name, {}, None

    def set_editor_property(self, name, value):
        expected = UNREAL_PROPERTIES[self.kind][name]
        if isinstance(expected, str):
            found = value.split(".")[0] if isinstance(value, str) else getattr(value, "kind", None)
            assert found == expected, (name, value)
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
    """What the script sees as `unreal`, and what it left in the project."""

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
        assert set(vars(library)) == set(UNREAL_FUNCTIONS["EditorAssetLibrary"])
        assert set(vars(tools)) == set(ASSET_TOOLS)

    @staticmethod
    def kind(name):
        made = type(name, (Thing,), {"__init__": lambda self: Thing.__init__(self, name)})
        return made

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
    made = Editor()
    monkeypatch.setitem(sys.modules, "unreal", made.module)
    return made


def test_unreals_script_imports_everything_with_the_right_settings(folder, editor):
    runpy.run_path(str(folder / "unreal/import_lutgen.py"))
    values = json.loads((folder / "unreal/lutgen.json").read_text())
    at = "/Game/Lutgen"
    textures = {f"{at}/T_LutgenColor", f"{at}/T_LutgenProfile", f"{at}/VT_LutgenColor"}
    assert set(editor.assets) == textures | {f"{at}/{name}" for name in values["subsurface_profiles"]}
    assert all(asset.saved == asset.properties for asset in editor.assets.values())  # nothing is set after it is saved
    plain = {"srgb": False, "mip_gen_settings": "TextureMipGenSettings.TMGS_NO_MIPMAPS", "never_stream": True}
    clamp, hdr = "TextureAddress.TA_CLAMP", "TextureCompressionSettings.TC_HDR"
    flat = plain | {"address_x": clamp, "address_y": clamp}
    strip = editor.assets[f"{at}/T_LutgenColor"]
    assert strip.properties == flat | {"compression_settings": hdr, "filter": "TextureFilter.TF_BILINEAR"}
    profile = editor.assets[f"{at}/T_LutgenProfile"].properties
    assert profile == flat | {"compression_settings": f"{hdr}_F32", "filter": "TextureFilter.TF_NEAREST"}
    assert editor.assets[f"{at}/VT_LutgenColor"].properties == plain | {
        "compression_settings": hdr, "filter": "TextureFilter.TF_BILINEAR", "address_mode": clamp,
        "source2d_texture": strip, "source2d_tile_size_x": 16, "source2d_tile_size_y": 8,
    }  # fmt: skip
    for name, expected in values["subsurface_profiles"].items():
        found = editor.assets[f"{at}/{name}"].properties["settings"].properties
        plain_values = {k: list(v.properties["rgba"][:3]) if isinstance(v, Thing) else v for k, v in found.items()}
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


def undocumented(script: str) -> list[str]:
    """Names of a Python script that are neither Python's, nor its own, nor in the tables above."""
    tree = ast.parse(script)
    kinds = {*UNREAL_PROPERTIES, "LinearColor", "log"}
    wrong = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        chain = ast.unparse(node)
        if chain.startswith("unreal."):
            _, kind, *rest = re.sub(r"\(.*", "", chain).split(".")
            members = UNREAL_ENUMS.get(kind) or UNREAL_FUNCTIONS.get(kind)
            if not (members and set(rest) <= set(members) if kind not in kinds else not rest):
                wrong.append(chain)
        if isinstance(node.value, ast.Call) and ast.unparse(node.value).endswith("get_asset_tools()"):
            wrong += [chain] if node.attr not in ASSET_TOOLS else []
        elif not chain.startswith(("unreal.", "os.", "json.")) and node.attr not in (
            "set_editor_property", "get_editor_property", "items",
        ):  # fmt: skip
            wrong.append(chain)
    known = {name for table in UNREAL_PROPERTIES.values() for name in table}
    wrong += [
        key.value
        for node in ast.walk(tree) if isinstance(node, ast.Dict)
        for key in node.keys if isinstance(key, ast.Constant) and key.value not in known
    ]  # fmt: skip
    return wrong


def test_unreals_script_uses_the_documented_api_only(folder):
    assert (folder / "unreal/import_lutgen.py").read_text() == SCRIPT
    compile(SCRIPT, "import_lutgen.py", "exec", dont_inherit=True)
    assert undocumented(SCRIPT) == []


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
def test_an_undocumented_name_is_found_in_unreals_script(right, wrong):
    assert right in SCRIPT
    assert undocumented(SCRIPT.replace(right, wrong))


def test_every_property_of_a_profile_is_documented(folder):
    values = json.loads((folder / "unreal/lutgen.json").read_text())["subsurface_profiles"]
    for name, properties in values.items():
        assert re.fullmatch(r"SSP_Lutgen_[A-Za-z]+", name)
        assert set(properties) <= set(UNREAL_PROPERTIES["SubsurfaceProfileStruct"])
        assert all(math.isfinite(v) for v in properties["mean_free_path_color"])
        assert min(properties["mean_free_path_color"]) >= unreal.LEAST


# docs.unity3d.com, Scripting API, 2021.3 to 6000.0: a method is Name(number of arguments)=type, a constructor new(…).
UNITY = """
AssetDatabase: FindAssets(1)=string[] GUIDToAssetPath(1)=string LoadAssetAtPath(1)=T SaveAssets(0)=void
    CreateAsset(2)=void ImportAsset(2)=void
AssetImporter: GetAtPath(1)=AssetImporter SaveAndReimport(0)=void
TextureImporter < AssetImporter: ReadTextureSettings(1)=void SetTextureSettings(1)=void
    GetDefaultPlatformTextureSettings(0)=TextureImporterPlatformSettings SetPlatformTextureSettings(1)=void
TextureImporterSettings: new(0) textureType=TextureImporterType textureShape=TextureImporterShape flipbookColumns=int
    flipbookRows=int sRGBTexture=bool mipmapEnabled=bool readable=bool npotScale=TextureImporterNPOTScale
    alphaIsTransparency=bool wrapMode=TextureWrapMode filterMode=FilterMode
TextureImporterPlatformSettings: format=TextureImporterFormat textureCompression=TextureImporterCompression
    maxTextureSize=int
TextureImporterType: Default=TextureImporterType
TextureImporterShape: Texture2D=TextureImporterShape Texture3D=TextureImporterShape
TextureImporterFormat: RGBAHalf=TextureImporterFormat RGBAFloat=TextureImporterFormat
TextureImporterCompression: Uncompressed=TextureImporterCompression
TextureImporterNPOTScale: None=TextureImporterNPOTScale
TextureWrapMode: Clamp=TextureWrapMode
FilterMode: Point=FilterMode Bilinear=FilterMode
TextureFormat: RGBAHalf=TextureFormat
ImportAssetOptions: ForceUpdate=ImportAssetOptions
Object: name=string
Texture3D < Object: new(5) wrapMode=TextureWrapMode filterMode=FilterMode SetPixels(1)=void Apply(0)=void
    GetPixel(3)=Color
Color: new(4) r=float g=float b=float a=float
Mathf: Abs(1)=float Max(2)=float
Debug: Log(1)=void LogError(1)=void
JsonUtility: FromJson(1)=T
EditorUtility: CopySerialized(2)=void
ScriptableObject < Object: CreateInstance(1)=ScriptableObject
SerializedObject: new(1) FindProperty(1)=SerializedProperty ApplyModifiedPropertiesWithoutUndo(0)=bool
SerializedProperty: colorValue=Color floatValue=float
MenuItem: new(1)
Serializable: new(0)
File: ReadAllText(1)=string ReadAllLines(1)=string[]
Path: GetFileName(1)=string GetFileNameWithoutExtension(1)=string
FileNotFoundException: new(1)
CultureInfo: InvariantCulture=CultureInfo
string: Substring(2)=string LastIndexOf(1)=int Split(1)=string[]
string[]: Length=int
int: Parse(2)=int
float: Parse(2)=float
char: IsDigit(1)=bool
"""
SHARP = template("LutgenImporter.cs")


def api_table(text: str) -> dict[str, dict[str, tuple[str, int | None]]]:
    """Members of each type: their type and, for methods, how many arguments they take."""
    table = {}
    for entry in re.split(r"\n(?=\S)", text.strip()):
        head, members = entry.split(":", 1)
        name, _, base = head.partition(" < ")
        table[name] = dict(table.get(base, {}))
        for member in members.split():
            found = re.fullmatch(r"(\w+)(?:\((\d)\))?(?:=(\S+))?", member)
            assert found, member
            table[name][found[1]] = (found[3] or name, int(found[2]) if found[2] else None)
    return table


class Sharp:
    """A C# file whose expressions are followed from type to type; `wrong` is what the table does not have."""

    def __init__(self, text: str):
        parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_c_sharp.language()))
        self.root = parser.parse(text.encode()).root_node
        self.api, self.wrong = api_table(UNITY), ["syntax"] if self.root.has_error else []
        self.methods, self.seen = {}, 0
        for kind in self.found(self.root, "class_declaration"):
            name = self.text(kind, "name")
            fields = [f for f in self.found(kind, "field_declaration") if self.owner(f) == kind]
            self.api[name] = {n: (t, None) for f in fields for n, t in self.declared(f)}
        for method in self.found(self.root, "method_declaration"):
            count = len(self.found(method.child_by_field_name("parameters"), "parameter"))
            self.methods[self.text(method, "name")] = (self.text(method, "returns"), count)
        for method in self.found(self.root, "method_declaration"):
            scope = {self.text(p, "name"): self.text(p, "type") for p in self.found(method, "parameter")}
            scope |= {n: t for d in self.found(method, "local_declaration_statement") for n, t in self.declared(d)}
            scope |= {n: t for d in self.found(method, "for_statement") for n, t in self.declared(d)}
            scope |= {self.text(f, "left"): self.text(f, "type") for f in self.found(method, "foreach_statement")}
            self.visit(method.child_by_field_name("body"), scope)
        for node in self.found(self.root, "attribute"):
            self.check(self.text(node, "name"), "new", None)

    def found(self, node, kind: str) -> list:
        return [n for child in node.children for n in ([child] if child.type == kind else []) + self.found(child, kind)]

    def owner(self, node):
        while node.type != "class_declaration":
            node = node.parent
        return node

    def text(self, node, field: str) -> str:
        return node.child_by_field_name(field).text.decode()

    def declared(self, node):
        for declaration in self.found(node, "variable_declaration"):
            kind = self.text(declaration, "type")
            self.known(kind)
            for variable in self.found(declaration, "variable_declarator"):
                yield self.text(variable, "name"), kind

    def known(self, kind: str) -> None:
        if kind.removesuffix("[]") not in {*self.api, "bool", "void"}:
            self.wrong.append(f"type {kind}")

    def check(self, kind: str, member: str, arguments: int | None) -> str:
        """The type of a member; noted as wrong where the table has none of it, or it takes other arguments."""
        self.seen += 1
        kind = "string[]" if kind.endswith("[]") else kind
        result, count = self.api.get(kind, {}).get(member, ("", None))
        if (
            not result
            or (arguments is not None and count != arguments)
            or (arguments is None and count and member != "new")
        ):
            self.wrong.append(f"{kind}.{member}" + ("" if arguments is None else f"({arguments})"))
        return result

    def visit(self, node, scope: dict) -> str:
        """The type of an expression; visits every statement and expression below."""
        if node.type == "member_access_expression":
            kind = self.visit(node.child_by_field_name("expression"), scope)
            return self.check(kind, self.text(node, "name"), None)
        if node.type == "invocation_expression":
            arguments = [n for n in node.child_by_field_name("arguments").children if n.type == "argument"]
            for argument in arguments:
                self.visit(argument, scope)
            function = node.child_by_field_name("function")
            if function.type == "identifier":
                result, count = self.methods.get(function.text.decode(), ("", -1))
                if count != len(arguments):
                    self.wrong.append(f"{function.text.decode()}({len(arguments)})")
                return result
            name = function.child_by_field_name("name")
            generic = [n.text.decode() for n in self.found(name, "type_argument_list")] if name.children else []
            kind = self.visit(function.child_by_field_name("expression"), scope)
            result = self.check(kind, re.sub(r"<.*", "", name.text.decode()), len(arguments))
            for one in generic:
                self.known(one.strip("<>"))
            return generic[0].strip("<>") if generic and result == "T" else result
        if node.type == "object_creation_expression":
            kind, arguments = self.text(node, "type"), node.child_by_field_name("arguments")
            values = [n for n in arguments.children if n.type == "argument"] if arguments else []
            for value in values:
                self.visit(value, scope)
            return self.check(kind, "new", len(values))
        if node.type == "element_access_expression":
            for child in node.children[1:]:
                self.visit(child, scope)
            kind = self.visit(node.children[0], scope)
            return "char" if kind == "string" else kind.removesuffix("[]")
        if node.type in ("identifier", "predefined_type"):
            name = node.text.decode()
            return scope.get(name, name)
        kinds = [self.visit(child, scope) for child in node.children if child.is_named]
        if node.type == "as_expression":
            return kinds[-1]
        return "string" if node.type == "string_literal" else ""


def test_unitys_importer_uses_the_documented_api_only(folder):
    assert (folder / "unity/Editor/LutgenImporter.cs").read_text() == SHARP
    read = Sharp(SHARP)
    assert read.wrong == []
    assert read.seen > 80  # the walk went through it


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("settings.npotScale", "settings.nPOTScale"),
        ("FilterMode.Point", "FilterMode.Nearest"),
        ("AssetDatabase.FindAssets(", "AssetDatabase.FindAllAssets("),
        ("texture.Apply()", "texture.Apply(1, 2, 3)"),
        ("importer.SaveAndReimport();", "importer.SaveAndReimport()"),
        ("LoadAssetAtPath<Texture3D>(color)", "LoadAssetAtPath<Texture4D>(color)"),
        ("found.r -", "found.red -"),
        ("export.profiles)", "export.presets)"),
        ("Number(words[0])", "Number(words[0], 1)"),
        ("multiplier.floatValue", "multiplier.singleValue"),
        ("new Texture3D(size, size, size, TextureFormat.RGBAHalf, false)", "new Texture3D(size, size, size)"),
        ('MenuItem("Tools', 'MenuEntry("Tools'),
        (
            "(Texture3D made, string path)\n    {",
            "(Texture3D made, string path)\n    {\n        Renderer other = null;",
        ),
    ],
)
def test_what_unity_does_not_have_is_found(right, wrong):
    assert right in SHARP
    assert Sharp(SHARP.replace(right, wrong, 1)).wrong


def test_the_importer_reads_what_the_export_writes(folder):
    """JsonUtility fills fields by name and leaves out, without a word, what it does not find."""
    written = json.loads((folder / "unity/lutgen.json").read_text())
    read = Sharp(SHARP)
    assert set(read.api["Export"]) == {"columns", "size", "corners", "profiles"} <= set(written)
    assert set(read.api["Profile"]) <= set(written["profiles"][0])
    assert written["size"] == [16, 8, 16]  # melanin, eumelanin, hemoglobin
    assert written["columns"] == written["size"][2]
    assert len(written["corners"]) == 24
    for name in re.findall(r'folder \+ "/([\w.]+\.(?:exr|cube))"', SHARP):
        assert (folder / "unity" / name).exists()
