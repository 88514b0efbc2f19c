"""Fabric and anisotropies of contacts whose distributions are known, and their sum against the stress ratio."""

import numpy as np
import pytest
import xarray as xr

from taichi_lsm import InputError
from taichi_lsm.statistics import fabric


def contacts_of(normal, normal_force, tangential_force, branch):
    columns = {"normal": normal, "tangential_force": tangential_force, "branch": branch}
    data = {name: (("contact", "space"), values) for name, values in columns.items()}
    return xr.Dataset(data | {"normal_force": ("contact", normal_force)})


def contacts_in_2d(a_c, a_n, a_t, a_l, direction=0.3, count=20_000):
    """Contacts of the distributions of Rothenburg & Bathurst (1989), all about one direction [rad]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 4 * count)
    share = (angle + 0.5 * a_c * np.sin(2.0 * angle)) / (2.0 * np.pi)
    theta = np.interp((np.arange(count) + 0.5) / count, share, angle)
    n = np.stack([np.cos(theta + direction), np.sin(theta + direction)], axis=1)
    tangent = np.stack([-n[:, 1], n[:, 0]], axis=1)
    force = 1.0 + a_n * np.cos(2.0 * theta)
    across = -a_t * np.sin(2.0 * theta)
    return contacts_of(n, force, across[:, None] * tangent, (1.0 + a_l * np.cos(2.0 * theta))[:, None] * n)


@pytest.mark.parametrize("which", range(4))
def test_each_anisotropy_is_found_alone(which):
    a = [0.0, 0.0, 0.0, 0.0]
    a[which] = 0.2
    found = fabric(contacts_in_2d(*a))
    values = [found.contact, found.normal_force, found.tangential_force, found.branch_length]
    assert values == pytest.approx(a, abs=1e-6) and found.branch_direction == pytest.approx(0.0, abs=1e-9)
    assert found.stress_ratio == pytest.approx(0.1, abs=1e-6)  # half of it: Rothenburg & Bathurst (1989)
    assert abs(found.stress_direction @ [np.cos(0.3), np.sin(0.3)]) == pytest.approx(1.0, abs=1e-6)


def test_their_sum_gives_the_stress_ratio_back():
    found = fabric(contacts_in_2d(0.2, 0.4, 0.15, 0.05))
    assert found.contact == pytest.approx(0.2, abs=1e-6)
    assert found.normal_force == pytest.approx((0.2 + 0.4) / (1 + 0.2 * 0.4 / 2) - 0.2, abs=1e-6)
    assert found.tensor[0, 0] + found.tensor[1, 1] == pytest.approx(1.0)
    assert found.stress_ratio > 0.35
    assert found.sum_of_anisotropies == pytest.approx(found.stress_ratio, rel=0.05)


def test_contacts_across_the_stress_are_negative():
    found = fabric(contacts_in_2d(-0.2, 0.6, 0.1, 0.0))
    assert found.contact == pytest.approx(-0.2, abs=1e-6)
    assert found.sum_of_anisotropies == pytest.approx(found.stress_ratio, rel=0.05)
    assert abs(found.contact_direction @ found.stress_direction) == pytest.approx(0.0, abs=1e-6)


def test_branch_vectors_off_the_normals_count():
    """Elongated grains: branches lean by an angle 0.1 sin 2 theta towards the stress."""
    contacts = contacts_in_2d(0.2, 0.4, 0.1, 0.05, direction=0.0)
    n = contacts.normal.values
    lean = -0.1 * 2.0 * n[:, 0] * n[:, 1]
    contacts["branch"] = contacts.branch + lean[:, None] * np.stack([-n[:, 1], n[:, 0]], axis=1)
    found = fabric(contacts)
    assert found.branch_direction == pytest.approx(0.1, abs=0.01)
    assert found.sum_of_anisotropies == pytest.approx(found.stress_ratio, rel=0.05)


def test_contacts_in_3d():
    """E(n) = (1 + a (3 n_1^2 - 1)/2)/4 pi and f_n alike: q/p is two fifths of the anisotropies to first order."""
    rng = np.random.default_rng(1)
    n = rng.normal(size=(200_000, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    legendre = 1.5 * n[:, 0] ** 2 - 0.5
    drawn = rng.random(len(n)) < (1.0 + 0.3 * legendre) / 1.3
    n, legendre = n[drawn], legendre[drawn]
    force = 1.0 + 0.2 * legendre
    found = fabric(contacts_of(n, force, np.zeros_like(n), n))
    # The invariant sqrt(3/2 a_ij a_ij) of a_ij = a diag(1, -1/2, -1/2) is 3/2 a.
    assert found.contact == pytest.approx(0.45, abs=0.02) and found.normal_force == pytest.approx(0.3, abs=0.03)
    stress = np.einsum("c,ci,cj->ij", force, n, n)
    ratio = 3.0 * (stress[0, 0] - 0.5 * (stress[1, 1] + stress[2, 2])) / np.trace(stress)
    assert found.stress_ratio == pytest.approx(ratio, rel=1e-3)
    assert found.sum_of_anisotropies == pytest.approx(ratio, rel=0.05)


def test_contacts_that_carry_nothing_are_refused():
    contacts = contacts_in_2d(0.2, 0.0, 0.0, 0.0, count=100)
    with pytest.raises(InputError, match="has no branch"):
        fabric(contacts.drop_vars("branch"))
    with pytest.raises(InputError, match="must be a compression"):
        fabric(contacts.assign(normal_force=-contacts.normal_force))
    with pytest.raises(InputError, match="at least 4 rows"):
        fabric(contacts.isel(contact=slice(3)))
    with pytest.raises(InputError, match="not finite"):
        fabric(contacts.assign(normal_force=contacts.normal_force * np.nan))
