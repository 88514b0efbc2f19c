"""Exponentials, logarithms and cube roots made of sums, products and bits, which a compiler turns into vector code.

A loop becomes SIMD instructions only if nothing in it calls a library: one `ti.exp` keeps all of the loop scalar. The
functions here have no branch and no call, and short chains of operations that wait for each other. Their numbers have
the precision of the process, f64 or f32, and err by less than two times its epsilon, cube roots by less than four.
"""

import math
from typing import Any, NamedTuple

from .runtime import current, ti

ROUGH_EXP, ROUGH_LOG = 4, 2  # terms
CUBE_ROOT = (1.0, 1.0 / 3.0, 2.0 / 9.0, 14.0 / 81.0, 35.0 / 243.0)  # (1 - e)^(-1/3)


class _Format(NamedTuple):
    """A binary format, and the coefficients that its precision asks for."""

    real: Any
    whole: Any  # integers of the same width
    mantissa: int  # bits
    bias: int  # of the exponent
    root_half: int  # bits of sqrt(1/2): mantissas are taken between it and sqrt(2)
    ln_2: tuple[float, float]  # in two parts; the first one has so few bits that its multiples are exact
    least_exponent: float  # e to it is a normal number
    exp: tuple[float, ...]  # (e^r - 1 - r)/r^2, |r| <= ln(2)/2
    log: tuple[float, ...]  # 2/3 + 2/5 s^2 + ..., s^2 < 0.03
    least_cube: float
    cube_root_start: int  # bits less a third of those of x: x^(-1/3) to 4 percent


def _taylor_of_exp(terms: int) -> tuple[float, ...]:
    return tuple(1.0 / math.factorial(n + 2) for n in range(terms))


# Coefficients of least error of fdlibm (Sun Microsystems, 1993): e_log.c, e_logf.c.
_F64 = _Format(
    real=ti.f64,
    whole=ti.i64,
    mantissa=52,
    bias=1023,
    root_half=0x3FE6A09E667F3BCD,
    ln_2=(6.93147180369123816490e-01, 1.90821492927058770002e-10),
    least_exponent=-708.0,
    least_cube=1e-290,
    cube_root_start=0x553ED4FDF3B645A2,
    exp=_taylor_of_exp(12),
    log=(
        6.666666666666735130e-01,
        3.999999999940941908e-01,
        2.857142874366239149e-01,
        2.222219843214978396e-01,
        1.818357216161805012e-01,
        1.531383769920937332e-01,
        1.479819860511658591e-01,
    ),
)
_F32 = _Format(
    real=ti.f32,
    whole=ti.i32,
    mantissa=23,
    bias=127,
    root_half=0x3F3504F3,
    ln_2=(6.9314575195e-01, 1.4286067653e-06),
    least_exponent=-87.0,
    least_cube=1e-30,
    cube_root_start=0x54A1D5AD,
    exp=_taylor_of_exp(6),
    log=(0.66666662693, 0.40000972152, 0.28498786688, 0.24279078841),
)


def _format() -> _Format:
    """Format of the numbers of this process."""
    return _F64 if current().precision == "f64" else _F32


@ti.func
def polynomial(x, c: ti.template()):
    """c_0 + c_1 x + c_2 x^2 + ...: even and odd terms apart, so that of n sums few wait for another one."""
    if ti.static(len(c) == 1):
        return ti.static(c[0])
    else:
        square = x * x
        even, odd = ti.static(c[0::2], c[1::2])
        return polynomial(square, even) + x * polynomial(square, odd)


@ti.func
def at_least(x, least):
    """The larger one of two numbers that are no nan; `ti.max` takes three instructions."""
    return ti.select(x > least, x, least)


@ti.func
def at_most(x, most):
    """The smaller one of two numbers that are no nan."""
    return ti.select(x < most, x, most)


@ti.func
def exp(x, rough: ti.template() = False):
    """e^x of x < 709 (88 in f32); below -708 (-87) that of this number; rough: to 4e-6."""
    form, terms = ti.static(_format(), ROUGH_EXP if rough else None)
    whole = ti.static(1.5 * 2.0**form.mantissa)  # has no fraction: what is added to it is rounded
    power = at_least(ti.cast(x, form.real), form.least_exponent)
    shifted = power * 1.4426950408889634 + whole
    n = shifted - whole
    r = (power - n * ti.static(form.ln_2[0])) - n * ti.static(form.ln_2[1])
    y = 1.0 + (r + r * r * polynomial(r, form.exp[:terms]))
    # n, which the last bits of `shifted` hold, is added to the exponent of y
    exponent = ti.bit_cast(shifted, form.whole) << form.mantissa
    return ti.bit_cast(ti.bit_cast(y, form.whole) + exponent, form.real)


@ti.func
def log(x, rough: ti.template() = False):
    """Natural logarithm of a normal number x > 0, -709.4 (-88) of 0; rough: to 4e-6."""
    form, terms = ti.static(_format(), ROUGH_LOG if rough else None)
    one = ti.static(form.bias << form.mantissa)
    bits = ti.bit_cast(ti.cast(x, form.real), form.whole) + form.whole(one - form.root_half)
    # x = 2^n (1 + f), sqrt(1/2) <= 1 + f < sqrt(2)
    fraction = (bits & form.whole((1 << form.mantissa) - 1)) + form.whole(form.root_half)
    f = ti.bit_cast(fraction, form.real) - 1.0
    n = ti.cast(ti.cast(bits >> form.mantissa, ti.i32) - form.bias, form.real)
    # ln(1 + f) = f - f^2/2 + s (f^2/2 + R), s = f/(2 + f), R = 2 s^2/3 + 2 s^4/5 + ...
    s = f / (2.0 + f)
    square = s * s
    half = 0.5 * f * f
    rest = s * (half + square * polynomial(square, form.log[:terms])) + n * ti.static(form.ln_2[1])
    return (n * ti.static(form.ln_2[0]) + f) - (half - rest)


@ti.func
def cube_root(x):
    """x^(1/3) of x >= 0; what is below 1e-290 (1e-30) counts as this."""
    form = ti.static(_format())
    a = at_least(ti.cast(x, form.real), form.least_cube)
    # y = x^(-1/3) to 4 percent from a third of the exponent: 1/3 = 5/16 * 17/16 * 257/256 to 2e-5
    bits = ti.bit_cast(a, form.whole)
    third = (bits >> 2) + (bits >> 4)
    third += third >> 4
    third += third >> 8
    y = ti.bit_cast(form.whole(form.cube_root_start) - third, form.real)
    # With e = 1 - x y^3 the exact result is y (1 - e)^(-1/3): the series of the power, twice
    for terms in ti.static((5, 3)):
        e = 1.0 - a * y * y * y
        y = y * polynomial(e, CUBE_ROOT[:terms])
    return a * y * y
