"""Rate-and-state friction after a velocity step: in closed form at an imposed velocity, as an ODE with a spring.

Friction is mu = mu_0 + a ln(V/V_0) + b ln(V_0 theta/D_c)                                            (1)
with the ageing law theta' = 1 - V theta/D_c (Dieterich 1979)                                        (2)
or the slip law theta' = -(V theta/D_c) ln(V theta/D_c) (Ruina 1983).                                (3)

References
----------
Dieterich (1979), doi:10.1029/JB084iB05p02161; Ruina (1983), doi:10.1029/JB088iB12p10359; Rice & Ruina (1983),
doi:10.1115/1.3167042; Marone (1998), doi:10.1146/annurev.earth.26.1.643.
"""

import math
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import require_positive

Law = Literal["ageing", "slip"]
LAWS: tuple[Law, ...] = get_args(Law)
ODE_TOLERANCE = 1e-9  # of the friction, relative to a and b


def log_state_after_step(
    slip: npt.ArrayLike, log_state: npt.ArrayLike, slip_distance: npt.ArrayLike, law: Law = "ageing"
) -> npt.NDArray[np.float64]:
    """State in closed form: ln(V theta/D_c) at a slip x after the velocity became V, from its value just after that.

    Parameters
    ----------
    slip
        x [m] >= 0, of any shape that broadcasts with the others.
    log_state
        ln(V theta_0/D_c) [1] with the new V and the state theta_0 of the step; 0 in the steady state.
    slip_distance
        D_c [m] > 0.
    law
        "ageing": V theta/D_c = 1 + (V theta_0/D_c - 1) exp(-x/D_c), (2) at constant V;                         (4)
        "slip": ln(V theta/D_c) = ln(V theta_0/D_c) exp(-x/D_c), (3) at constant V.                             (5)

    Returns
    -------
    array
        ln(V theta/D_c) [1].

    Raises
    ------
    InputError
        For another law.
    """
    faded = np.exp(-np.asarray(slip, float) / slip_distance)
    if known_law(law) == "slip":
        return np.asarray(log_state) * faded
    return np.log1p(np.expm1(log_state) * faded)


def friction_after_step(
    slip: npt.ArrayLike,
    v_before: float,
    v_after: float,
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    slip_distance: npt.ArrayLike,
    law: Law = "ageing",
) -> npt.NDArray[np.float64]:
    """Friction less the steady one of `v_before`, when the velocity of slip jumps to `v_after` at slip 0.

    With r the ratio of the velocities and f(x) of (4) or (5), f(0) = ln r:
    mu - mu_before = 0 for x < 0, (a - b) ln r + b f(x) for x >= 0                                              (6)

    Parameters
    ----------
    slip
        x [m] since the step, negative before it.
    v_before, v_after
        Velocities [m s-1] > 0, of which the first has lasted to the steady state.
    a, b
        Direct and evolution effect [1].
    slip_distance
        D_c [m] > 0.
    law
        "ageing" or "slip".

    Returns
    -------
    array
        Difference of friction [1], of the shape to which the arguments broadcast.
    """
    require_positive(v_before=v_before, v_after=v_after)
    step = math.log(v_after / v_before)
    x = np.asarray(slip, float)
    state = log_state_after_step(np.maximum(x, 0.0), step, slip_distance, law)
    return np.where(x < 0.0, 0.0, (np.asarray(a) - b) * step + np.asarray(b) * state)


def spring_slider(
    load_slip: npt.ArrayLike,
    v_before: float,
    v_after: float,
    a: float,
    b: float,
    slip_distance: float,
    stiffness: float,
    law: Law = "ageing",
) -> npt.NDArray[np.float64]:
    """Friction less the steady one of `v_before`, when the load point of a spring jumps to `v_after`: quasi-static.

    The spring carries what friction resists, d mu/dx = k (1 - V/V_load) with x the slip of the load point; V follows
    from (1), theta from (2) or (3) (Rice & Ruina 1983). Solved as an ODE in x for mu and ln(V_before theta/D_c).

    Parameters
    ----------
    load_slip
        (n,) x [m] of the load point since the step, rising, negative before it.
    v_before, v_after
        Velocities of the load point [m s-1] > 0.
    a, b
        Direct and evolution effect [1], a > 0.
    slip_distance
        D_c [m] > 0.
    stiffness
        k [m-1] > 0: stiffness over normal force. Below (b - a)/D_c sliding is unstable and inertia, which is left out,
        would matter.
    law
        "ageing" or "slip".

    Returns
    -------
    array
        (n,) difference of friction [1].

    Raises
    ------
    InputError
        For values out of range, and for a spring so soft that slip runs away.
    """
    from scipy.integrate import solve_ivp

    require_positive(v_before=v_before, v_after=v_after, a=a, slip_distance=slip_distance, stiffness=stiffness)
    ages, ratio = known_law(law) == "ageing", v_after / v_before
    x = np.asarray(load_slip, float)
    after = x[x > 0.0]
    friction = np.zeros_like(x)
    if not after.size:
        return friction

    def rates(_: float, y: npt.NDArray) -> list[float]:
        """Slopes along x of mu and of psi = ln(V_before theta/D_c)."""
        log_velocity = min((y[0] - b * y[1]) / a, 600.0)  # of V/V_before; beyond any velocity that a solution reaches
        velocity = math.exp(log_velocity)
        ageing = math.exp(-y[1]) - velocity
        state = ageing if ages else -velocity * (log_velocity + y[1])
        return [stiffness * (1.0 - velocity / ratio), state / (ratio * slip_distance)]

    end, tolerance = float(after[-1]), ODE_TOLERANCE * max(abs(a), abs(b))
    solved = solve_ivp(rates, (0.0, end), [0.0, 0.0], "LSODA", after, rtol=1e-9, atol=tolerance)
    if not solved.success:
        raise InputError(f"stiffness: {stiffness:g} m-1, slip runs away; must be above {(b - a) / slip_distance:g} m-1")
    friction[x > 0.0] = solved.y[0]
    return friction


def known_law(law: str) -> Law:
    """`law`, or an InputError if there is none of that name."""
    for known in LAWS:
        if law == known:
            return known
    raise InputError(f"law: {law!r}, must be one of {', '.join(LAWS)}")
