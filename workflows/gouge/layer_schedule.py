"""The schedule of a sheared layer: consolidation under the normal stress, then the stages of its shear."""

from __future__ import annotations

from workflows.gouge.grain_parameters import GrainParams
from workflows.gouge.layer_parameters import LayerParams
from workflows.gouge.layer_scene import LARGEST_SPEED
from workflows.gouge.shear_stages import shear_stages
from workflows.protocol.conditions import Settled
from workflows.protocol.moments import Events, Moments, interval
from workflows.protocol.schedule import Spacing, Stage

SETTLE_TIMES = 300.0  # inertial times d sqrt(rho/P) that consolidation may take after the platen has come down
ROW_TIMES = 2.0  # inertial times between two rows of the consolidation
SETTLING_SAMPLES = 4  # in each of them
CONSOLIDATE = "consolidate"


def layer_schedule(params: LayerParams, dt: float, thickness: float) -> list[Stage]:
    """The stages of one run.

    Parameters
    ----------
    params
        Of the run.
    dt
        Time step [s].
    thickness
        Of the layer before it is consolidated [m]: the platen has to come down by as much at most.
    """
    p = params
    falling = thickness / (LARGEST_SPEED * p.diameter)
    consolidate = Stage(
        CONSOLIDATE,
        until=Settled(p.normal_stress, (SETTLE_TIMES + falling) * p.inertial_time),
        spacing=settling_rows(p, dt),
        snapshots=Moments(events="events" in p.snapshots),
        contacts=settling_contacts(p),
        events=Events(rate=float("inf")),  # only bonds: no platen is as fast
    )
    return [consolidate, *shear_stages(p, dt)]


def settling_rows(params: GrainParams, dt: float) -> Spacing:
    """Rows and samples of a consolidation; dt: time step [s]."""
    steps = int(ROW_TIMES * params.inertial_time / dt)
    return Spacing(SETTLING_SAMPLES * -(-steps // SETTLING_SAMPLES), SETTLING_SAMPLES)


def settling_contacts(params: GrainParams) -> Moments:
    """Moments of contacts.nc in a consolidation: at its end, which is the begin of the shear, and where bonds broke."""
    words = params.contacts
    return Moments(events="events" in words, at_end="stages" in words or interval(words) is not None)
