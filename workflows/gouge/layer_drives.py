"""What the stages of a schedule drive in a sheared layer, by the names that they have for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import taichi_lsm as lsm
from workflows.gouge.layer_parameters import LayerParams
from workflows.gouge.layer_scene import shear_drive

SHEAR_RATE, SHEAR_STRESS = "shear_rate", "shear_stress"
NORMAL_STRESS, NORMAL_STIFFNESS = "normal_stress", "normal_stiffness"


class LayerDrives:
    """The drives of the top platen.

    `shear_rate` is the velocity of the platen, or of the load point that pulls it, over the thickness of the layer as
    shear began [s-1]; `shear_stress` [Pa], once set, pushes the platen until `shear_rate` is set. `normal_stress` is
    that of the servo [Pa], `normal_stiffness` that of the spring behind it over the area [Pa m-1].

    Parameters
    ----------
    params, sim
        Of the run.
    """

    def __init__(self, params: LayerParams, sim: lsm.Simulation) -> None:
        self.params = params
        self.platens: Any = sim.platens  # the attributes depend on the class of the drive

    def value(self, name: str, thickness: float | None) -> float:
        """The value now; thickness: of the layer as shear began [m].

        A velocity that is not driven is that of the platen; a shear stress that is not, that of the drive which keeps
        the velocity, against the contacts: so that ramps begin where the layer is.
        """
        along, normal = self.platens.drives[1][:2]
        if name == SHEAR_RATE:
            return self._velocity(along) / (thickness or 1.0)
        if name == SHEAR_STRESS:
            resistance = -float(self.platens.force.to_numpy()[1, 0]) / self.platens.area
            return resistance if along.stress is None else along.stress
        return normal.stress if name == NORMAL_STRESS else normal.normal_stiffness

    def _velocity(self, along: Any) -> float:
        """Velocity of what drives the platen, under a shear stress of the platen itself [m s-1]."""
        if along.velocity is not None:
            return along.velocity
        return float(self.platens.snapshot()["velocity"][1, 0])

    def set(self, name: str, value: float, thickness: float | None) -> None:
        """Set a value from now on."""
        p, (along, normal) = self.params, self.platens.drives[1][:2]
        if name in (NORMAL_STRESS, NORMAL_STIFFNESS):
            changed = {"stress": value} if name == NORMAL_STRESS else {"normal_stiffness": value}
            self.platens.set("top", 1, replace(normal, **changed))
            return
        if name == SHEAR_STRESS:
            self.platens.set("top", 0, lsm.VelocityOrStress(normal.inertia, stress=value))
            return
        velocity, usual = (rate * (thickness or 1.0) for rate in (value, p.inertial_number / p.inertial_time))
        # At least as fast as a layer is brought to its usual velocity: the many small changes of a ramp are followed.
        change = max(abs(velocity - self._velocity(along)), usual)
        self.platens.set("top", 0, shear_drive(p, velocity, normal.inertia, change))
