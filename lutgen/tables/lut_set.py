"""A LUT set: color and profile at any chromophores, re-expansion from its stored paths, recoloring; NumPy only."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np

from lutgen import color
from lutgen.errors import InputError, in_range, numbers, one_of, shown, summary
from lutgen.skin import chromophores
from lutgen.skin.tissue import Skin, Tissue
from lutgen.solvers import profiles
from lutgen.solvers.paths import PathTable
from lutgen.solvers.profiles import Profile
from lutgen.tables import expand as expansion
from lutgen.tables.axes import Grid


@dataclass(frozen=True)
class ColorLut:
    """Diffuse color of skin [N_h, N_e, N_m, 3]: linear, unclipped ACEScg under D65, per unit of incident light."""

    grid: Grid
    acescg: np.ndarray

    __repr__ = summary


@dataclass(frozen=True)
class ProfileLut:
    """Normalized profile shapes [N_h, N_e, N_m, B, 3] per ACEScg channel, and the share clamped off each [..., 3]."""

    grid: Grid
    radius_edges_mm: np.ndarray
    shape: np.ndarray
    clamped_share: np.ndarray

    __repr__ = summary

    @cached_property
    def taps(self) -> np.ndarray:
        """Quantile taps of every node, [N_h, N_e, N_m, 64, 4]: radius in mm, encircled energy R, G, B."""
        flat = self.shape.reshape(-1, *self.shape.shape[3:])
        return profiles.taps(flat, self.radius_edges_mm).reshape(*self.grid.shape, -1, 4)


@dataclass(frozen=True)
class LutSet:
    """Color LUT, profile LUT, the path table both come from, and the manifest that says what they mean.

    >>> import lutgen
    >>> lutgen.load().oxygenation
    0.7
    """

    color_lut: ColorLut
    profile_lut: ProfileLut
    paths: PathTable
    manifest: dict

    def __repr__(self) -> str:
        colors, profiles_ = (" x ".join(map(str, lut.grid.shape)) for lut in (self.color_lut, self.profile_lut))
        rings = len(self.profile_lut.radius_edges_mm) - 1
        traced = f"{len(self.paths.wavelength_nm)} wavelengths of {self.paths.photons:,} photons"
        tables = f"{colors} colors, {profiles_} profiles of {rings} rings"
        return f"LutSet({tables}, {traced}, oxygenation {self.oxygenation:g})"

    @cached_property
    def tissue(self) -> Tissue:
        """What the LUTs stand for besides the chromophores of their axes."""
        return Tissue(**self.manifest["recipe"]["skin"])

    @property
    def oxygenation(self) -> float:
        """Oxygenation of the blood that the LUTs stand for."""
        return self.tissue.oxygenation

    @property
    def pipeline(self) -> str:
        """Color pipeline that the LUTs were made with."""
        return self.manifest["recipe"]["pipeline"]

    @cached_property
    def totals(self) -> PathTable:
        """The path table with its rings joined."""
        return self.paths.totals()

    @cached_property
    def weights(self) -> np.ndarray:
        """ACEScg weight of each traced wavelength [K, 3]."""
        return expansion.rgb_weights(np.array(self.manifest["quadrature"]["xyz_weights"], float))

    @cached_property
    def absorbers(self) -> expansion.Absorbers:
        """What absorbs besides the chromophores of the axes."""
        extra = {layer: np.array(v, float) for layer, v in self.manifest["extra_absorbers_per_mm"].items()}
        return expansion.absorbers(self.paths.wavelength_nm, self.oxygenation, extra)

    def color(self, melanin, eumelanin, hemoglobin, space: str = "srgb") -> np.ndarray:
        """Linear, unclipped diffuse color [..., 3] by trilinear interpolation, in `srgb`, `acescg` or `xyz`.

        Chromophores broadcast; raises InputError outside the LUT's axes.

        >>> import lutgen
        >>> lutgen.load().color(0.0195, 0.7, 0.0088).shape
        (3,)
        """
        one_of("space", space, color.SPACES)
        melanin, eumelanin, hemoglobin = self._inside(self.color_lut.grid, melanin, eumelanin, hemoglobin)
        acescg = self.color_lut.grid.interpolate(self.color_lut.acescg, melanin, eumelanin, hemoglobin)
        return color.from_acescg(acescg, space, self.pipeline)

    def color_std_error(self, melanin, eumelanin, hemoglobin) -> np.ndarray:
        """Monte Carlo standard error of the ACEScg color [P, 3] of skins [P]; 0 where totals are anchored.

        >>> import lutgen
        >>> bool((lutgen.load().color_std_error(0.02, 0.7, 0.01) < 1e-3).all())
        True
        """
        skins = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in (melanin, eumelanin, hemoglobin)))
        if self.manifest["recipe"]["totals"] == "anchored":
            return np.zeros((len(skins[0]), 3))
        mu = expansion.coefficients(self.paths.wavelength_nm, self.absorbers, *skins)
        return np.sqrt(np.einsum("kp,kc->pc", self.totals.std_error(*mu)[:, 0] ** 2, self.weights**2))

    def profile(self, melanin, eumelanin, hemoglobin, space: str = "acescg") -> Profile:
        """Diffuse profile of one skin: energy [B, 3] sums to `color`; its shape is interpolated between nodes.

        In `srgb` far rings of red skin light can be negative. Raises InputError outside the LUT's axes.

        >>> import lutgen
        >>> lutgen.load().profile(0.0195, 0.7, 0.0088).energy.shape
        (64, 3)
        """
        one_of("space", space, color.SPACES)
        skin = tuple(
            in_range(name, v, 0, 1)
            for name, v in zip(chromophores.NAMES, (melanin, eumelanin, hemoglobin), strict=True)
        )
        self._inside(self.profile_lut.grid, *skin)
        shape = self.profile_lut.grid.interpolate(self.profile_lut.shape, *skin)
        energy = shape * self.color(*skin, space="acescg")
        columns = [np.array([v]) for v in skin]
        mu = expansion.coefficients(self.paths.wavelength_nm, self.absorbers, *columns)
        sigma = self.paths.std_error(*mu)[:, :, 0]
        to_space = color.from_acescg(np.eye(3), space, self.pipeline)
        std_error = np.sqrt((sigma**2).T @ (self.weights @ to_space) ** 2)
        return Profile(self.paths.radius_edges_mm, energy @ to_space, std_error)

    def expand(
        self, oxygenation: float | None = None, extra_absorbers: expansion.ExtraAbsorbers | None = None
    ) -> LutSet:
        """The same set at another oxygenation, or with more absorbers (layer -> 1/mm), from the stored paths.

        `extra_absorbers` maps "epidermis" or "dermis" to a number, an array per traced wavelength, or a function of
        the wavelengths in nm; it replaces what an earlier expansion added. No trace; raises InputError where the
        stored paths do not reach.

        >>> import lutgen
        >>> blue = lutgen.load().expand(oxygenation=0.3)
        >>> blue.oxygenation
        0.3
        """
        oxygenation = self.oxygenation if oxygenation is None else in_range("oxygenation", oxygenation, 0, 1)
        nm = self.paths.wavelength_nm
        kept = self.manifest["extra_absorbers_per_mm"] if extra_absorbers is None else extra_absorbers
        absorb = expansion.absorbers(nm, oxygenation, kept)
        grid = self.profile_lut.grid
        cells = expansion.color_cells(self.totals, self.color_lut.grid, absorb, self.weights)
        shape, clamped = expansion.profile_cells(self.paths, grid, absorb, self.weights)
        recipe = dict(self.manifest["recipe"])
        recipe["skin"] = dict(recipe["skin"], oxygenation=oxygenation)
        extra = {name: getattr(absorb, name).tolist() for name in ("epidermis", "dermis")}
        manifest = {key: value for key, value in self.manifest.items() if key not in _OF_ITS_BAKE} | {
            "recipe": recipe, "extra_absorbers_per_mm": extra, "largest_clamped_share": float(clamped.max()),
            "error": None, "files": {},
        }  # fmt: skip
        return replace(
            self,
            color_lut=ColorLut(self.color_lut.grid, cells),
            profile_lut=ProfileLut(grid, self.paths.radius_edges_mm, shape, clamped),
            manifest=manifest,
        )

    def recolor(self, albedo_rgb, base, target, space: str = "srgb") -> np.ndarray:
        """albedo x color(target) / color(base): a painted albedo [..., 3], linear, moved to another skin, detail kept.

        `base` and `target` are (melanin, eumelanin, hemoglobin), or Skins whose other fields are the set's own.

        >>> import lutgen
        >>> luts = lutgen.load()
        >>> albedo = luts.color(0.02, 0.7, 0.01)
        >>> bool(np.allclose(luts.recolor(albedo, (0.02, 0.7, 0.01), (0.1, 0.7, 0.01)), luts.color(0.1, 0.7, 0.01)))
        True
        """
        albedo = numbers("albedo_rgb", albedo_rgb)
        if albedo.shape[-1:] != (3,):
            raise InputError(f"albedo_rgb has shape {albedo.shape}: the last axis must hold R, G, B")
        before, after = (self.color(*self.chromophores(skin), space=space) for skin in (base, target))
        return albedo * (after / before)

    def chromophores(self, skin) -> tuple:
        """Melanin, eumelanin and hemoglobin of three such numbers, or of a Skin; InputError where its other fields are
        not the set's own.

        >>> import lutgen
        >>> lutgen.load().chromophores(lutgen.preset("dark"))
        (0.158, 0.7, 0.018)
        """
        if isinstance(skin, Skin):
            for name, value in vars(self.tissue).items():
                if getattr(skin, name) != value:
                    advice = "expand the set to it first" if name == "oxygenation" else "bake a set with it first"
                    raise InputError(f"{name} = {getattr(skin, name)}: these LUTs hold {value}; {advice}")
            return astuple(skin.chromophores)
        if not isinstance(skin, (tuple, list, np.ndarray)) or len(skin) != 3:
            raise InputError(f"skin = {shown(skin)}: a Skin or (melanin, eumelanin, hemoglobin) is needed")
        return tuple(skin)

    def _inside(self, grid: Grid, melanin, eumelanin, hemoglobin) -> tuple[np.ndarray, ...]:
        """The chromophores as arrays; InputError where they leave the axes or do not broadcast."""
        named = zip(chromophores.NAMES, (melanin, eumelanin, hemoglobin), strict=True)
        arrays = [numbers(name, values) for name, values in named]
        for axis, values in zip(grid.axes[::-1], arrays, strict=True):
            slack = 1e-9 * max(abs(axis.high), 1e-9)
            wrong = ~((values >= axis.low - slack) & (values <= axis.high + slack))
            if wrong.any():
                raise InputError(
                    f"{axis.name} = {values[wrong].ravel()[0]:g}: these LUTs cover {axis.low:g} to {axis.high:g}"
                )
        try:
            np.broadcast_shapes(*(values.shape for values in arrays))
        except ValueError:
            shapes = ", ".join(str(values.shape) for values in arrays)
            raise InputError(f"{', '.join(chromophores.NAMES)} have shapes {shapes}: they must broadcast") from None
        return tuple(arrays)


_OF_ITS_BAKE = ("seconds", "baked_at", "host")
