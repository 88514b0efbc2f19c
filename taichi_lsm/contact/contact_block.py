"""Contacts side by side: the numbers of a block of contacts in local arrays, one short loop for each stage.

The compiler turns a loop into SIMD instructions only if it can prove that the loop reads nothing that it writes. For
fields, which are all reached through pointers, it cannot; for local arrays it can. So a block of pairs goes through
stages: fields are gathered into the block, the arithmetic runs over the block alone, and results are scattered back.
Effects stay scalar functions of one contact. The bits do not depend on the blocks: each place holds one contact.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from ..core.fields import rotation_size
from ..core.runtime import current, ti
from ..effects.base import LENGTHS

WIDTH = 32  # pairs of a block: enough to fill SIMD registers, few enough to compile fast
AXIS = tuple(f"_{axis}" for axis in range(64))  # endings of the names of components
PAD = 8  # loops over a block run to a multiple of it, which leaves no scalar remainder; places beyond hold old numbers


def block_width() -> int:
    """Pairs of a block; one on a GPU, where neighbouring threads run side by side."""
    return WIDTH if current().arch == "cpu" else 1


def block_type(scalars: Iterable[str], vectors: Mapping[str, int], integers: Iterable[str]) -> Any:
    """Taichi struct of local arrays of `block_width` numbers.

    Parameters
    ----------
    scalars
        Names of the arrays of real numbers.
    vectors
        Number of components of each array of vectors. Every component is an array of its own: the compiler sees that
        those do not overlap either.
    integers
        Names of the arrays of integers.

    Returns
    -------
    Taichi struct type
        One member per array; component c of a vector `name` is the member `name + AXIS[c]`.
    """
    width = block_width()
    real, whole = ti.types.vector(width, current().real), ti.types.vector(width, ti.i32)
    members = dict.fromkeys(scalars, real)
    members |= {name + AXIS[axis]: real for name, size in vectors.items() for axis in range(size)}
    return ti.types.struct(**members, **dict.fromkeys(integers, whole))


def contact_block_type(spec: Any, needs: Iterable[str], channels: int, crosses_seams: bool) -> Any:
    """Struct of what a block holds of each contact: only what the effects of a scene need.

    Parameters
    ----------
    spec : KernelSpec
        What the scene needs.
    needs
        Names of the optional inputs of its effects.
    channels
        Channels of dissipated energy.
    crosses_seams
        Whether features of the last step are compared with those of this one.

    Returns
    -------
    Taichi struct type
        Among its members: branch [m], from centre to centre; normal; depth [m]; velocity [m s-1] of the second grain
        relative to the first, at the contact for shaped grains, of the centres for spheres; lost [J], a component per
        channel; memory, a component per number of the history; previous_status, that of the last step. World frame.
    """
    dim, rotation = spec.dim, rotation_size(spec.dim)
    scalars = ["depth", "inverse_mass"]
    vectors = {"branch": dim, "normal": dim, "velocity": dim, "force": dim, "lost": channels, "memory": spec.history}
    integers = ["slot", "previous_status", "near", "status"]
    scalars += [name for name in LENGTHS if name in needs]
    # Spheres: arms follow from radii and depth, so that their stages need no arms; shaped grains store them.
    if not spec.shaped:
        scalars += ["radius_sum"]
    if spec.rotates:
        vectors |= {"torque_k": rotation, "torque_l": rotation}
        if spec.shaped:
            relative = "relative_angular_velocity"
            scalars += ["normal_angular_velocity"]
            vectors |= {"arm_k": dim, "arm_l": dim, relative: rotation if relative in needs else 0}
            vectors |= {"normal_change": dim if dim == 3 else 0}
        else:
            scalars += ["radius_k", "radius_l"]
            vectors |= {"omega_k": rotation, "omega_l": rotation}
    if crosses_seams:
        integers += ["feature_k", "feature_l"]
        vectors |= {"last_normal": dim if spec.remembers_normal else 0}
    return block_type(scalars, vectors, integers)


@ti.func
def put(block: ti.template(), name: ti.template(), i, a: ti.template()):
    """Write the vector `a` to place i of the arrays `name`."""
    for axis in ti.static(range(a.n)):
        block[name + AXIS[axis]][i] = a[axis]


@ti.func
def get(block: ti.template(), name: ti.template(), i, size: ti.template()):
    """Vector of `size` components at place i of the arrays `name`."""
    return ti.Vector([block[name + AXIS[axis]][i] for axis in range(size)])


@ti.func
def padded(count):
    """Number of places, at least `count`, that a loop runs over: a multiple of PAD, as the compiler can see."""
    result = count
    if ti.static(block_width() >= PAD):
        result = (count + (PAD - 1)) // PAD * PAD
    return result
