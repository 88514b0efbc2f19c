"""What a scene needs: the facts that decide which fields exist and which lines of a kernel are compiled."""

from dataclasses import dataclass

from ..contact.pair_storage import pair_variables
from ..contact.surface_kinds import kind_of
from ..effects.base import ON_CONTACTS
from .grain_state import grain_variables


@dataclass(frozen=True)
class KernelSpec:
    """Facts of a scene; two scenes of equal make-up share their compiled kernels.

    kind: of the surfaces, sphere | chain | polyhedron | cones; several: grains of several parts; rotates: torques act
    on the grains; oriented: their orientation matters; onset: contacts begin and end with impulses; sheared: the cell
    is in homogeneous shear; books: laws that book dissipated energy; history: numbers that the laws remember of a pair;
    laws: classes and variants; count, bonds, walls: how many there are; integrator: its class; periodic: axes.
    """

    dim: int
    periodic: tuple
    count: int
    kind: str
    multi_part: bool
    rotates: bool
    oriented: bool
    onset: bool
    sheared: bool
    channels: int
    history: int
    effects: tuple
    bonds: int
    walls: int
    integrator: type

    @classmethod
    def of(cls, scene):
        """The make-up of a scene."""
        kind, effects = kind_of(scene.shapes), scene.effects
        shaped, bonded = kind != "sphere", scene.bonds is not None
        return cls(
            dim=scene.dim,
            periodic=tuple(bool(p) for p in scene.periodic),
            count=len(scene.position),
            kind=kind,
            multi_part=max(len(s.parts) for s in scene.shapes) > 1,
            rotates=shaped or bonded or any(e.phase == "tangential" or e.adds_moment for e in effects),
            oriented=shaped or bonded,
            onset=scene.integrator.onset and any(hasattr(type(e), "onset_impulse") for e in effects),
            sheared=bool(scene.shear_rate),
            channels=sum(e.dissipates for e in effects) if scene.track_dissipation else 0,
            history=sum(e.history_size(scene.dim) for e in effects if e.phase in ON_CONTACTS),
            effects=tuple((type(e).__name__, e.variant) for e in effects),
            bonds=len(scene.bonds) if bonded else 0,
            walls=len(scene.walls),
            integrator=scene.integrator,
        )

    @property
    def shaped(self):
        """Have grains more than one patch?"""
        return self.kind != "sphere"

    @property
    def tumbles(self):
        """Is the angular momentum the state, and the spin what follows from it?"""
        return self.shaped and self.dim == 3

    def grain_rows(self):
        """Rows of the grain state."""
        shaped = self.shaped
        return grain_variables(
            self.rotates, self.oriented, shaped, self.channels, self.onset, self.tumbles, self.multi_part, self.sheared
        )

    def pair_rows(self):
        """Rows per slot of the neighbour list."""
        return pair_variables(self.rotates, self.kind, self.history, self.onset, self.multi_part)
