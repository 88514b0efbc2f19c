"""The table "effect, shape, dimension" of docs/effects.md: `python -m benchmarks.effect_shapes` writes it.

Nothing in it is declared: every cell is a scene, which either accepts the effect or refuses it with a reason
(`workflows/cli/effect_shapes.py`).
"""

from pathlib import Path

import taichi_lsm as lsm
from benchmarks import page
from workflows.cli.effect_shapes import refusals, shapes_of, variants

PAGE = Path(__file__).parent.parent / "docs" / "effects.md"
NAME = "effect_shapes"


def table() -> str:
    """Rows of effects and their variants by kind of shape in 2D and 3D, with the reasons of refusals below."""
    kinds = {dim: list(shapes_of(dim)) for dim in (2, 3)}
    heading = [f"{kind}, {dim}D" for dim, names in kinds.items() for kind in names]
    lines, reasons = page.head("effect", *heading), []
    for name, cls in lsm.effects.find_effects().items():
        for variant, cases in variants(cls):
            cells = []
            for why in [why for dim in kinds for why in refusals(cases, dim).values()]:
                if why and why not in reasons:
                    reasons.append(why)
                cells.append(f"refused ({reasons.index(why) + 1})" if why else "works")
            lines.append(page.row(f"`{name}`" + (f", {variant}" if variant else ""), *cells))
    notes = [f"{number}. {why}" for number, why in enumerate(reasons, start=1)]
    return "\n".join([*lines, "", *notes])


def main() -> None:
    """Write the table into the page."""
    print(f"{PAGE}: {page.write(PAGE, {NAME: table()})}")


if __name__ == "__main__":
    main()
