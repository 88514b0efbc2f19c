"""Area or volume, centre of mass and second moments of bodies bounded by spherical patches.

With x the surface point, n its outward normal and dim the dimension, the divergence theorem gives

    measure = 1/dim int x.n dS,
    int x dV = 1/(dim + 1) int x (x.n) dS,
    int x x^T dV = 1/(dim + 2) int x x^T (x.n) dS.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .geometry import even_directions, unit_normals

DIRECTIONS = 20_000  # that sample a sphere, to about 1e-4 of its area
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


def surface_of_patches(p: NDArray, r: NDArray, e: NDArray, alpha: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Points (k, dim), normals (k, dim) and weights (k,) of all patches; of full ones only what others do not hide.

    p (patches, dim): centres; r (patches,): radii; e (patches, dim): axes; alpha (patches,) [rad]: half-angles.
    """
    if np.all(alpha == np.pi):
        return _exposed(p, r)
    if p.shape[1] == 2:
        n = unit_normals(np.arctan2(e[:, 1], e[:, 0])[:, None] + alpha[:, None] * _NODES)
        weight = (r * alpha)[:, None] * _WEIGHTS
    else:
        # Gauss nodes in the height along the axis times 16 even angles round it, which measure a cap in each variable.
        height = np.cos(alpha)[:, None] + 0.5 * (1.0 - np.cos(alpha))[:, None] * (_NODES + 1.0)
        azimuth = 2.0 * np.pi * np.arange(16) / 16
        across = np.array([np.linalg.svd(axis[None])[2][1:] for axis in e])
        ring = (
            np.cos(azimuth)[:, None, None] * across[:, None, None, 0]
            + np.sin(azimuth)[:, None, None] * across[:, None, None, 1]
        )
        ring = ring.reshape(len(p), 1, 16, 3)
        n = height[..., None, None] * e[:, None, None] + np.sqrt(1.0 - height**2)[..., None, None] * ring
        n = n.reshape(len(p), -1, 3)
        area = (r**2 * (1.0 - np.cos(alpha)))[:, None] * 0.5 * _WEIGHTS
        weight = np.repeat(area * 2.0 * np.pi / 16, 16, axis=1)
    x = p[:, None] + r[:, None, None] * n
    return x.reshape(-1, p.shape[1]), n.reshape(-1, p.shape[1]), weight.ravel()


def _exposed(p: NDArray, r: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """The outer surface of a union of discs (exact up to the corners between nodes) or of spheres (to about 1e-3)."""
    points, normals, weights = [], [], []
    n = even_directions(DIRECTIONS)
    for i in range(len(p)):
        others = np.arange(len(p)) != i
        if p.shape[1] == 3:
            x = p[i] + r[i] * n
            free = np.all(np.linalg.norm(x[:, None] - p[others], axis=2) >= r[others], axis=1)
            points.append(x[free])
            normals.append(n[free])
            weights.append(np.full(free.sum(), 4.0 * np.pi * r[i] ** 2 / DIRECTIONS))
            continue
        for low, high in _free_arcs(p[i], r[i], p[others], r[others]):
            normal = unit_normals(0.5 * (low + high) + 0.5 * (high - low) * _NODES)
            points.append(p[i] + r[i] * normal)
            normals.append(normal)
            weights.append(0.5 * r[i] * (high - low) * _WEIGHTS)
    return np.concatenate(points), np.concatenate(normals), np.concatenate(weights)


def _free_arcs(p: NDArray, r: float, others: NDArray, radii: NDArray) -> list[tuple[float, float]]:
    """Arcs (low, high) [rad] of a circle that lie in none of the other discs, none longer than a quarter."""
    away = others - p
    distance = np.linalg.norm(away, axis=1)
    if np.any(distance <= radii - r):
        return []
    cutting = (distance < r + radii) & (distance > r - radii)
    away, distance, radii = away[cutting], distance[cutting], radii[cutting]
    half = np.arccos(np.clip((distance**2 + r**2 - radii**2) / (2.0 * distance * r), -1.0, 1.0))
    low = np.mod(np.arctan2(away[:, 1], away[:, 0]) - half, 2.0 * np.pi)
    # Walk once round the circle, from 0 to 2 pi: an arc is free from what the hidden ones reached to the next of them.
    hidden = sorted([(a + s, a + s + 2.0 * h) for a, h in zip(low, half) for s in (-2.0 * np.pi, 0.0)])
    arcs, reached = [], 0.0
    for a, b in [*hidden, (2.0 * np.pi, 2.0 * np.pi)]:
        if a > reached:
            count = int(np.ceil((min(a, 2.0 * np.pi) - reached) / (0.5 * np.pi)))
            edge = np.linspace(reached, min(a, 2.0 * np.pi), count + 1)
            arcs += list(pairwise(edge))
        reached = max(reached, b)
    return arcs


def surface_moments(x: NDArray, n: NDArray, weight: NDArray) -> tuple[float, NDArray, NDArray]:
    """(area or volume, centre of mass, second moments int x x^T) from points, normals and weights of the surface."""
    dim = x.shape[1]
    flux = np.sum(x * n, axis=1) * weight
    measure = flux.sum() / dim
    centroid = (flux[:, None] * x).sum(axis=0) / ((dim + 1) * measure)
    second = np.einsum("k,ki,kj->ij", flux, x, x) / (dim + 2)
    return float(measure), centroid, second
