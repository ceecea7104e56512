"""Write the color tables from colour-science: `python -m lutgen.tables.make_color` (extra `color`).

Color matching functions and the D65 spectrum every 5 nm from 380 to 780 nm. The functions derived from CIE 2006 start
at 390 nm; they are 0 below.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np

from lutgen.errors import missing

try:
    import colour
except ImportError as error:
    raise missing("the color tables need colour-science", "color") from error

WAVELENGTH_NM = np.arange(380, 781, 5)
OBSERVERS = {
    "cie_1931": "CIE 1931 2 Degree Standard Observer",
    "cie_2015": "CIE 2015 2 Degree Standard Observer",
}


def columns() -> dict[str, np.ndarray]:
    """The table's columns by name, each with one value per wavelength."""
    table = {"wavelength_nm": WAVELENGTH_NM.astype(float)}
    for name, observer in OBSERVERS.items():
        functions = colour.MSDS_CMFS[observer]
        for axis, column in zip("xyz", functions.values.T, strict=True):
            table[f"{name}_{axis}"] = np.interp(WAVELENGTH_NM, functions.wavelengths, column, left=0, right=0)
    d65 = colour.SDS_ILLUMINANTS["D65"]
    table["d65"] = np.interp(WAVELENGTH_NM, d65.wavelengths, d65.values)
    return table


def main() -> None:
    """Write lutgen/color_tables.csv, which lutgen/color.py reads."""
    table = columns()
    lines = [
        f"# CIE 1931 and CIE 2015 2 degree color matching functions, CIE D65; from colour-science {colour.__version__}",
        ",".join(table),
        *(",".join(f"{value:.9g}" for value in row) for row in zip(*table.values(), strict=True)),
    ]
    Path(str(files("lutgen") / "color_tables.csv")).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
