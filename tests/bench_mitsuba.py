"""Our walk inside a mesh against Mitsuba 3 on spheres of a scattering medium: `python tests/bench_mitsuba.py`.

Not a test: it needs Mitsuba, which lutgen does not (`pip install mitsuba`). What is compared is the share of even light
that a sphere gives back, its mirror's part included: the mean radiance over the disc that an orthographic camera sees
of it under light of radiance 1 from all around. Mitsuba: `volpath`, scalar_rgb, no Russian roulette, a homogeneous
medium with a Henyey-Greenstein phase in a smooth dielectric sphere. Ours: the queue walk inside a mesh of a sphere.
Both give a standard error; they must agree within 4 of them. A channel of albedo 1 comes along in Mitsuba: it gives back
all light, so that its value is how much of the picture the sphere covers, and its ratio to the others is free of that.

`--mitsuba FILE` and `--ours FILE` do one side and keep its values as JSON, for where both do not fit into one
environment; `--against FILE` compares with kept values.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

INDEX = 1.4
BATCHES = 20
PATHS = 400_000


@dataclass(frozen=True)
class Case:
    """A sphere: radius in mm, extinction per mm, anisotropy, two albedos, nearly lossless and absorbing."""

    radius_mm: float
    mu_t_per_mm: float
    g: float
    albedos: tuple[float, float]


CASES = (
    Case(2.0, 5.0, 0.8, (0.9999, 0.98)),
    Case(2.0, 25.0, 0.78, (0.9999, 0.99)),  # as skin at 550 nm: reduced scattering 5.5 per mm
    Case(5.0, 10.0, 0.9, (0.9999, 0.99)),
    Case(10.0, 1.5, 0.0, (0.9999, 0.95)),
    Case(20.0, 5.0, 0.8, (0.99999, 0.995)),
    Case(20.0, 25.0, 0.78, (0.99999, 0.998)),
)


def mitsuba_shares(case: Case, paths: int, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Shares given back [2], their standard errors, and what a lossless sphere gives back (1 and its noise)."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    R, T = case.radius_mm, mi.ScalarTransform4f
    aim = T().look_at(origin=[0, 0, 3 * R], target=[0, 0, 0], up=[0, 1, 0]) @ T().scale([R, R, 1])
    medium = {
        "type": "homogeneous", "sigma_t": case.mu_t_per_mm, "phase": {"type": "hg", "g": case.g},
        "albedo": {"type": "rgb", "value": [1.0, *case.albedos]},
    }  # fmt: skip
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 1 << 30, "hide_emitters": True},
        "sensor": {
            "type": "orthographic", "to_world": aim,
            "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "independent", "sample_count": 1},
        },
        "light": {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}},
        "ball": {"type": "sphere", "radius": R, "interior": medium,
                 "bsdf": {"type": "dielectric", "int_ior": INDEX, "ext_ior": 1.0}},
    })  # fmt: skip
    each = paths // BATCHES
    seen = np.array([np.array(mi.render(scene, seed=seed * BATCHES + k, spp=each)).ravel() for k in range(BATCHES)])
    whole = seen.mean(axis=0)
    shares = whole[1:] / whole[0]
    sigma = (seen[:, 1:] - shares * seen[:, :1]).std(axis=0, ddof=1) / np.sqrt(BATCHES) / whole[0]
    return shares, sigma, float(whole[0] * 4 / np.pi)


def transmitted(cosine: np.ndarray) -> np.ndarray:
    """Share of unpolarized light at that cosine in air that enters."""
    inside = np.sqrt(1 - (1 - cosine**2) / INDEX**2)
    across = (cosine - INDEX * inside) / (cosine + INDEX * inside)
    along = (INDEX * cosine - inside) / (INDEX * cosine + inside)
    return 1 - (across**2 + along**2) / 2


def report(name: str, shares, sigma) -> str:
    """One side's values in a line."""
    return f"  {name:9}" + "   ".join(f"{v:.5f} ± {s:.5f}" for v, s in zip(shares, sigma, strict=True))


def main() -> None:
    """Measure one side or both; compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mitsuba", metavar="FILE", type=Path)
    parser.add_argument("--ours", metavar="FILE", type=Path)
    parser.add_argument("--against", metavar="FILE", type=Path)
    parser.add_argument("--paths", type=int, default=PATHS)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    kept = []
    for case in CASES:
        print(case)
        start = time.perf_counter()
        shares, sigma, lossless = mitsuba_shares(case, options.paths, options.seed)
        print(
            report("mitsuba", shares, sigma),
            f"  lossless {lossless:.4f}, {time.perf_counter() - start:.0f} s",
            flush=True,
        )
        first = [
            (1 - v) / ((1 / a - 1) * a * case.mu_t_per_mm * INDEX**2 * 4 / 3 * case.radius_mm)
            for v, a in zip(shares, case.albedos)
        ]
        print("   (1 - R) / (mu_a n^2 4R/3):", first)
        kept.append([*shares, *sigma])
    if options.mitsuba:
        options.mitsuba.write_text(json.dumps(kept))


if __name__ == "__main__":
    main()
