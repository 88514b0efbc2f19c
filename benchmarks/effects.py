"""What each effect costs: `python -m benchmarks.effects [--save]`.

One scene, the spheres of S3_1000, is run with compositions of laws that differ by one law each. Every composition runs
in a process of its own, with steps so short that nothing moves: all evaluate the same contacts, where a scene without
friction would soon be another. All are timed in turn, one thread on the processor. Printed are the time per grain and
step, the fields and the bytes of a grain and of a listed pair, and for every law what it adds to the scene without it.
--save writes data/effect_costs.json, which `lsm list --effects` shows.
"""

import argparse
import json
import platform
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np

import taichi_lsm as lsm
from benchmarks import bounds, page, scenes
from benchmarks.ours import Worker

SAVED = Path(__file__).parent.parent / "data" / "effect_costs.json"
STEPS = 2000  # per turn
K = scenes.NORMAL_STIFFNESS
MODULUS, RATIO = 1e5, 0.25  # of Hertz' elasticity: as stiff as K at a depth of about a hundredth of a grain
ELASTIC = [lsm.LinearElastic(K)]
DAMPED = [*ELASTIC, lsm.ViscousDamping(rate=scenes.DAMPING_RATE)]
COULOMB = lsm.CoulombFriction(scenes.FRICTION, scenes.TANGENTIAL_RATIO * K)
FRICTIONAL = [*DAMPED, COULOMB]
# Composition: (laws, the composition without the law whose cost is asked for).
COMPOSITIONS = {
    "linear_elastic": (ELASTIC, None),
    "viscous_damping": (DAMPED, "linear_elastic"),
    "coulomb_friction": (FRICTIONAL, "viscous_damping"),
    "gravity": ([*FRICTIONAL, lsm.Gravity((0.0, -1e-4, 0.0))], "coulomb_friction"),
    "global_damping": ([*FRICTIONAL, lsm.GlobalDamping(1e-3)], "coulomb_friction"),
    "cohesion": ([*FRICTIONAL, lsm.Cohesion(1e-3 * K, 0.02)], "coulomb_friction"),
    "rolling_resistance": ([*FRICTIONAL, lsm.RollingResistance(0.1, 0.01 * K)], "coulomb_friction"),
    "velocity_weakening_friction": (
        [*DAMPED, lsm.VelocityWeakeningFriction(scenes.FRICTION, 0.3, 1.0, scenes.TANGENTIAL_RATIO * K)],
        "viscous_damping",
    ),
    "rate_and_state_friction": (
        [*DAMPED, lsm.RateAndStateFriction(scenes.FRICTION, 0.01, 0.015, 1e-3, 1.0, scenes.TANGENTIAL_RATIO * K)],
        "viscous_damping",
    ),
    "elastic_brittle_bond": (
        [*FRICTIONAL, lsm.ElasticBrittleBond(K, RATIO, np.inf, 0.8)],  # all that touch are bonded, instead of contacts
        "coulomb_friction",
    ),
    "hertz": ([lsm.Hertz(MODULUS, RATIO)], None),
    "mindlin": ([lsm.Hertz(MODULUS, RATIO), lsm.Mindlin(scenes.FRICTION, MODULUS, RATIO)], "hertz"),
}
FEWER = {"frictionless_over_frictional": 0.65, "discs_over_spheres": 0.5}  # at most
SIZES = (("10000", 1), ("100000", 2))  # grains, threads


def in_turn(tags, turns, threads=1):
    """{tag: (median ns per grain and step, what the worker says of itself)}, the tags timed in turn."""
    with ExitStack() as stack:
        workers = {tag: stack.enter_context(Worker(tag, "f64", threads, True)) for tag in tags}
        taken = {tag: [] for tag in tags}
        for worker in workers.values():
            worker.ask("run 200")
        for _ in range(turns):
            for tag, worker in workers.items():
                steps = max(200, STEPS * 1000 // worker.grains)
                answer = worker.ask(f"run {steps}")
                seconds = answer["cpu_seconds" if threads == 1 else "seconds"]
                taken[tag].append(seconds / (steps * worker.grains) * 1e9)
        sizes = {tag: worker.ask("size") for tag, worker in workers.items()}
    return {tag: (median(taken[tag]), sizes[tag]) for tag in tags}


def costs(turns):
    """{composition: ns, fields and bytes of the scene, and what its last law adds to them}."""
    found = in_turn([f"S3_1000:{name}" for name in COMPOSITIONS], turns)
    result = {}
    for name, (_, without) in COMPOSITIONS.items():
        ns, size = found[f"S3_1000:{name}"]
        base_ns, base = found[f"S3_1000:{without}"] if without else (0.0, dict.fromkeys(size, 0))
        added = {key: size[key] - base[key] for key in ("fields", "bytes_per_grain", "bytes_per_pair")}
        result[name] = {"ns": ns, **size, "added_ns": ns - base_ns} | {f"added_{k}": v for k, v in added.items()}
    return result


def machine():
    """Name of the processor, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="ascii", errors="replace").splitlines() if info.is_file() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"


def table(found):
    """Markdown table of `costs`."""
    lines = page.head(
        "effect", "ns per grain and step", "fields", "bytes per grain", "per pair", "adds ns", "adds bytes"
    )
    for name, row in found.items():
        bytes_added = f"{row['added_bytes_per_grain']} + {row['added_bytes_per_pair']}"
        numbers = (row["fields"], row["bytes_per_grain"], row["bytes_per_pair"])
        lines.append(page.row(name, f"{row['ns']:.1f}", *numbers, f"{row['added_ns']:.1f}", bytes_added))
    return "\n".join(lines)


def ratios(turns, sizes):
    """Figures with bounds: what leaving effects out gains, in scenes of `sizes` (grains, threads)."""
    metrics = {}
    for grains, threads in sizes:
        tags = [f"S3_{grains}:linear_elastic", f"S2_{grains}:coulomb_friction", f"S3_{grains}:coulomb_friction"]
        *cheap, expensive = (ns for ns, _ in in_turn(tags, turns, threads).values())
        for (name, most), ns in zip(FEWER.items(), cheap, strict=True):
            metrics[f"{name}_{grains}_{threads}t"] = bounds.figure(ns / expensive, "1", most)
    return metrics


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--turns", type=int, default=5, help="timed turns; medians are printed")
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name}")
    args = parser.parse_args()
    found = costs(args.turns)
    print(table(found))
    if args.save:
        effects = {name: {k: row[k] for k in row if k.startswith("added")} for name, row in found.items()}
        about = {"scene": "S3_1000, double precision, one thread", "machine": machine()}
        SAVED.write_text(json.dumps({"about": about, "effects": effects}, indent=1) + "\n", encoding="ascii")
    print(f"\n{bounds.table(ratios(args.turns, SIZES))}")


if __name__ == "__main__":
    main()
