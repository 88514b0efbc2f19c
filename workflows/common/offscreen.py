"""Whether 3D scenes can be rendered here without a display: tried once, in a process of its own, which may crash."""

from __future__ import annotations

import subprocess
import sys
from functools import cache

PATIENCE_S = 60.0
# A red ball in the middle of a white picture.
TRIAL = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.set_background("white")
plotter.add_mesh(pyvista.Sphere(), color="red", lighting=False)
picture = plotter.screenshot(None, return_img=True)
assert picture[16, 16, 0] > 200 and picture[16, 16, 2] < 50 and picture[0, 0].min() > 200, "the picture is wrong"
"""
REMEDY = "Debian, Ubuntu: apt install libegl1 libgl1-mesa-dri"


@cache
def rendering_problem() -> str | None:
    """Why pyvista does not render without a display, in words; None if it does.

    Without EGL and OSMesa it ends its process by a segmentation fault, so that another one tries it.
    """
    try:
        done = subprocess.run([sys.executable, "-c", TRIAL], capture_output=True, text=True, timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        return f"pyvista renders nothing within {PATIENCE_S:.0f} s without a display; {REMEDY}"
    if done.returncode == 0:
        return None
    last = (done.stderr.strip().splitlines() or [""])[-1]
    if "No module named" in last:
        return "pyvista is not installed; pip install 'taichi-lsm[export]'"
    ended = f"signal {-done.returncode}" if done.returncode < 0 else last
    return f"pyvista cannot render without a display ({ended}); {REMEDY}"
