"""The contract of an effect: what a scene lists in `Scene.effects`, one class in one file of this folder.

An effect is a dataclass of plain numbers in SI units, checked when it is made, with a few Taichi functions that kernels
call. It sees one contact, one grain or one bond and its own history, never the state. A hook that a class does not
define is never compiled, and a scene pays only for the effects that it lists.

Declarations (class attributes)
-------------------------------
phase           When the effect acts. On contacts, in this order: "normal", "damping", "tangential", "cohesion", so that
                friction reads the complete repulsive force. On grains: "body" (forces), "motion" (velocities).
                Between bonded grains: "bond".
units           {parameter: UDUNITS string}, one entry per field of the dataclass.
history         `HistoryValue`s kept per contact, zero in a new contact; may depend on the instance.
needs           Names of optional inputs of a contact that this effect reads; see `OPTIONAL`.
local_radius    True if the reduced radius is to be that of the curvatures where the grains touch, which must not jump
                at a seam: scenes refuse it for grains of unequal patches. Else it is that of the equivalent radii.
adds_moment     True if it adds to `contact.contact_moment`.
role            A scene may list one effect of each role, such as "friction"; "" if it may stand beside others.
dissipates      True if it dissipates energy: it gets a channel of its own in the energy budget and in files.
variant         Names the branch that is compiled in: values of another variant cannot be loaded into a compiled run.
equation        The force law on one line, for `lsm list --effects`.

Hooks on the host
-----------------
check(scene)
    When a scene is made. Raises `InputError` if the effect makes no sense in it; `scene`: see `SceneFacts`.
stable_dt(bodies) -> largest stable time step of this effect alone [s]
    When a scene chooses or checks its time step; `bodies`: see `Bodies`. Infinite if the effect does not bound it.
normal_stiffness() -> stiffness along the normal [N m-1]
stiffness_per_radius() -> stiffness over the radius sqrt(R d) of the contact [N m-2]
    Likewise; effects that repel give one of the two, and dashpots read their sum in `bodies`.
reach() -> distance of the surfaces up to which the effect acts [m]
    When a scene is made and when neighbours are searched; 0: the surfaces must touch.
parameters() -> {name: value}
    When a simulation is made or reset. The values become fields `self.<name>_`, read in kernels as `self.<name>_[0]`;
    one compilation serves all values.
bond_radius(radius, area, depth) -> radii (m,) of m bonds [m]
bond_sections(r, depth) -> areas and section moduli of m bonds [m2], [m3], [m3]
bond_stiffness(r, length, depth) -> stiffness numbers (m, 4) of m bonds
bond_strength(r, depth) -> strength numbers (m, 4) of m bonds
    Phase "bond"; when a simulation is made. Arguments: see `elastic_brittle_bond.ElasticBrittleBond`.
cases() -> instances that the contract tests try
    Classmethod; tests and `lsm list --effects`.

Hooks in kernels (`@ti.func`)
-----------------------------
on_contact(contact, history) -> energy dissipated in this step [J]
    Contact phases; once per step for every contact that touches or is in reach, and once more in the first step after
    they parted. Adds to the contact: `normal_force` [N, repulsive], `stiffness` [N m-1], `tangential_force` [N, on the
    second grain], `contact_moment` [N m, on the second grain]; sets `sliding`; writes its history in place. Both
    arguments are `ti.template()`; without a history the second one is 0.
contact_energy(contact, history) -> energy that the contact stores now [J]
    Contact phases; whenever energies are measured. Without it the effect stores none.
onset_impulse(contact, speed, acceleration, fraction, dt) -> impulse [N s], repulsive
    Phase "normal"; in the step in which a contact begins or ends, see below. Of the contact only inputs of `OPTIONAL`
    about radii are set.
on_grain(inverse_mass, force)
    Phase "body"; once per step and mobile grain. Adds to `force` [N], a `ti.template()`; inverse_mass [kg-1].
grain_energy(inverse_mass, position) -> potential energy [J]
    Phase "body"; whenever energies are measured; position [m], world frame.
on_velocity(before, after, dt) -> value in place of `after`
    Phase "motion"; after the kick of every step, for the velocity [m s-1] and the angular velocity [rad s-1] (of grains
    that tumble in 3D, the angular momentum) of a mobile grain before and after the kick; dt [s] is the time step. What
    it takes from the kinetic energy is added to its dissipated energy by the integrator.
on_bond(u, rotation, e_k, e_l, stiffness) -> force on l [N], moment on k, moment on l [N m]
    Phase "bond"; once per step and intact bond. Arguments: see `elastic_brittle_bond.bond_energy`.
bond_energy(u, rotation, e_k, e_l, stiffness) -> energy of the bond [J]
    Phase "bond"; when energies are measured, and when the bond breaks.
bond_use(u, rotation, e_k, e_l, stiffness, strength) -> fraction of the strength in use [1]
    Phase "bond"; once per step and intact bond, which breaks above 1.

A contact that parted
---------------------
In the first step after the grains parted `contact.touching` is 0 and the depth 0. The effect then must return no force,
leave its history zero, and return what the history held as dissipated. If any effect of the scene has a reach, all
contact effects are called up to it; `contact.gap` [m] is then the distance of the surfaces, and only the effect with
the reach may have a force there.

Stiffness for dashpots
----------------------
`contact.stiffness` is that of the linear spring which oscillates like the effect: for a force that grows as depth^p it
is (p + 1)/(2 p) of the slope. A dashpot in proportion to its root then gives one restitution at any speed.

Onset
-----
`onset_impulse` corrects the error that Verlet's trapezoidal rule makes where the force starts or ends inside a step.
For a force c t^p that starts a fraction of the step before its end it is -c dt^(p+1) zeta(-p, fraction), zeta the
Hurwitz zeta function. speed [m s-1] is that of approach (begin) or recession (end) at depth zero, acceleration [m s-2]
the second rate of the depth in time (begin) or in reversed time (end). The force with which the effects of the phase
"damping" begin at once is corrected in the same way; they need no hook for it.
"""

import copy
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from ..core.allocation import when_allocated, write
from ..core.errors import finite, require
from ..core.runtime import current, ti

PHASES = ("normal", "damping", "tangential", "cohesion", "body", "motion", "bond")
ON_CONTACTS = PHASES[:4]

# Inputs that a contact has only if an effect of the scene `needs` them.
# reduced_radius [m]: R* = R_k R_l/(R_k + R_l), so that a contact of Hertz has the radius sqrt(R* d). At a wall R of the
# grain; at a rigid one four times that, for both moduli E* and G* are there twice those of two like grains.
# rolling_radius [m]: R_k R_l/(R_k + R_l) of the equivalent radii, at a wall R of the grain.
# footprint [m]: a = sqrt(2 R d), half of the width in which the outlines overlap, R the reduced radius of their
# curvatures; at most a quarter of the lesser bounding diameter, for a side ends at its corners. 0 without a contact.
# relative_angular_velocity [rad s-1]: of l against k, world frame.
LENGTHS = ("reduced_radius", "rolling_radius", "footprint")
OPTIONAL = (*LENGTHS, "relative_angular_velocity")


@dataclass(frozen=True)
class HistoryValue:
    """What an effect remembers per contact: one number, or one tangential vector.

    Parameters
    ----------
    name
        Identifier.
    units
        UDUNITS string, SI.
    long_name
        What it is, for `lsm list --effects`.
    per_axis
        False: one number. True: a tangential vector, one component in 2D and three in 3D (world frame).
    """

    name: str
    units: str
    long_name: str
    per_axis: bool = False

    def size(self, dim: int) -> int:
        """Numbers stored per contact in a scene of this dimension."""
        return (1 if dim == 2 else 3) if self.per_axis else 1


@dataclass(frozen=True)
class Bodies:
    """What an effect may know of the grains of a scene to bound its time step.

    Parameters
    ----------
    dim
        2 or 3.
    least_mass, least_inertia
        Of the mobile grains [kg], [kg m2].
    rotation_factor
        Greatest R^2 m/I [1]: how much more easily a tangential force moves the surface than the centre.
    lever_factor
        Greatest a^2 m/I [1], a the lever of a surface normal: the same for a normal force.
    coordination
        Contacts that one grain may have at once.
    normal_stiffness
        Sum over the effects that repel [N m-1].
    bond_rate
        Bound on the square of the angular frequencies of the bonds [s-2]; 0 without bonds.
    contact_radius_per_mass
        Greatest a/m of a mobile grain [m kg-1], with a = sqrt(R d) of the greatest reduced radius R that it may meet
        and a depth d of a tenth of the grain; 0 unless an effect needs the reduced radius.
    """

    dim: int
    least_mass: float
    least_inertia: float
    rotation_factor: float
    lever_factor: float
    coordination: float
    normal_stiffness: float
    bond_rate: float = 0.0
    contact_radius_per_mass: float = 0.0


class SceneFacts(Protocol):
    """What `Effect.check` may read of a scene."""

    @property
    def dim(self) -> int:
        """2 or 3."""
        ...

    @property
    def effects(self) -> Sequence["Effect"]:
        """All effects that the scene lists."""
        ...


def contact_type(dim: int, effects: Sequence["Effect"] = ()) -> Any:
    """Taichi struct of one contact as the effects of a scene see it.

    All vectors are in the world frame, and motion is relative to the first grain k. Members that none of the effects
    wants are missing.

    Returns
    -------
    ti.types.struct
        Inputs: depth [m] >= 0; touching, 0 or 1; normal [1], from k to l; approach [m s-1], closing speed -v_rel . n;
        slip [m s-1], tangential velocity of l against k at the contact point; normal_angular_velocity [rad s-1], mean
        of both grains about the normal; normal_change [1], in 3D: change of the normal in the last step, across it;
        mass [kg], the effective one along the normal, 1/(1/m_k + 1/m_l + (a x n)^2/I of both), a the arms; dt [s];
        gap [m], if an effect has a reach; those of `OPTIONAL` that an effect needs. Velocities are those of the middle
        of the step.

        Sums over the effects, Eq. (10) of Abe & Mora (2003): normal_force [N, repulsive]; stiffness [N m-1];
        tangential_force [N, on l]; contact_moment [N m, on l], if an effect adds one; sliding, 0 or 1.
    """
    real = current().real
    vector = ti.types.vector(dim, real)
    axial = ti.types.vector(1 if dim == 2 else 3, real)  # angular velocities and moments
    wanted = {name for effect in effects for name in effect.needs}
    more = {name: real for name in LENGTHS if name in wanted}
    more |= {"relative_angular_velocity": axial} if "relative_angular_velocity" in wanted else {}
    more |= {"contact_moment": axial} if any(effect.adds_moment for effect in effects) else {}
    more |= {"normal_change": vector} if dim == 3 else {}
    more |= {"gap": real} if any(effect.reach() > 0.0 for effect in effects) else {}
    return ti.types.struct(
        depth=real,
        touching=ti.i32,
        normal=vector,
        approach=real,
        slip=vector,
        normal_angular_velocity=real,
        mass=real,
        dt=real,
        normal_force=real,
        stiffness=real,
        tangential_force=vector,
        sliding=ti.i32,
        **more,
    )


class Effect:
    """Base of all effects; the module's docstring is the contract."""

    phase: ClassVar[str] = "normal"
    units: ClassVar[Mapping[str, str]] = {}
    history: tuple[HistoryValue, ...] = ()
    needs: ClassVar[tuple[str, ...]] = ()
    local_radius: bool = False
    adds_moment: ClassVar[bool] = False
    role: ClassVar[str] = ""
    dissipates: ClassVar[bool] = False
    variant: str = ""
    equation: ClassVar[str] = ""

    @property
    def name(self) -> str:
        """Snake-case name: used in files, in TOML and by `lsm list`."""
        return effect_name(type(self))

    def parameters(self) -> Mapping[str, float | Sequence[float]]:
        """Values that kernels read, by name; SI."""
        return {}

    def history_size(self, dim: int) -> int:
        """Numbers remembered per contact."""
        return sum(h.size(dim) for h in self.history)

    def normal_stiffness(self) -> float:
        """Stiffness that this effect adds along the normal [N m-1]."""
        return 0.0

    def stiffness_per_radius(self) -> float:
        """Stiffness over the contact radius a = sqrt(R d) [N m-2], of an effect that stiffens with it."""
        return 0.0

    def stable_dt(self, bodies: Bodies) -> float:
        """Largest stable time step of this effect alone [s], infinite if it does not bound the step."""
        return np.inf

    def reach(self) -> float:
        """Distance of the surfaces up to which this effect acts [m]; 0 for one that needs them to touch."""
        return 0.0

    def check(self, scene: SceneFacts) -> None:
        """Raise InputError, with the reason, if this effect makes no sense in the scene."""

    @classmethod
    def cases(cls) -> Sequence["Effect"]:
        """Instances that the contract tests try; an effect with several variants gives one of each."""
        return []

    def bound(self) -> Self:
        """Copy whose parameters live in Taichi fields `<name>_`, so that one compilation serves all values."""
        twin = copy.copy(self)
        for name, value in twin.parameters().items():
            setattr(twin, f"{name}_", ti.field(current().real, np.size(value)))
        when_allocated(lambda: twin.write_parameters(self))
        return twin

    def write_parameters(self, source: "Effect") -> None:
        """Write the values of `source`, an effect of the same class, into the fields of this bound copy."""
        for name, value in source.parameters().items():
            write(getattr(self, f"{name}_"), value)


@functools.cache
def effect_name(cls: type[Effect]) -> str:
    """Snake-case name of a class: CoulombFriction -> coulomb_friction."""
    return "".join(("_" if i and c.isupper() else "") + c.lower() for i, c in enumerate(cls.__name__))


def check_elastic_constants(effect: Any) -> None:
    """Raise InputError unless the effect's youngs_modulus and poissons_ratio are those of a solid."""
    modulus, ratio = effect.youngs_modulus, effect.poissons_ratio
    require(finite(modulus) and modulus > 0.0, effect, "youngs_modulus", modulus, "a number > 0 Pa, such as 70e9")
    require(finite(ratio) and -1.0 < ratio <= 0.5, effect, "poissons_ratio", ratio, "> -1 and <= 0.5")
