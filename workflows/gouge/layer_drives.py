"""What the stages of a schedule drive in a sheared layer, by the names that they have for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import taichi_lsm as lsm
from workflows.gouge.layer_parameters import LayerParams
from workflows.gouge.layer_scene import shear_drive

SHEAR_RATE, NORMAL_STRESS = "shear_rate", "normal_stress"


class LayerDrives:
    """The drives of the top platen.

    `shear_rate` is the velocity of the platen, or of the load point that pulls it, over the thickness of the layer as
    shear began [s-1]; `normal_stress` is that of the servo [Pa].

    Parameters
    ----------
    params, sim
        Of the run.
    """

    def __init__(self, params: LayerParams, sim: lsm.Simulation) -> None:
        self.params = params
        self.platens: Any = sim.platens  # the attributes depend on the class of the drive

    def value(self, name: str, thickness: float | None) -> float:
        """The value now; thickness: of the layer as shear began [m]."""
        along, normal = self.platens.drives[1][:2]
        return along.velocity / (thickness or 1.0) if name == SHEAR_RATE else normal.stress

    def set(self, name: str, value: float, thickness: float | None) -> None:
        """Set a value from now on."""
        p, (along, normal) = self.params, self.platens.drives[1][:2]
        if name == NORMAL_STRESS:
            self.platens.set("top", 1, replace(normal, stress=value))
            return
        velocity, usual = (rate * (thickness or 1.0) for rate in (value, p.inertial_number / p.inertial_time))
        # At least as fast as a layer is brought to its usual velocity: the many small changes of a ramp are followed.
        change = max(abs(velocity - along.velocity), usual)
        self.platens.set("top", 0, shear_drive(p, velocity, normal.inertia, change))
