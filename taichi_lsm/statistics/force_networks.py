"""Force chains: quasi-linear chains of grains that carry more than the mean, after Peters et al. (2005)."""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError, finite, shown
from .grain_stress import at_one_instant, grain_stress

if TYPE_CHECKING:
    from xarray import Dataset

    from .run_parts import Run

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


def force_chains(
    run: "Run",
    time: float | None = None,
    contacts: "Run | None" = None,
    angle: float = math.pi / 4.0,
    least: int = 3,
) -> "Dataset":
    """Chains of grains along which the greatest compression is handed on, at one moment.

    A grain may belong to a chain if its major principal stress s_1, of the mean stress within it (`grain_stress`), is
    above the mean of s_1 over all mobile grains. Two such grains that touch are linked if their branch vector lies
    within the angle of the direction of s_1 of both. Along this direction a grain has at most one link to either side:
    those that are closest to both directions are taken first. Grains that links join, directly or through others, are
    a chain if they are 3 or more.

    Parameters
    ----------
    run, time, contacts
        As of `grain_stress`.
    angle
        Greatest angle [rad] between a branch vector and the direction of s_1, above 0 and below pi/2.
    least
        Number of grains >= 2 that make a chain.

    Returns
    -------
    xarray.Dataset
        Along grain: chain, its number from 0 on in the order of the lowest ids, -1 for grains in none; major_stress
        [Pa]; direction (grain, space) of it, a unit vector whose sign has no meaning; stress and what else
        `grain_stress` gives. Along contact: contact_chain, the chain of which the contact is a link, -1 of none. Along
        chain: chain_size, its number of grains. Scalar mean_stress [Pa]: the mean of s_1.

    Raises
    ------
    InputError
        As of `grain_stress`; for an angle or a number out of range.

    Notes
    -----
    Peters et al. search from grain to grain forward and backward; that a grain has one link to either side makes the
    result independent of where a search begins. Grains glued to platens and walls end chains and do not belong to them.

    References
    ----------
    Peters, Muthuswamy, Wibowo & Tordesillas (2005), doi:10.1103/PhysRevE.72.041307.
    """
    _check(angle, least)
    grains, moment = at_one_instant(run, time, contacts)
    found = grain_stress(grains, contacts=moment)
    major, direction, mean = _major(found.stress.values, found.glued.values)
    first, second = (np.asarray(moment[f"{which}_id"]).astype(np.int64) for which in ("first", "second"))
    strong = np.nan_to_num(major) > mean
    links = _links(first, second, np.asarray(moment.branch, float), direction, strong, math.cos(angle))
    chain, sizes = _chains(links, len(major), int(least))
    of_contacts = _of_contacts(first, second, links, chain)
    columns = {
        "chain": ("grain", chain, "1", "number of the force chain, -1 for none"),
        "major_stress": ("grain", major, "Pa", "major principal stress, compression"),
        "direction": (("grain", "space"), direction, "1", "direction of the major stress"),
        "contact_chain": ("contact", of_contacts, "1", "force chain of which the contact is a link, -1 for none"),
        "chain_size": ("chain_number", sizes, "1", "number of grains of the chain"),
        "mean_stress": ((), mean, "Pa", "mean of the major principal stresses"),
    }
    named = {n: (dims, v, {"units": u, "long_name": text}) for n, (dims, v, u, text) in columns.items()}
    return found.assign(named).assign_attrs(title="Force chains")


def _check(angle: float, least: int) -> None:
    """InputError for an angle or a number of grains out of range."""
    if not (finite(angle) and 0.0 < angle < 0.5 * math.pi):
        raise InputError(f"angle = {shown(angle)}: must be > 0 and < pi/2 rad")
    if isinstance(least, bool) or not isinstance(least, int | np.integer) or least < 2:
        raise InputError(f"least = {shown(least)}: must be an integer >= 2, of grains in a chain")


def _major(tensor: Array, glued: npt.NDArray[np.bool_]) -> tuple[Array, Array, float]:
    """Major principal stresses (n,), their directions (n, D), and their mean over the mobile grains."""
    values, vectors = np.linalg.eigh(np.where(glued[:, None, None], 0.0, 0.5 * (tensor + tensor.swapaxes(1, 2))))
    major = np.where(glued, np.nan, values[:, -1])
    return major, vectors[:, :, -1], float(major[~glued].mean()) if (~glued).any() else math.nan


def _links(
    first: Integers, second: Integers, branch: Array, direction: Array, strong: npt.NDArray[np.bool_], least: float
) -> list[tuple[int, int]]:
    """Pairs of grains (lower id, higher id) that are linked; `least`: cosine of the greatest angle."""
    pair = np.flatnonzero((second >= 0) & strong[first] & strong[second])
    k, l = first[pair], second[pair]
    along = branch[pair] / np.linalg.norm(branch[pair], axis=1)[:, None]
    at_first, at_second = (np.einsum("ci,ci->c", along, direction[ids]) for ids in (k, l))
    aligned = np.flatnonzero((np.abs(at_first) >= least) & (np.abs(at_second) >= least))
    score = np.abs(at_first) + np.abs(at_second)
    taken: set[tuple[int, bool]] = set()
    links = []
    # The best aligned first; of equal ones that of the lower ids, for the same result on every machine.
    for row in aligned[np.lexsort([l[aligned], k[aligned], -np.round(score[aligned], 12)])]:
        ends = (int(k[row]), bool(at_first[row] > 0.0)), (int(l[row]), bool(at_second[row] < 0.0))
        if not taken.intersection(ends):
            taken.update(ends)
            links.append((ends[0][0], ends[1][0]))
    return links


def _chains(links: list[tuple[int, int]], count: int, least: int) -> tuple[Integers, Integers]:
    """Number of the chain of each grain, and number of grains of each chain."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.array(links, np.int64).reshape(-1, 2)
    joined = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    _, label = connected_components(joined, directed=False)
    size = np.bincount(label)
    kept, lowest = np.unique(label[size[label] >= least], return_index=True)
    kept = kept[np.argsort(lowest)]
    number = np.full(size.size, -1, np.int64)
    number[kept] = np.arange(kept.size)
    return number[label], size[kept]


def _of_contacts(first: Integers, second: Integers, links: list[tuple[int, int]], chain: Integers) -> Integers:
    """Chain of which each contact is a link, -1 for none; all contacts of a linked pair count."""
    linked = set(links)
    is_link = np.array([(int(k), int(l)) in linked for k, l in zip(first, second, strict=True)], bool)
    return np.where(is_link, chain[first], -1)
