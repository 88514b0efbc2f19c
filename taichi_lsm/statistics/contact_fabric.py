"""Fabric: how contacts, their forces and branch vectors are oriented, and the share of the stress ratio that each has.

Contacts with unit normals n, branch vectors l and forces f = f_n n + f_t carry the stress sigma_ij ~ <f_i l_j>  (1),
<> the mean over contacts. With the deviator X' = X/tr X - 1/D of a tensor X,
A_c = <n n>'                                                                                        (2)
A_n = <f_n n n>' - A_c                                                                              (3)
A_t = <f n>' - <f_n n n>'                                                                           (4)
A_l = <|l| n n>' - A_c                                                                              (5)
A_b = <n l>' - <|l_n| n n>', zero where branch vectors lie along normals                            (6)
and sigma' = A_c + A_n + A_t + A_l + A_b to the second order of the anisotropies: the stress-force-fabric relation.

<n n> is the fabric tensor of Satake (1982). In 2D the distributions are E = (1 + a_c cos 2(theta - theta_c))/2 pi,
f_n ~ 1 + a_n cos 2(theta - theta_n), and so on, and
sin phi = (s1 - s2)/(s1 + s2) = (a_c + a_n + a_t + a_l)/2 (Rothenburg & Bathurst 1989); in 3D
q/p = 2/5 (a_c + a_n + a_t + a_l) (Ouadfel & Rothenburg 2001) with a = sqrt(3/2 a_ij a_ij) of
E = (1 + a_ij n_i n_j)/4 pi, where a_t is 3/2 of the one of Guo & Zhao (2013).

References
----------
Satake (1982), in Deformation and Failure of Granular Materials, Balkema, 63-68; Rothenburg & Bathurst (1989),
doi:10.1680/geot.1989.39.4.601; Ouadfel & Rothenburg (2001), doi:10.1016/S0167-6636(00)00057-0; Guo & Zhao (2013),
doi:10.1016/j.compgeo.2012.07.002.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, shown
from .contact_moments import contacts_at
from .run_parts import holds, part_of

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
COLUMNS = ("normal", "normal_force", "tangential_force", "branch")
SHARE = {2: 0.5, 3: 0.4}  # of the sum of the anisotropies in the stress ratio
AMPLITUDE = {2: 4.0, 3: 7.5}  # of a distribution, over its deviator
NORM = {2: 0.5, 3: 1.5}  # within the square root of an invariant


class Fabric(NamedTuple):
    """Fabric tensor and anisotropies of contacts.

    Parameters
    ----------
    tensor
        (D, D) fabric tensor <n n> [1], of trace 1, world frame.
    contact, normal_force, tangential_force, branch_length, branch_direction
        Anisotropies a_c, a_n, a_t, a_l, a_b [1] in the direction of the stress: positive where contacts or forces are
        more, or larger, along the greatest compression.
    stress_ratio
        sin phi = (s1 - s2)/(s1 + s2) in 2D, q/p in 3D [1], of the stress (1) of the same contacts.
    sum_of_anisotropies
        The stress ratio by their sum [1]: half of it in 2D, two fifths in 3D.
    contact_direction, stress_direction
        (D,) unit vectors along which contacts are most, and compression is greatest; the sign has no meaning.
    contacts
        Number of contacts.
    normal_force_tensor, force_tensor
        (D, D) <f_n n n> and <f n> [N], symmetric; the trace of either is the mean normal force.
    normal_force_direction
        (D,) unit vector along which normal forces are greatest.
    rose
        In 2D a Dataset along `angle` [rad] of the normal, from -pi to pi, either normal of a contact counted: density
        [rad-1], of integral 1; normal_force and tangential_force [N], their means, the latter along the normal turned
        by +pi/2; nan where no contact points. None in 3D.
    """

    tensor: Array
    contact: float
    normal_force: float
    tangential_force: float
    branch_length: float
    branch_direction: float
    stress_ratio: float
    sum_of_anisotropies: float
    contact_direction: Array
    stress_direction: Array
    contacts: int
    normal_force_tensor: Array
    force_tensor: Array
    normal_force_direction: Array
    rose: "Dataset | None"


def fabric(contacts: "Run", time: float | None = None, bins: int = 36) -> Fabric:
    """Fabric and anisotropies of contacts such as `sim.contacts()` gives them; equations in the module's text.

    Parameters
    ----------
    contacts
        The tree of a run, of which contacts with walls and with grains glued to platens are left out; a contacts.nc; or
        contacts of one moment, as `contacts_at` and `sim.contacts()` give them, along contact and space: normal [1],
        normal_force [N], tangential_force [N] on the second grain, branch [m]. Rows can be selected before, such as
        `contacts.sel(contact=~contacts.bonded)`.
    time
        Time [s]; the nearest moment is taken, the last one by default.
    bins
        Number of angles of the rose, even and >= 2.

    Returns
    -------
    Fabric
        Of one instant and without an error: anisotropies of n contacts scatter by about sqrt(8/n) in 2D. Average them
        over independent instants, and take the error from these.

    Raises
    ------
    InputError
        If a variable is missing, the space is not of 2 or 3 dimensions, there are fewer contacts than 4, values are not
        finite, or the contacts carry no compression.
    """
    n, normal_force, tangential, branch = _checked(_between_grains(contacts, time))
    count, dim = n.shape
    stress = _mean(normal_force[:, None] * n + tangential, branch)
    if not np.trace(stress) > 0.0 or not normal_force.mean() > 0.0:
        raise InputError(f"contacts: mean stress of sign {np.sign(np.trace(stress)):g}, must be a compression")
    tensor, length = _mean(n, n), np.linalg.norm(branch, axis=1)
    along = np.einsum("ci,ci->c", branch, n)
    normal_forces, forces = _mean(normal_force[:, None] * n, n), _mean(normal_force[:, None] * n + tangential, n)
    of_contacts, of_normal_force = _deviator(tensor), _deviator(normal_forces)
    parts = (
        of_contacts,
        of_normal_force - of_contacts,
        _deviator(forces) - of_normal_force,
        _deviator(_mean(length[:, None] * n, n)) - of_contacts,
        _deviator(_mean(n, branch)) - _deviator(_mean(along[:, None] * n, n)),
    )
    # In the direction of the stress the parts add up as numbers; what lies across it changes the direction alone.
    size = float(np.linalg.norm(deviator := _deviator(stress)))
    direction = deviator / size if size > 0.0 else np.zeros_like(deviator)
    factor = AMPLITUDE[dim] * math.sqrt(NORM[dim])
    a_c, a_n, a_t, a_l, a_b = (factor * float(np.sum(part * direction)) for part in parts)
    return Fabric(
        tensor,
        a_c,
        a_n,
        a_t,
        a_l,
        a_b,
        SHARE[dim] * factor * size,
        SHARE[dim] * (a_c + a_n + a_t + a_l + a_b),
        _greatest(tensor),
        _greatest(stress),
        count,
        normal_forces,
        forces,
        _greatest(normal_forces),
        _rose(n, normal_force, tangential, bins) if dim == 2 else None,
    )


def _between_grains(contacts: "Run", time: float | None) -> "Dataset":
    """The contacts of one moment; of a run those between mobile grains."""
    if not hasattr(contacts, "children"):
        return contacts_at(contacts, time) if "row_size" in contacts.variables else contacts  # pyright: ignore
    moment = contacts_at(contacts, time)
    mobile = np.asarray(moment.second_id) >= 0
    if holds(contacts, "grains"):
        glued = np.asarray(part_of(contacts, "grains", ("kind",)).kind) == 1
        pairs = np.stack([moment.first_id, np.where(mobile, moment.second_id, moment.first_id)])
        mobile &= ~glued[pairs].any(axis=0)
    return moment.isel(contact=np.flatnonzero(mobile))


def _rose(n: Array, normal_force: Array, tangential: Array, bins: int) -> "Dataset":
    """Contacts and mean forces by the angle of their normals, see `Fabric`."""
    import xarray

    if isinstance(bins, bool) or not isinstance(bins, int | np.integer) or bins < 2 or bins % 2:
        raise InputError(f"bins = {shown(bins)}: must be an even number >= 2")
    borders = np.linspace(-np.pi, np.pi, bins + 1)
    across = tangential[:, 1] * n[:, 0] - tangential[:, 0] * n[:, 1]
    # The other normal of a contact, of the first grain: there force and direction are both opposite.
    angle = np.concatenate([np.arctan2(n[:, 1], n[:, 0]), np.arctan2(-n[:, 1], -n[:, 0])])
    count, _ = np.histogram(angle, borders)
    sums = [np.histogram(angle, borders, weights=np.tile(force, 2))[0] for force in (normal_force, across)]
    with np.errstate(invalid="ignore"):
        means = [total / np.where(count > 0, count, np.nan) for total in sums]
    width = borders[1] - borders[0]
    return xarray.Dataset(
        {
            "density": ("angle", count / (angle.size * width), {"units": "rad-1", "long_name": "density of contacts"}),
            "normal_force": ("angle", means[0], {"units": "N", "long_name": "mean normal force"}),
            "tangential_force": ("angle", means[1], {"units": "N", "long_name": "mean tangential force"}),
        },
        {"angle": ("angle", 0.5 * (borders[1:] + borders[:-1]), {"units": "rad", "long_name": "angle of the normal"})},
    )


def _checked(contacts: "Dataset") -> tuple[Array, Array, Array, Array]:
    """The columns of the contacts, or an InputError that names what is wrong with them; see `fabric`."""
    missing = [name for name in COLUMNS if name not in contacts]
    if missing:
        raise InputError(f"contacts: has no {', '.join(missing)}, must be what sim.contacts() gives")
    n, normal_force, tangential, branch = (np.asarray(contacts[name], float) for name in COLUMNS)
    count, dim = n.shape if n.ndim == 2 else (0, 0)
    if (
        dim not in SHARE
        or count < 4
        or normal_force.shape != (count,)
        or not tangential.shape == branch.shape == n.shape
    ):
        raise InputError(
            f"contacts: normal of shape {n.shape}, must be (contact, 2) or (contact, 3) of at least 4 rows"
        )
    if not all(np.isfinite(values).all() for values in (n, normal_force, tangential, branch)):
        raise InputError("contacts: values are not finite, leave out such rows")
    return n, normal_force, tangential, branch


def _mean(first: Array, second: Array) -> Array:
    """Mean (D, D) over contacts of the product of two vectors, made symmetric."""
    product = first.T @ second / len(first)
    return 0.5 * (product + product.T)


def _deviator(tensor: Array) -> Array:
    """X/tr X - 1/D."""
    return tensor / np.trace(tensor) - np.eye(len(tensor)) / len(tensor)


def _greatest(tensor: Array) -> Array:
    """Unit vector of the greatest eigenvalue."""
    return np.linalg.eigh(tensor)[1][:, -1]
