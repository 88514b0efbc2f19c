"""Measured metrics beside the bounds that are claimed of them."""

from typing import Any

from benchmarks import page


def metric(value: float, unit: str, most: float) -> dict[str, Any]:
    """Form of a metric in results.json: value in `unit`, the bound it should not exceed, whether that holds."""
    return {"value": value, "unit": unit, "bound": most, "holds": bool(value <= most)}


def table(metrics: dict[str, dict[str, Any]]) -> str:
    """Markdown table of metrics {name: metric}."""
    lines = page.head("metric", "value", "unit", "at most", "holds")
    for name, m in metrics.items():
        lines.append(page.row(name, f"{m['value']:.3g}", m["unit"], f"{m['bound']:g}", "yes" if m["holds"] else "NO"))
    return "\n".join(lines)
