"""What the surface's shader takes from the host: constants of the studio, optics of the skin's surface."""

from __future__ import annotations

import numpy as np

from lutgen.scene import surface
from lutgen.scene.light import STUDIO


def texts(n: float) -> dict[str, str]:
    """Texts by the names that surface.frag.glsl includes, for a skin of refractive index n."""
    return {"constants.glsl": constants(), "surface.cl": surface.glsl(n)}


def constants() -> str:
    """GLSL constants of the studio."""
    ways = [np.array(way) / np.linalg.norm(way) for way, _, _ in STUDIO]
    count = len(STUDIO)

    def vectors(rows) -> str:
        return ", ".join("vec3(" + ", ".join(f"{v:.9g}" for v in row) + ")" for row in rows)

    return "\n".join([
        f"const int STUDIO_LOBES = {count};",
        f"const float STUDIO_SHARPNESS[{count}] = float[]({', '.join(f'{s:.1f}' for _, s, _ in STUDIO)});",
        f"const vec3 STUDIO_DIRECTION[{count}] = vec3[]({vectors(ways)});",
        f"const vec3 STUDIO_COLOR[{count}] = vec3[]({vectors(c for _, _, c in STUDIO)});",
    ])  # fmt: skip
