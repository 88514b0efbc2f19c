"""Contacts side by side: the numbers of a block of contacts in local arrays, one short loop for each stage.

The compiler turns a loop into SIMD instructions only if it can prove that what the loop writes is nothing it reads.
It cannot for fields, which all hang on pointers in memory, but it can for local arrays. So a block of pairs is worked
on in stages: fields are gathered into lanes, the arithmetic runs over lanes alone, and results are scattered back.
Laws stay scalar functions of one contact. The bits do not depend on the lanes: each holds one contact.
"""

from ..core.runtime import current, ti

WIDTH = 32  # pairs of a block: enough to fill the SIMD lanes, few enough to compile soon
AXIS = tuple(f"_{axis}" for axis in range(64))  # endings of the names of components
PAD = 8  # loops over lanes run to a multiple, so that no scalar remainder is left; lanes beyond hold stale numbers


def block_width():
    """Pairs of a block; one on a GPU, where neighbouring threads are the lanes."""
    return WIDTH if current().arch == "cpu" else 1


def block_type(scalars, vectors, integers):
    """Taichi struct of local arrays: real numbers `scalars`, {name: components} `vectors`, and `integers`.

    Every component of a vector is an array of its own: the compiler sees that those do not overlap either.
    """
    width = block_width()
    real, whole = ti.types.vector(width, current().real), ti.types.vector(width, ti.i32)
    members = dict.fromkeys(scalars, real)
    members |= {name + AXIS[axis]: real for name, size in vectors.items() for axis in range(size)}
    return ti.types.struct(**members, **dict.fromkeys(integers, whole))


@ti.func
def put(block: ti.template(), name: ti.template(), i, a: ti.template()):
    """Write vector `a` to place i of the lanes `name`."""
    for axis in ti.static(range(a.n)):
        block[name + AXIS[axis]][i] = a[axis]


@ti.func
def get(block: ti.template(), name: ti.template(), i, size: ti.template()):
    """Vector of `size` components at place i of the lanes `name`."""
    return ti.Vector([block[name + AXIS[axis]][i] for axis in range(size)])


@ti.func
def padded(count):
    """Lanes to work on so that `count` of them are done: a multiple that the compiler can see."""
    result = count
    if ti.static(block_width() >= PAD):
        result = (count + (PAD - 1)) // PAD * PAD
    return result
