"""Our walk inside a mesh against Mitsuba 3 on spheres of a scattering medium: `python tests/render/bench_mitsuba.py`.

Not a test: it needs Mitsuba, which lutgen does not (`pip install mitsuba`). What is compared is the share of even light
that a sphere gives back, its mirror's part included: the mean radiance over the disc that an orthographic camera sees
of it, under light of radiance 1 from all around. Mitsuba: `volpath`, scalar_rgb, no Russian roulette, a homogeneous
medium with a Henyey-Greenstein phase in a smooth dielectric sphere. Ours: the queue walk inside a mesh of a sphere.
Both give a standard error; they must agree within 4 of them. In Mitsuba a channel of albedo 1 comes along: it gives
back all light, so that its value is how much of the picture the sphere covers, and ratios to it are free of that.

Where absorption is weak there is a law besides: what is lost is mu_a times the mean path, n^2 4 R / 3 for any
scattering (Blanco & Fournier 2003; n^2 for what is trapped). The last column is what is lost over that, near 1.

`--mitsuba FILE` does Mitsuba's side alone and keeps its values, `--against FILE` ours against kept values: for two
environments.
"""

from __future__ import annotations

import argparse
import importlib
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
    mi = importlib.import_module("mitsuba")
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


def our_shares(case: Case, paths: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares given back [2] and their standard errors, lives drawn at a tenth of the absorption."""
    import trimesh

    from lutgen import device as ocl
    from lutgen.render import distance, mesh_walk, sample_queue
    from lutgen.solvers.path_table import Medium

    device, rng = ocl.choose(), np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=5, radius=case.radius_mm)
    depths = distance.buffers(device, distance.of_mesh(ball.vertices, ball.faces, 0.1, device))
    shares, sigmas = [], []
    for albedo in case.albedos:
        mu_a = (1 - albedo) * case.mu_t_per_mm
        one = [np.array([v]) for v in (550.0, albedo * case.mu_t_per_mm, case.g, 0.1 * mu_a)]
        normal = rng.standard_normal((paths, 3))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        across = np.cross(normal, rng.standard_normal((paths, 3)))
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        cosine = np.sqrt(rng.random(paths))  # a disc of the camera's, evenly
        inside = np.sqrt(1 - (1 - cosine**2) / INDEX**2)[:, None]
        entries = np.zeros(paths, sample_queue.ENTRY)
        entries["position"], entries["normal"], entries["sample"] = case.radius_mm * normal, normal, np.arange(paths)
        entries["direction"] = across * np.sqrt(1 - inside**2) - normal * inside
        tally = mesh_walk.Tally()
        out = ocl.buffer(device, np.zeros(paths, sample_queue.EXIT))
        part = sample_queue.Part(begin=0, end=paths, first=0, samples=1)
        medium = Medium(one[0], one[1], one[2], one[3], 0.1, INDEX)
        mesh_walk.walk(medium, ocl.buffer(device, entries), out, part, seed, device, tally, tuple(depths))
        if tally.lost or tally.unfinished:
            print(f"  {tally.lost} lost, {tally.unfinished} unfinished of {tally.entered}")
        exits, enters = ocl.read(device, out, np.zeros(paths, sample_queue.EXIT)), transmitted(cosine)
        le, ld = (exits[name].astype(float) for name in ("path_epidermis_mm", "path_dermis_mm"))
        back = 1 - enters + enters * np.where(ld >= 0, np.exp(-0.9 * mu_a * (le + ld)), 0)
        shares.append(back.mean())
        sigmas.append(back.std() / np.sqrt(paths))
    return np.array(shares), np.array(sigmas)


def report(name: str, case: Case, shares, sigmas) -> str:
    """One side's values in a line."""
    lost = [(1 - a) * case.mu_t_per_mm * INDEX**2 * 4 / 3 * case.radius_mm for a in case.albedos]
    values = "   ".join(f"{v:.5f} ± {s:.5f}" for v, s in zip(shares, sigmas, strict=True))
    return f"  {name:9}{values}   {(1 - shares[0]) / lost[0]:.4f} ± {sigmas[0] / lost[0]:.4f}"


def main() -> int:
    """Measure one side or both; 1 where they do not agree."""
    parser = argparse.ArgumentParser(description="Our walk inside a mesh against Mitsuba 3.")
    parser.add_argument("--mitsuba", metavar="FILE", type=Path, help="keep Mitsuba's values; nothing else")
    parser.add_argument("--against", metavar="FILE", type=Path, help="compare with kept values")
    parser.add_argument("--paths", type=int, default=PATHS)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    kept = json.loads(options.against.read_text()) if options.against else []
    worst = 0.0
    for k, case in enumerate(CASES):
        print(f"radius {case.radius_mm:g} mm, mu_t {case.mu_t_per_mm:g} per mm, g {case.g:g}, albedos {case.albedos}")
        start = time.perf_counter()
        if options.against:
            shares, sigmas = (np.array(v) for v in kept[k])
            print(report("mitsuba", case, shares, sigmas))
        else:
            shares, sigmas, lossless = mitsuba_shares(case, options.paths, options.seed)
            print(
                report("mitsuba", case, shares, sigmas),
                f"  lossless {lossless:.4f}, {time.perf_counter() - start:.0f} s",
            )
            kept.append([shares.tolist(), sigmas.tolist()])
        if options.mitsuba:
            continue
        start = time.perf_counter()
        ours, our_sigmas = our_shares(case, 4 * options.paths, options.seed)
        print(report("ours", case, ours, our_sigmas), f"  {time.perf_counter() - start:.0f} s")
        apart = (ours - shares) / np.hypot(sigmas, our_sigmas)
        worst = max(worst, float(np.abs(apart).max()))
        print(f"  apart by  {apart[0]:+.2f} and {apart[1]:+.2f} sigma", flush=True)
    if options.mitsuba:
        options.mitsuba.write_text(json.dumps(kept))
        return 0
    print(f"worst: {worst:.2f} sigma; allowed is 4")
    return int(worst > 4)


if __name__ == "__main__":
    raise SystemExit(main())
