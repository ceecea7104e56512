"""GLSL constants of the studio and of what leaves the skin."""

from __future__ import annotations

import numpy as np

from lutgen.scene.light import STUDIO, exit_means


def constants() -> str:
    """GLSL constants of the studio and of what leaves the skin."""
    ways = [np.array(way) / np.linalg.norm(way) for way, _, _ in STUDIO]
    count = len(STUDIO)

    def vectors(rows) -> str:
        return ", ".join("vec3(" + ", ".join(f"{v:.9g}" for v in row) + ")" for row in rows)

    return "\n".join([
        f"const int STUDIO_LOBES = {count};",
        f"const float STUDIO_SHARPNESS[{count}] = float[]({', '.join(f'{s:.1f}' for _, s, _ in STUDIO)});",
        f"const vec3 STUDIO_DIRECTION[{count}] = vec3[]({vectors(ways)});",
        f"const vec3 STUDIO_COLOR[{count}] = vec3[]({vectors(c for _, _, c in STUDIO)});",
        f"const int EXIT_MEANS = {len(exit_means())};",
        f"const float EXIT_MEAN[EXIT_MEANS] = float[]({', '.join(f'{m:.9g}' for m in exit_means())});",
    ])  # fmt: skip
