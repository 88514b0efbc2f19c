"""Fabric and anisotropies of contacts whose distributions are known, and their sum against the stress ratio."""

import numpy as np
import pytest
import xarray as xr

from taichi_lsm import InputError
from taichi_lsm.statistics import fabric
from tests.helpers.contact_tables import grains_of, moment_of, moments_of


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


def test_the_rose_and_the_tensors_of_forces_are_those_of_the_distributions():
    found = fabric(contacts_in_2d(0.2, 0.4, 0.15, 0.0, direction=0.0), bins=72)
    rose, angle = found.rose, found.rose.angle.values
    assert float(rose.density.sum()) * 2.0 * np.pi / 72 == pytest.approx(1.0)
    assert rose.density.values == pytest.approx((1.0 + 0.2 * np.cos(2.0 * angle)) / (2.0 * np.pi), rel=5e-3)
    assert rose.normal_force.values == pytest.approx(1.0 + 0.4 * np.cos(2.0 * angle), rel=5e-3)
    assert rose.tangential_force.values == pytest.approx(-0.15 * np.sin(2.0 * angle), abs=5e-3)
    # <f_n n n>: f_n (1 + a_c cos 2 theta) has the mean 1 + a_c a_n/2 and the second harmonic a_c + a_n.
    mean, second = 1.0 + 0.2 * 0.4 / 2.0, 0.2 + 0.4
    assert found.normal_force_tensor == pytest.approx(
        np.diag([mean + second / 2.0, mean - second / 2.0]) / 2.0, abs=1e-6
    )
    # The tangential force adds -a_t sin 2 theta t: to first order a_t/4 on the diagonal.
    difference = found.force_tensor - found.normal_force_tensor
    assert difference == pytest.approx(np.diag([0.15, -0.15]) / 4.0, abs=1e-6)
    assert abs(found.normal_force_direction[0]) == pytest.approx(1.0)
    with pytest.raises(InputError, match="bins = 7: must be an even number"):
        fabric(contacts_in_2d(0.2, 0.4, 0.15, 0.0, count=100), bins=7)


def test_of_a_run_the_contacts_between_mobile_grains_count_at_one_time():
    """Grain 0 is glued, and there is a wall: of the second moment four contacts are left, all along y."""
    ids = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, -1)]
    normal = np.array([[1.0, 0.0], *[[0.0, 1.0]] * 4, [1.0, 0.0]])
    first, second = (list(column) for column in zip(*ids, strict=True))
    moment = moment_of(first, second, 0.5 * normal, normal, normal, np.ones(6), np.zeros((6, 2)))
    turned = moment_of(first, second, normal, normal[:, ::-1], normal[:, ::-1], np.ones(6), np.zeros((6, 2)))
    contacts = moments_of([turned, moment], [0.0, 1.0])
    grains = grains_of(np.zeros((2, 6, 2)), 1.0, glued=(0,))
    tree = xr.DataTree(children={"grains": xr.DataTree(grains), "contacts": xr.DataTree(contacts)})
    found = fabric(tree)
    assert found.contacts == 4 and found.tensor[1, 1] == pytest.approx(1.0)
    assert fabric(tree, 0.0).tensor[0, 0] == pytest.approx(1.0)
    assert fabric(contacts).contacts == 6 and fabric(contacts, time=0.2).tensor[0, 0] == pytest.approx(4 / 6)
