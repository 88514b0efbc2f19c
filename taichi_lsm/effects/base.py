"""The contract of a force law: one file in this folder, one class, discovered by name.

A law is plain data on the host (validated in `__post_init__`) and a few Taichi functions in kernels. It sees a
`Contact`, its own history and nothing else. Hooks that a class does not define are never compiled.

    class MyLaw(Effect):                 decorated with @ti.data_oriented
        phase = "normal"                 normal | damping | tangential | cohesion (in this order) | body | motion | bond
        units = {"stiffness": "N m-1"}   of the fields of the dataclass
        history = (HistoryValue(...),)   numbers kept per contact, zero in a new contact; may depend on the instance
        needs = ("reduced_radius",)      inputs that only this law wants: see OPTIONAL
        couples = True                   adds to contact.couple
        role = "friction"                a scene may list one law of each role
        variant = "slip law"             choices that are compiled in, so that the values of another cannot be loaded
        def parameters(self)             {name: value}: become 0-d fields `self.<name>_`, readable in kernels
        on_contact(self, contact, history) -> energy dissipated in this step [J]
        contact_energy(self, contact, history) -> energy stored now [J]
        on_grain(self, inverse_mass, force) adds to the force [N] on a mobile grain (phase "body")
        grain_energy(self, inverse_mass, position) -> potential energy [J] of a grain (phase "body")
        on_velocity(self, before, after, dt) -> velocity [m s-1] or spin [rad s-1] or angular momentum that a grain has
            after the kick of a step, in place of `after` (phase "motion")
        on_bond(self, u, turn, e_k, e_l, stiffness) -> force on l [N], couple on k, couple on l [N m] (phase "bond"; so
            are the next four, and the arguments are those of elastic_brittle_bond.py)
        bond_energy(self, u, turn, e_k, e_l, stiffness) -> energy of a bond [J]
        bond_use(self, u, turn, e_k, e_l, stiffness, strength) -> part of its strength in use; a bond breaks above 1
        bond_stiffness(self, radius, length, depth) -> (m, 4) numbers per bond, host
        bond_strength(self, radius, depth) -> (m, 4) numbers per bond, host
        onset_impulse(self, speed, acceleration, fraction, dt) -> impulse [N s], repulsive (phase "normal")
        tangent_stiffness(self, contact) -> d F_n/d depth [N m-1] (phase "normal")
        reach(self) -> distance of the surfaces up to which the law acts [m], host
        stable_dt(self, bodies) -> largest stable step of this law alone [s], host
        check(self, scene) raises InputError if the law makes no sense in the scene, host
        cases(cls) -> instances that the contract tests try

`onset_impulse` corrects the error that Verlet's trapezoidal rule makes where the force starts or ends inside a
step: for a force c t^p that starts a fraction of the step before its end it is -c dt^(p+1) zeta(-p, fraction), zeta
the Hurwitz zeta function; speed [m s-1] is that of approach (begin) or recession (end) when the depth is zero, and
acceleration [m s-2] the second rate of the depth in time (begin) or in reversed time (end).

In `on_contact` a law adds to `contact.normal_force` [N, repulsive], `contact.stiffness` [N m-1] and
`contact.tangential_force` [N, on the second grain], and writes its history in place. It is called while the grains
touch and once more in the first step after they parted (`contact.touching` = 0, depth 0): it then must return no
force, leave its history zero, and book what the history held. If any law has a reach, all are called up to it;
`contact.gap` [m] is then the distance of the surfaces, and only the law with the reach may have a force there.

`contact.stiffness` is that of the linear spring which oscillates like the law: of a force that grows as depth^p it is
(p + 1)/(2 p) of the slope, which makes dashpots in proportion to its root give one restitution at any speed.
"""

import copy
import functools
from dataclasses import dataclass

import numpy as np

from ..core.errors import require
from ..core.runtime import current, ti, when_allocated

PHASES = ("normal", "damping", "tangential", "cohesion", "body", "motion", "bond")
ON_CONTACTS = PHASES[:4]


@dataclass(frozen=True)
class HistoryValue:
    """One number (per_axis=False) or one tangential vector (per_axis=True: one component in 2D, three in 3D)."""

    name: str
    units: str
    long_name: str
    per_axis: bool = False

    def size(self, dim):
        """Numbers stored in a scene of this dimension."""
        return (1 if dim == 2 else 3) if self.per_axis else 1


@dataclass(frozen=True)
class Bodies:
    """What a law may know of the scene to bound its time step.

    dim; least_mass [kg], least_inertia [kg m2]: of the mobile grains; spin_factor [-]: greatest R^2 m/I for
    tangential motion; lever_factor [-]: greatest a^2 m/I for normal motion, a the lever of a surface normal;
    coordination: contacts that one grain may have at once; normal_stiffness [N m-1]: sum over the normal laws;
    bond_rate [s-2]: bound on the square of the angular frequencies of the bonds, 0 without bonds;
    contact_radius_per_mass [m kg-1]: greatest a/m of a mobile grain, a = sqrt(R d) of the greatest reduced radius
    that its surface may meet and a depth d of a tenth of the grain; 0 unless a law needs the reduced radius.
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


# What a contact holds if a law `needs` it.
# reduced_radius [m]: R_k R_l/(R_k + R_l) of the radii of curvature; relative_spin [rad s-1]: of l against k.
OPTIONAL = ("reduced_radius", "relative_angular_velocity")


def contact_type(dim, effects=()):
    """Taichi struct of one contact as the laws see it; world frame, relative to the first grain k.

    depth [m] >= 0; touching 0 | 1; normal [-] from k to l; approach [m s-1]: closing speed -v_rel . n; slip [m s-1]:
    tangential velocity of l against k at the contact point; spin_about_normal [rad s-1]: mean of both grains;
    mass [kg]: m_k m_l/(m_k + m_l); dt [s]; the rest is what the laws add up, Eq. (10): normal_force [N, repulsive],
    stiffness [N m-1], tangential_force [N, on l], couple [N m, on l]. Members that none of the laws wants are missing.
    """
    real = current().real
    vector = ti.types.vector(dim, real)
    turning = ti.types.vector(1 if dim == 2 else 3, real)
    wanted = {name for effect in effects for name in effect.needs}
    more = {"reduced_radius": real} if "reduced_radius" in wanted else {}
    more |= {"relative_angular_velocity": turning} if "relative_angular_velocity" in wanted else {}
    more |= {"contact_moment": turning} if any(effect.adds_moment for effect in effects) else {}
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
    """Base of all laws; see the module's docstring for the contract."""

    phase = "normal"
    units: dict[str, str] = {}
    history: tuple[HistoryValue, ...] = ()
    needs: tuple[str, ...] = ()
    adds_moment = False
    role = ""
    dissipates = False
    variant = ""
    equation = ""

    @property
    def name(self):
        """Snake-case name: used in files, in TOML and by `lsm list`."""
        return effect_name(type(self))

    def parameters(self):
        """Values that kernels read, by name; SI."""
        return {}

    def history_size(self, dim):
        """Numbers remembered per contact."""
        return sum(h.size(dim) for h in self.history)

    def normal_stiffness(self):
        """Stiffness that this law adds along the normal [N m-1]; host."""
        return 0.0

    def stiffness_per_radius(self):
        """The same of a law that stiffens with the radius a = sqrt(R d) of the contact, over a [N m-2]; host."""
        return 0.0

    def stable_dt(self, bodies):
        """Largest stable time step of this law alone [s]."""
        return np.inf

    def reach(self):
        """Distance of the surfaces up to which this law acts [m]; 0 for one that needs them to touch."""
        return 0.0

    def check(self, scene):
        """Raise InputError, with the reason, if this law makes no sense in the scene."""

    def bound(self, **context):
        """Copy whose parameters live in Taichi fields `<name>_`, so that one compilation serves all values."""
        twin = copy.copy(self)
        for name, value in twin.parameters().items():
            setattr(twin, f"{name}_", ti.field(current().real, np.size(value)))
        when_allocated(lambda: twin.write_parameters(self))
        return twin

    def write_parameters(self, source):
        """Take over the values of a law of the same class."""
        for name, value in source.parameters().items():
            field = getattr(self, f"{name}_")
            for i, number in enumerate(np.atleast_1d(np.asarray(value, float))):
                field[i] = number


@functools.cache
def effect_name(cls):
    """CoulombFriction -> coulomb_friction."""
    return "".join(("_" if i and c.isupper() else "") + c.lower() for i, c in enumerate(cls.__name__))


def check_elastic_constants(effect):
    """Raise InputError unless the law's youngs_modulus and poissons_ratio are those of a solid."""
    modulus, ratio = effect.youngs_modulus, effect.poissons_ratio
    require(np.isfinite(modulus) and modulus > 0.0, effect, "youngs_modulus", modulus, "> 0 Pa")
    require(np.isfinite(ratio) and -1.0 < ratio <= 0.5, effect, "poissons_ratio", ratio, "> -1 and <= 0.5")
