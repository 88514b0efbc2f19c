"""What a scene needs: the facts that decide which fields exist and which lines of a kernel are compiled."""

from dataclasses import dataclass
from typing import Any

from ..contact.surface_kinds import kind_of
from ..effects.base import ON_CONTACTS
from .effect_set import energy_channels


@dataclass(frozen=True)
class KernelSpec:
    """Facts of a scene, handed down to everything that allocates fields or compiles kernels.

    A kernel asks for a fact by its name (`ti.static(spec.rotates)`); nothing is inferred from which fields happen to
    exist. Two scenes of equal KernelSpec share their compiled kernels, and `Simulation.reset` loads one into the
    simulation of the other under three more conditions: there are no platens, plane walls have the same names, and the
    table of shapes fits into that of the scene that was compiled. Whether threads are shared (`Scene.parallel`) stays
    as it was.

    Attributes
    ----------
    dim, periodic, count : space dimension, periodic axes, number of grains
    kind : surfaces of the grains, sphere | chain | polyhedron | cones
    multi_part : some grain has several convex parts
    rotates : torques act on the grains, so that they have an angular velocity
    oriented : the orientation of the grains matters
    onset : impulses correct the beginning and the end of contacts
    sheared : the cell is in homogeneous shear, or may be
    cell_servo : a servo moves the height of the cell
    reaches : an effect acts beyond touch
    local_radius : an effect wants the radii of curvature where shaped grains touch
    has_equivalent_radius : an effect wants the equivalent radii of shaped grains; those of spheres are their radii
    channels : number of effects whose dissipated energy is accounted for
    keeps_losses : what each contact dissipated in the last step is kept
    history : numbers that the effects remember of each pair
    effects : class names and variants of the effects
    bonds, walls, platens : how many there are
    wall_servo : a servo moves one of the plane walls
    integrator : class of the time integration
    """

    dim: int = 2
    periodic: tuple[bool, ...] = ()
    count: int = 1
    kind: str = "sphere"
    multi_part: bool = False
    rotates: bool = False
    oriented: bool = False
    onset: bool = False
    sheared: bool = False
    cell_servo: bool = False
    reaches: bool = False
    local_radius: bool = False
    has_equivalent_radius: bool = False
    channels: int = 0
    keeps_losses: bool = False
    history: int = 0
    effects: tuple[tuple[str, str], ...] = ()
    bonds: int = 0
    walls: int = 0
    wall_servo: bool = False
    platens: int = 0
    integrator: type | None = None

    @classmethod
    def of(cls, scene: Any) -> "KernelSpec":
        """The KernelSpec of a scene."""
        kind, effects = kind_of(scene.shapes), scene.effects
        shaped, bonded = kind != "sphere", scene.bonds is not None
        needs = {name for e in effects for name in e.needs}
        local_radius = any(e.local_radius for e in effects)
        return cls(
            dim=scene.dim,
            periodic=tuple(bool(p) for p in scene.periodic),
            count=len(scene.position),
            kind=kind,
            multi_part=max(len(s.parts) for s in scene.shapes) > 1,
            rotates=shaped or bonded or any(e.phase == "tangential" or e.adds_moment for e in effects),
            oriented=shaped or bonded,
            onset=scene.integrator.onset and any(hasattr(type(e), "onset_impulse") for e in effects),
            sheared=bool(scene.shear_rate) or scene.cell_servo is not None,
            cell_servo=scene.cell_servo is not None,
            reaches=scene.reach() > 0.0,
            local_radius=shaped and local_radius,
            has_equivalent_radius=shaped
            and ("rolling_radius" in needs or ("reduced_radius" in needs and not local_radius)),
            channels=len(energy_channels(effects)) if scene.track_dissipation else 0,
            keeps_losses=scene.track_contacts and any(e.dissipates and e.phase in ON_CONTACTS for e in effects),
            history=sum(e.history_size(scene.dim) for e in effects if e.phase in ON_CONTACTS),
            effects=tuple((type(e).__name__, e.variant) for e in effects),
            bonds=len(scene.bonds) if bonded else 0,
            walls=len(scene.walls),
            wall_servo=any(wall.servo for wall in scene.walls),
            platens=len(scene.platens),
            integrator=scene.integrator,
        )

    @property
    def shaped(self) -> bool:
        """Whether the grains have more than one patch."""
        return self.kind != "sphere"

    @property
    def tumbles(self) -> bool:
        """Whether the angular momentum is the state and the angular velocity follows from it: shaped grains in 3D."""
        return self.shaped and self.dim == 3

    @property
    def remembers_features(self) -> bool:
        """Whether each pair remembers which patches faced each other, from which the next search starts."""
        return self.kind in ("chain", "polyhedron")

    @property
    def remembers_normal(self) -> bool:
        """Whether each pair remembers its last normal as well."""
        return self.kind == "polyhedron"

    @property
    def tracks_dissipation(self) -> bool:
        """Whether dissipated energy is accounted for."""
        return self.channels > 0

    @property
    def has_rest_overlaps(self) -> bool:
        """Whether pairs may have a rest overlap, from which their depth counts: bonds may break."""
        return self.bonds > 0

    @property
    def has_angular_impulses(self) -> bool:
        """Whether impulses of contacts turn the grains: those of spheres go through the centres."""
        return self.onset and self.shaped

    @property
    def has_boundaries(self) -> bool:
        """Whether something other than grains moves in a step: platens, plane walls or the sheared cell."""
        return self.platens > 0 or self.walls > 0 or self.sheared
