"""A Godot 4 project as its own packer would leave it: textures as its importer saves them, files in one PCK.

Layouts: Godot's resource_importer_layered_texture.cpp and resource_importer_texture.cpp (what the editor writes), and
pck_packer.cpp (format 3).
"""

import hashlib
import struct
from pathlib import Path

import numpy as np
import OpenImageIO

RGBH, RGBAH = 14, 15
"""Godot's Image.Format of half floats."""


def parameters(sidecar: str) -> dict[str, str]:
    """Keys and values of a `.import` file, of all sections; texts without their quotes."""
    lines = [line.partition("=") for line in sidecar.splitlines() if "=" in line]
    return {key: value.strip('"') for key, _, value in lines}


def image(texels: np.ndarray) -> bytes:
    """One image as the importer stores it uncompressed: no mips."""
    kind = {3: RGBH, 4: RGBAH}[texels.shape[2]]
    return struct.pack("<IHHII", 0, texels.shape[1], texels.shape[0], 0, kind) + texels.astype("<f2").tobytes()


def imported(path: Path) -> tuple[str, str, bytes]:
    """The importer's type, suffix and file of an EXR, by the sidecar beside it."""
    settings = parameters(path.with_name(path.name + ".import").read_text())
    assert settings["compress/mode"] == "3"
    assert settings["mipmaps/generate"] == "false"
    source = OpenImageIO.ImageInput.open(str(path))
    assert source is not None
    texels = source.read_image("half")
    assert texels is not None
    source.close()
    if settings["importer"] == "texture":
        assert settings["type"] == "CompressedTexture2D"
        assert settings["process/fix_alpha_border"] == "false"
        head = b"GST2" + struct.pack("<IIIIIIII", 1, texels.shape[1], texels.shape[0], 0, 0, 0, 0, 0)
        return settings["type"], "ctex", head + image(texels)
    assert settings["importer"] == "3d_texture"
    across, down = int(settings["slices/horizontal"]), int(settings["slices/vertical"])
    width, height = texels.shape[1] // across, texels.shape[0] // down
    tiles = [
        texels[height * i : height * (i + 1), width * j : width * (j + 1)] for i in range(down) for j in range(across)
    ]
    head = b"GSTL" + struct.pack("<IIIIIIII", 1, len(tiles), 3, 0, 0, 0, 0, 0)
    return settings["type"], "ctex3d", head + b"".join(image(tile) for tile in tiles)


def project(folder: Path, under: str) -> dict[str, bytes]:
    """Files of an exported folder by their path in a project, imported: the EXRs become what the engine loads."""
    files = {}
    for path in sorted(folder.iterdir()):
        if path.suffix == ".exr":
            kind, suffix, content = imported(path)
            cached = f".godot/imported/{path.name}.{suffix}"
            files[cached] = content
            files[f"{under}/{path.name}.import"] = (
                f'[remap]\n\nimporter="test"\ntype="{kind}"\npath="res://{cached}"\n'.encode()
            )
        elif path.suffix != ".import":
            files[f"{under}/{path.name}"] = path.read_bytes()
    return files


def pck(files: dict[str, bytes]) -> bytes:
    """A pack of format 3 for Godot 4.5 and later."""
    base = 112
    data, entries = b"", b""
    for name, content in files.items():
        path = name.encode()
        path += b"\0" * (-len(path) % 4)
        entries += struct.pack("<I", len(path)) + path + struct.pack("<QQ", len(data), len(content))
        entries += hashlib.md5(content).digest() + struct.pack("<I", 0)
        data += content + b"\0" * (-len(content) % 16)
    head = b"GDPC" + struct.pack("<IIIII", 3, 4, 5, 0, 2) + struct.pack("<QQ", base, base + len(data))
    return head.ljust(base, b"\0") + data + struct.pack("<I", len(files)) + entries
