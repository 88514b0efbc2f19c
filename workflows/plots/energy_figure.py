"""The picture of the energy-conservation experiment: Figure 4 of the paper, error, and drift against the step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflows.common.run_table import Rows

NAMES = {
    "onset_verlet": "Verlet with onset correction",
    "velocity_verlet": "velocity Verlet",
    "symplectic_euler": "symplectic Euler",
    "explicit_euler": "explicit Euler, as printed",
    "cones": "cones that tile",
    "cones_that_miss_seams": "cones that miss seams",
}
COLOURS = {
    "onset_verlet": "#0072b2",
    "velocity_verlet": "#e69f00",
    "symplectic_euler": "#009e73",
    "explicit_euler": "#cc79a7",
    "cones": "#56b4e9",
    "cones_that_miss_seams": "#d55e00",
}
AT_50 = "Error at 50 steps per contact"
LEAST = 1e-9  # error that is drawn; smaller ones are drawn as that, since a logarithm has no place for 0
WITH_SHADOW = ("onset_verlet", "velocity_verlet")
TERMS = ("translational_energy", "rotational_energy", "elastic_energy")


def plot_energy(path: Path, rows: Rows, series: dict[str, Any], published: float) -> None:
    """Draw energy.png. rows, series: of `energy_conservation.measure`; published: drift of the paper [1]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 5), layout="constrained")
    FigureCanvasAgg(figure)
    energy, error, against = figure.subplots(1, 3)
    first = series["onset_verlet"]
    total = np.sum([first[n] for n in TERMS], axis=0)
    ms = 1e3 * first["time"]
    for name, style in zip(TERMS, ("-", "--", ":"), strict=True):
        energy.plot(ms, first[name] / total[0], style, label=name.split("_")[0], color="black")
    energy.plot(ms, total / total[0], label="total", color=COLOURS["onset_verlet"], lw=2)
    energy.set(
        xlabel="time [ms]",
        ylabel="energy over initial energy [1]",
        ylim=(0, 1.05 * max(1.0, np.nanmax(total / total[0]))),
        title="Energies (paper: Fig. 4)",
    )
    energy.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=4, fontsize=8, frameon=False)

    at_border = False
    for scheme, run in series.items():
        total = np.sum([run[n] for n in TERMS], axis=0)
        miss = np.maximum(np.abs(total / total[0] - 1.0), LEAST)
        at_border |= bool(np.any(miss[1:] == LEAST))
        error.semilogy(1e3 * run["time"][1:], miss[1:], color=COLOURS[scheme], lw=1, label=NAMES[scheme])
    error.axhline(published, color="grey", ls="--", lw=1)
    error.text(ms[-1], published * 1.15, "Abe & Mora (2003)", color="grey", ha="right", va="bottom", fontsize=9)
    smaller = f"\n({LEAST:g}: that or less)" if at_border else ""
    error.set(xlabel="time [ms]", ylabel=f"relative error of the energy [1]{smaller}", title=AT_50)
    error.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)

    for scheme in COLOURS:
        for name, style in (("drift", "o-"), ("shadow_drift", "s:")):
            own = [r for r in rows if r["scheme"] == scheme and r["purpose"] in ("order", "plateau")]
            own = own or [r for r in rows if r["scheme"] == scheme and r["purpose"] == "drift"]
            levels = sorted({r["steps_per_contact"] for r in own})
            if not levels or (name == "shadow_drift" and scheme not in WITH_SHADOW):
                continue
            mean = [np.sqrt(np.mean([r[name] ** 2 for r in own if r["steps_per_contact"] == n])) for n in levels]
            if not np.isfinite(mean).any():
                continue
            label = NAMES[scheme] + (", shadow energy" if name == "shadow_drift" else "")
            against.loglog(levels, mean, style, color=COLOURS[scheme], label=label, ms=4)
    against.set(xlabel="steps per contact [1]", ylabel="drift, rms over seeds [1]", title="Drift against the step")
    against.set_xticks([50, 100, 200, 400], ["50", "100", "200", "400"])
    against.minorticks_off()
    against.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, frameon=False)
    for axes in (energy, error, against):
        axes.grid(True, which="major", alpha=0.25)
    figure.savefig(path, dpi=130)
