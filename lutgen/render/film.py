"""A film that a picture is rendered on: sums of its samples, what they say, and the OpenEXR file that it lives in.

Channels: R, G, B (linear ACEScg radiance, averaged over the whole pixel, black beside the head), mask (share of the
pixel that the head covers), samples, sigma.R, .G, .B (standard error of R, G, B, from the samples' own spread), and
square.RR ... .GB (means of products of samples), from which a later run goes on. Attributes: what it was made of, and
counts of rays by kind, of exits without a surface (MISSES) or on one that faces away (REJECTED), over all runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutgen import color
from lutgen.errors import InputError
from lutgen.files import exr, folders

PRODUCTS = ("RR", "GG", "BB", "RG", "RB", "GB")
MOMENTS = 4 + len(PRODUCTS)
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_NOISE_PIXELS = 4096


@dataclass(frozen=True)
class Film:
    """Sums [rows, columns, 10] over `estimates` independent estimates a pixel, of `group` samples each; `facts` say of
    what. Row 0 is on top."""

    sums: np.ndarray
    estimates: int
    group: int
    facts: dict

    @property
    def samples(self) -> int:
        """Samples a pixel."""
        return self.estimates * self.group

    @property
    def rgb(self) -> np.ndarray:
        """Linear ACEScg [rows, columns, 3]."""
        return self.sums[..., :3] / max(self.estimates, 1)

    @property
    def mask(self) -> np.ndarray:
        """Share of each pixel [rows, columns] that the head covers."""
        return self.sums[..., 3] / max(self.estimates, 1)

    def covariance(self) -> np.ndarray:
        """Covariance of the mean color [rows, columns, 3, 3]; of one estimate alone: its square, all of it unsure."""
        n, mean = max(self.estimates, 1), self.rgb
        out = np.zeros((*mean.shape, 3))
        for (i, j), k in zip(_PAIRS, range(4, MOMENTS), strict=True):
            apart = self.sums[..., k] / n - (mean[..., i] * mean[..., j] if n > 1 else 0)
            out[..., i, j] = out[..., j, i] = apart / max(n - 1, 1)
        return out

    def sigma(self) -> np.ndarray:
        """Standard error [rows, columns, 3] of the color."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance(), axis1=-2, axis2=-1), 0))


def empty(size: tuple[int, int], group: int, facts: dict) -> Film:
    """A picture of columns x rows without samples."""
    return Film(np.zeros((size[1], size[0], MOMENTS)), 0, group, facts)


def noise_delta_e(film: Film, exposure: float = 0.0, seed: int = 0) -> float:
    """Mean CIEDE2000 difference that a pixel's noise makes on the skin, from each pixel's own covariance.

    4,096 pixels that the head covers wholly, or if none is, those it covers most, the same each time, moved by a random
    error each; white is 1 under the exposure. Infinite before there are two estimates, 0 where no head is.
    """
    if film.estimates < 2:
        return float("inf")
    most = film.mask.max()
    if most == 0:
        return 0.0
    rows, columns = np.nonzero(film.mask > (1 - 1e-6 if most > 1 - 1e-6 else 0.5 * most))
    rng = np.random.default_rng(seed)
    some = rng.permutation(len(rows))[:_NOISE_PIXELS]
    part = Film(film.sums[rows[some], columns[some]][None], film.estimates, film.group, {})
    mean, covariance = part.rgb[0], part.covariance()[0]
    value, axes = np.linalg.eigh(covariance)
    error = np.einsum("pij,pj->pi", axes, np.sqrt(np.maximum(value, 0)) * rng.standard_normal(mean.shape))
    one, two = (color.lab(color.from_acescg(v * 2.0**exposure, "xyz")) for v in (mean, mean + error))
    return float(color.delta_e00(one, two).mean())


def write(film: Film, path: Path) -> None:
    """Write the picture under another name, then rename: a file is there whole or as it was before."""
    n, rgb, sigma = max(film.estimates, 1), film.rgb, film.sigma()
    channels = {**exr.rgb(rgb), "mask": film.mask, "samples": np.full(film.mask.shape, float(film.samples))}
    channels |= {f"sigma.{name}": sigma[..., i] for i, name in enumerate("RGB")}
    channels |= {f"square.{name}": film.sums[..., 4 + i] / n for i, name in enumerate(PRODUCTS)}
    facts = {"render": film.facts | {"samples": film.samples, "estimates": film.estimates, "group": film.group}}
    part = exr.Part("render", {name: values.astype("f4") for name, values in channels.items()}, facts)
    with folders.whole_file("out", path) as partial:
        exr.write(partial, [part])


def read(path: Path) -> Film:
    """A picture that `write` wrote; InputError where the file is anything else."""
    try:
        (part,) = exr.read(Path(path)).values()
        facts = part.attributes["render"]
        n = int(facts["estimates"])
        names = (*"RGB", "mask", *(f"square.{name}" for name in PRODUCTS))
        sums = np.stack([part.channels[name] for name in names], axis=-1).astype(float) * n
        if not np.all(np.isfinite(sums)):
            raise ValueError("holds NaN")
        return Film(sums, n, int(facts["group"]), facts)
    except (InputError, KeyError, ValueError, TypeError) as error:
        raise InputError(
            f"{path}: not a whole picture of `lutgen render`; give another name, or render it anew"
        ) from error
