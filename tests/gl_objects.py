"""What lives in the process's OpenGL context, asked of OpenGL itself, and what of it Python can still free."""

import ctypes
import gc

KINDS = ("Texture", "Buffer", "Framebuffer", "Program", "VertexArray", "Renderbuffer", "Query")
_MOST = 4096  # names are handed out from 1 on, freed ones again


_DELETE_STATUS = 0x8B80


def _function(name: str, result, *arguments):
    library = ctypes.CDLL("libEGL.so.1")
    library.eglGetProcAddress.restype = ctypes.c_void_p
    library.eglGetProcAddress.argtypes = [ctypes.c_char_p]
    return ctypes.CFUNCTYPE(result, *arguments)(library.eglGetProcAddress(name.encode()))


def _deleted(program: int) -> bool:
    """Whether a program is freed but still the current one: it goes when another one draws."""
    said = ctypes.c_int()
    asked = _function("glGetProgramiv", None, ctypes.c_uint, ctypes.c_uint, ctypes.POINTER(ctypes.c_int))
    asked(program, _DELETE_STATUS, ctypes.byref(said))
    return bool(said.value)


def alive() -> set[tuple[str, int]]:
    """Kind and name of every object in the current context."""
    found = set()
    for kind in KINDS:
        asked = _function(f"glIs{kind}", ctypes.c_ubyte, ctypes.c_uint)
        found |= {(kind, name) for name in range(1, _MOST) if asked(name)}
    return {(kind, name) for kind, name in found if kind != "Program" or not _deleted(name)}


def held() -> tuple[set[tuple[str, int]], int, int]:
    """Kind and name of objects that a moderngl object can free; how many queries, which have no name; contexts."""
    gc.collect()
    found, queries, contexts = set(), 0, 0
    for thing in gc.get_objects():
        kind = type(thing).__name__
        if type(thing).__module__ != "moderngl":
            continue
        if kind == "Context":
            contexts += 1
        elif kind == "Query":
            queries += 1
        elif type(getattr(thing, "mglo", None)).__name__ != "InvalidObject":
            kind = {"Texture3D": "Texture", "TextureCube": "Texture", "TextureArray": "Texture"}.get(kind, kind)
            found |= {(kind, thing.glo)} if kind in KINDS else set()
    return found, queries, contexts


def orphans() -> set[tuple[str, int]]:
    """Objects that no one can free any more; a query is moderngl's for good, so only their number is compared."""
    (known, queries, _), living = held(), alive()
    spare = sorted(one for one in living if one[0] == "Query")[queries:]
    return {one for one in living - known if one[0] != "Query"} | set(spare)


def delete(kind: str, name: int) -> None:
    """Free an object by its name."""
    if kind == "Program":
        _function("glDeleteProgram", None, ctypes.c_uint)(name)
    else:
        plural = {"Query": "Queries"}.get(kind, f"{kind}s")
        _function(f"glDelete{plural}", None, ctypes.c_int, ctypes.POINTER(ctypes.c_uint))(1, ctypes.c_uint(name))
