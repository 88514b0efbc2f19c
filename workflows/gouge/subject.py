"""What is sheared in a run, and what a run asks of it: here a layer between platens; a cell without walls is another.

Stages: generate (grains that do not touch, between two platens of glued grains), consolidate (the servo presses the top
platen down to the normal stress), then those of the shear, which each experiment gives.
"""

from __future__ import annotations

from typing import Any

import taichi_lsm as lsm
from workflows.common.reports import Progress
from workflows.gouge.labels import grain_words
from workflows.gouge.layer_drives import LayerDrives
from workflows.gouge.layer_scene import build
from workflows.gouge.layer_schedule import layer_schedule
from workflows.protocol.run_loop import Drives
from workflows.protocol.schedule import Stage


class Subject:
    """A layer of gouge between two platens. Its parameters are those of the experiment that shears it.

    Attributes
    ----------
    normal_stress
        Name in a row of the normal stress that the servo keeps, mean over all steps.
    """

    normal_stress = "platen_normal_stress"

    def build(self, params: Any, progress: Progress | None) -> lsm.Scene:
        """The scene before consolidation."""
        return build(params, progress)

    def measured(self, sim: lsm.Simulation, params: Any) -> Any:
        """What measures it."""
        return lsm.ShearedLayer(sim, params.normal_stress, params.diameter)

    def schedule(self, params: Any, dt: float, thickness: float) -> list[Stage]:
        """The stages of one run, for a time step [s] and the thickness [m] before the consolidation."""
        return layer_schedule(params, dt, thickness)

    def drives(self, params: Any, sim: lsm.Simulation) -> Drives:
        """What its stages drive."""
        return LayerDrives(params, sim)

    def title(self, scene: lsm.Scene) -> str:
        """Title of the files of a run."""
        return f"Shear of a layer of {grain_words(scene)} in {scene.dim}D"

    def summary(self, params: Any, sim: lsm.Simulation) -> str:
        """What happened in a run, in a sentence."""
        pulled = isinstance(sim.platens.drives[1][0], lsm.SpringLoadPoint)
        drive = "by a load point on a spring" if pulled else "in stages" if params.staged else "at constant velocity"
        drive += ", with a spring behind the servo" * bool(params.normal_stiffness)
        return f"Generated {params.start}, consolidated under servo-controlled normal stress, sheared {drive}."


LAYER = Subject()
