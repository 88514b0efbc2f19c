"""Floating-point operations of a contact, counted in the code that Taichi generates: `python -m benchmarks.flops`.

A process of its own compiles the contacts of a declared scene with blocks of one pair, and writes the LLVM code before
it is optimised. Every loop occurs in it once, so that the additions, multiplications, divisions and roots of the kernel
are those of one listed pair that touches: geometry, kinematics, effects, sums.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from benchmarks import page
from benchmarks.ours import ROOT

TAGS = ("S2_1000", "S3_1000")
OPERATIONS = {"fadd": "additions", "fsub": "additions", "fmul": "multiplications", "fdiv": "divisions"}


def serve(tag: str) -> None:
    """Compile the contacts of the scene; Taichi writes its code to the current folder."""
    from benchmarks import scenes
    from taichi_lsm.contact import contact_block as block

    block.WIDTH = 1
    import taichi_lsm as lsm
    from taichi_lsm.measure.profiling import StageTimer

    sim = lsm.Simulation(scenes.declared(tag, parallel=False)[0])
    StageTimer(sim).contacts(1)


def count(text: str) -> Counter[str]:
    """Number of floating-point operations of each kind in the text of an LLVM module."""
    found: Counter[str] = Counter()
    for operation in re.findall(r"= (fadd|fsub|fmul|fdiv) ", text):
        found[OPERATIONS[operation]] += 1
    found["roots"] = len(re.findall(r"call [^@]*@llvm\.sqrt", text))
    return found


def operations(tag: str) -> Counter[str]:
    """Apply `count` to the kernel that evaluates the contacts of a scene."""
    options = {"TI_PRINT_KERNEL_LLVM_IR": "1", "TI_OFFLINE_CACHE": "0", "PYTHONPATH": str(ROOT)}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "benchmarks.flops", "--serve", tag]
        subprocess.run(command, cwd=folder, env=os.environ | options, check=True, capture_output=True)
        texts = [path.read_text(encoding="utf-8", errors="replace") for path in Path(folder).glob("*.ll")]
    ours = [text for text in texts if re.search(r"define [^@]*@contacts_", text)]
    if len(ours) != 1:
        raise RuntimeError(f"{len(ours)} of {len(texts)} modules hold the contacts: must be one")
    return count(ours[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--serve", choices=TAGS, help="compile one scene in this process")
    args = parser.parse_args()
    if args.serve:
        serve(args.serve)
        return
    names = ("additions", "multiplications", "divisions", "roots")
    print("\n".join(page.head("scene", *names, "together")))
    for tag in TAGS:
        found = operations(tag)
        print(page.row(tag, *(found[name] for name in names), sum(found.values())))


if __name__ == "__main__":
    main()
