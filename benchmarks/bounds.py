"""Measured figures beside the bounds that are claimed of them."""

from benchmarks import page


def figure(value, unit, most):
    """The form of a figure in results.json: value in `unit`, the bound that it should not exceed, whether it holds."""
    return {"value": value, "unit": unit, "bound": most, "holds": bool(value <= most)}


def table(metrics):
    """Markdown table of figures {name: figure}."""
    lines = page.head("figure", "value", "unit", "at most", "holds")
    for name, f in metrics.items():
        lines.append(page.row(name, f"{f['value']:.3g}", f["unit"], f"{f['bound']:g}", "yes" if f["holds"] else "NO"))
    return "\n".join(lines)
