"""Skin color by scattering law, by preset, and at the parameters that other papers print."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path

from lutgen import color
from lutgen.charts import drawing
from lutgen.charts.document.spectra import columns, nanometers, numbers, percent, shades, spectra, sweep, ticks
from lutgen.charts.drawing import DASHES, GRAY, HUES, inches, write
from lutgen.skin import chromophores
from lutgen.skin.tissue import LAWS, PRESETS, Skin, Tissue, plain, reduced_scattering

TYPES = ("Caucasian", "Asian", "African")
DONNER_JENSEN = {"Caucasian": (0.005, 0.7, 0.005), "Asian": (0.15, 0.0, 0.01), "African": (0.5, 0.7, 0.05)}
"""Melanin, eumelanin ratio and hemoglobin of three skins (Donner & Jensen 2006, caption of the SIGGRAPH sketch)."""
SOURCES = (
    ("Donner & Jensen 2006", "found", "melanin, eumelanin ratio and hemoglobin: caption of the figure in A Spectral "
     "Shading Model for Human Skin (SIGGRAPH 2006 sketch by the same authors); the same numbers stand in "
     "scenes/skin.pbrt of github.com/damlaren/pbrt-skin-bssrdf."),
    ("Donner & Jensen 2006", "second hand", "epidermis 0.25 mm, dermis that scatters half as much, oxygenation 0.75: "
     "from that public code, not from the paper."),
    ("Donner & Jensen 2006", "not found", "the text of A Spectral BSSRDF for Shading Human Skin (EGSR 2006), and "
     "their colors as numbers: the sketch shows renderings and photographs."),
    ("Petrov et al. 2012", "not found", "parameters of the skin model (Biomed. Opt. Express 3, 2154): its tables are "
     "in no text we could search. It measures transmission at 650 to 950 nm, not the reflectance shown here."),
)  # fmt: skip
"""Published parameter sets: where each number comes from, and what could not be found."""
_COLUMNS = {
    "document": "the document's parameters,\nthe document's model",
    "printed": "Donner & Jensen's parameters,\nthe document's model",
    "as coded": "their parameters, their layers as\ncoded: epidermis 0.25 mm, dermis\nscatters half, oxygenation 0.75",
}


def told(skin: Skin, between: str = "\n") -> str:
    """A skin's chromophores in words."""
    return between.join(f"{name} {percent(getattr(skin, name), name)}" for name in chromophores.NAMES)


def dress_spectra(axes) -> None:
    """Axes for spectra of skin, from the darkest to the lightest."""
    axes.set(yscale="log", xlim=(380, 780), ylim=(0.002, 1), xlabel="wavelength (nm)", ylabel="diffuse reflectance")
    axes.set_yticks([0.002, 0.01, 0.1, 1], ["0.2 %", "1 %", "10 %", "100 %"])
    axes.grid(axis="y")


def law_curves(folder: Path) -> str:
    """Reduced scattering over wavelength, by law."""
    nm = nanometers()
    curves = {law: reduced_scattering(Tissue(scattering=law), nm) for law in LAWS[:-1]}
    notes = (
        "`source` is the document's, exactly twice `bashkatov`.\n"
        "`donner` is `source` in the epidermis and half of it in the dermis."
    )
    rows = [
        {"wavelength_nm": float(w)} | {f"{law}_per_mm": float(y[i]) for law, y in curves.items()}
        for i, w in enumerate(nm)
    ]
    title = "Reduced scattering of skin, by law"
    with drawing.figure(folder, "scattering-curves", rows, (8.4, 5.2), title, notes) as drawn:
        axes = inches(drawn, 0.9, 1.15, 5.0, 3.4)
        for (_, y), hue, dash in zip(curves.items(), HUES, DASHES, strict=False):
            axes.plot(nm, y, color=hue, linestyle=dash)
        axes.set(xlim=(380, 780), ylim=(0, 16), xlabel="wavelength (nm)", ylabel="reduced scattering μs' (1/mm)")
        axes.grid(axis="y")
        also = {"source": "source\n(donner: epidermis)", "bashkatov": "bashkatov\n(donner: dermis)"}
        ends = [(float(y[-1]), also.get(law, law), hue) for (law, y), hue in zip(curves.items(), HUES, strict=False)]
        drawing.label_ends(axes, 780, ends, 1.6)
    return ", ".join(f"{law} {y[34]:.2f}" for law, y in curves.items()) + " per mm at 550 nm"


def law_colors(folder: Path, steps: int) -> str:
    """The document's melanin sweep at two hemoglobins, by scattering law."""
    rows, worst = [], {}
    notes = (
        "Exact spectra, default color pipeline. Beside each strip: ΔE00 to `source`, the document's law, at its ends."
    )
    title = "Skin color by scattering law: melanin 1.3 % to 43 %, eumelanin 0.7"
    with drawing.figure(folder, "scattering-colors", rows, (9.2, 6.3), title, notes) as drawn:
        for i, hemoglobin in enumerate((0.005, 0.05)):
            skins = [replace(skin, hemoglobin=hemoglobin) for skin in sweep("melanin", steps)]
            write(drawn, 1.2, 0.98 + 2.45 * i, f"hemoglobin {100 * hemoglobin:g} %", color=GRAY)
            source = shades(spectra(skins))[1]
            for j, law in enumerate(LAWS):
                ruled = [replace(skin, scattering=law) for skin in skins]
                reflectance = spectra(ruled)
                rgb, lab = shades(reflectance)
                off = color.delta_e00(lab, source)
                worst[law] = max(worst.get(law, 0.0), float(off.max()))
                axes = inches(drawn, 1.2, 1.05 + 2.45 * i + 0.4 * j, 6.4, 0.4)
                drawing.strip(axes, rgb, law)
                if law == LAWS[-1]:
                    axes.set_axis_on()
                    axes.spines[:].set_visible(False)
                    axes.set_yticks([])
                    axes.set_xticks(*ticks("melanin", steps))
                    axes.set_xlabel("melanin (volume fraction of the epidermis)" if i else "")
                words = "reference" if law == "source" else f"{off[0]:.1f} to {off[-1]:.1f}"
                axes.text(1.015, 0.5, words, transform=axes.transAxes, va="center", color=GRAY)
                rows += [{**plain(s), **numbers(r, ("default",)), "delta_e00_to_source": float(d)}
                         for s, r, d in zip(ruled, reflectance, off, strict=True)]  # fmt: skip
    return "ΔE00 to source at most " + ", ".join(f"{law} {d:.1f}" for law, d in worst.items() if law != "source")


def presets(folder: Path) -> str:
    """The presets on the axis of lightness, and their spectra."""
    reflectance = dict(zip(PRESETS, spectra(list(PRESETS.values())), strict=True))
    looks = {name: shades(r) for name, r in reflectance.items()}
    groups = [[n for n in PRESETS if n.startswith("source-") == own] for own in (False, True)]
    notes = (
        "Two parameters of each fitted to the mean spectrum of an ITA class (after Lu et al. 2025, ISSA archive). "
        "Default color pipeline;\nm, e, h: melanin, eumelanin, hemoglobin."
    )
    rows = [{"preset": n, **plain(PRESETS[n]), **numbers(r), **columns(r)} for n, r in reflectance.items()]
    title = "Presets fitted to measured skin, and the document's three"
    with drawing.figure(folder, "presets", rows, (12.4, 6.4), title, notes) as drawn:
        axes, curves = inches(drawn, 0.75, 1.25, 5.7, 4.5), inches(drawn, 7.2, 1.25, 3.5, 4.5)
        labels = []
        for k, names in enumerate(groups):
            x = 2.9 * k
            axes.text(x, 1.0, ("fitted to measured skin", "the document's")[k], color=HUES[k],
                      transform=axes.get_xaxis_transform(), va="bottom")  # fmt: skip
            for name, y in zip(names, drawing.apart([looks[n][1][0] for n in names], 6.4), strict=True):
                (rgb, lab), skin = looks[name], PRESETS[name]
                axes.fill([x, x + 0.75, x + 0.75, x], [y - 2.9, y - 2.9, y + 2.9, y + 2.9], color=rgb, linewidth=0)
                axes.plot([x - 0.2, x - 0.03], [lab[0], y], color=HUES[k], linewidth=0.9)
                axes.text(x + 0.85, y + 1.2, f"{name.removeprefix('source-')}  L* {lab[0]:.1f}", va="center")
                words = f"m {percent(skin.melanin)}  e {skin.eumelanin:g}  h {percent(skin.hemoglobin)}"
                axes.text(x + 0.85, y - 1.6, words, va="center", color=GRAY, size=8.5)
                curves.plot(nanometers(), reflectance[name], color=HUES[k], linestyle=DASHES[k])
                labels.append((float(reflectance[name][-1]), name, HUES[k]))
        axes.set(xlim=(-0.2, 5.6), ylim=(5, 78), ylabel="lightness L*", xticks=[])
        axes.spines["bottom"].set_visible(False)
        dress_spectra(curves)
        drawing.label_ends(curves, 780, labels, 0.115)
    return "L* " + ", ".join(f"{name} {lab[0]:.1f}" for name, (_, lab) in looks.items())


def published(folder: Path) -> str:
    """The document's three skin types beside Donner & Jensen's of the same names; what no text prints is said."""
    rows, off = [], {}
    notes = "Exact colors of this model at the printed parameters, not their pictures; default color pipeline."
    title = "The document's skin types beside Donner & Jensen's of the same names"
    with drawing.figure(folder, "published", rows, (10.4, 7.6), title, notes) as drawn:
        for i, name in enumerate(TYPES):
            document, printed = PRESETS[f"source-{name.lower()}"], Skin(*DONNER_JENSEN[name])
            as_coded = replace(printed, scattering="donner", epidermis_mm=0.25, oxygenation=0.75)
            shown = {"document": document, "printed": printed, "as coded": as_coded}
            write(drawn, 0.2, 1.85 + 1.5 * i, name, size=11, va="center")
            reference = shades(spectra([document]))[1][0]
            for j, (kind, skin) in enumerate(shown.items()):
                left, top = 1.35 + 3.05 * j, 1.4 + 1.5 * i
                if not i:
                    write(drawn, left, 1.3, _COLUMNS[kind], color=GRAY)
                reflectance = spectra([skin])[0]
                rgb, lab = shades(reflectance)
                off[name, kind] = float(color.delta_e00(lab, reference))
                drawing.strip(inches(drawn, left, top, 1.35, 1.25), rgb[None])
                words = f"{told(skin)}\nL* {lab[0]:.1f}" + (f"   ΔE00 {off[name, kind]:.1f}" if j else "")
                write(drawn, left + 1.42, top, words, va="top", size=8.5, linespacing=1.5)
                rows.append({"skin": name, "parameters": kind, **plain(skin), "delta_e00_to_document": off[name, kind],
                             **numbers(reflectance)})  # fmt: skip
        said = (f"{whose}, {status}: {where}" for whose, status, where in SOURCES)
        words = "\n".join(textwrap.fill(source, 150, subsequent_indent="    ") for source in said)
        write(drawn, 0.2, 6.0, words, va="top", size=8.5, color=GRAY, linespacing=1.4)
        rows += [dict(zip(("published", "status", "where"), source, strict=True)) for source in SOURCES]
    return (
        "the document to Donner & Jensen's parameters ΔE00 "
        + ", ".join(f"{name} {off[name, 'printed']:.1f}" for name in TYPES)
        + "; Petrov et al. 2012: parameters not found"
    )
