"""Profiles of velocity across a sheared layer: the width of the shear band, and the slip at the platens."""

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from ..core.errors import InputError
from .input_checks import rising, series
from .steady_means import Estimate

if TYPE_CHECKING:
    from xarray import Dataset

Array = npt.NDArray[np.float64]
Form = Literal["error-function", "exponential"]
LEAST_HEIGHTS = 6
# Between the heights where the velocity has covered a tenth and nine tenths of its change, over w and over the decay.
TENTHS = {"error-function": 2.563103131, "exponential": 2.197224577}  # 2 sqrt(2) erfinv(0.8), ln 9
NO_SHARE = Estimate(math.nan, math.nan, math.nan, math.nan, "nothing moves")
WIDEST = 2.0  # over the height of the profile: beyond it no band is seen


class ShearBand(NamedTuple):
    """Shear band of a profile of velocity.

    Parameters
    ----------
    width
        Height [m] within which the velocity changes from a tenth to nine tenths of its whole change.
    centre
        Height [m] of the greatest shear rate: the middle of an error function, the platen of an exponential.
    velocity_change
        The whole change of velocity across the band, upper less lower [m s-1].
    chi_square
        Sum of the squared residuals over the squared errors [1], nan where the errors are not known: about
        degrees_of_freedom if the form describes the profile.
    degrees_of_freedom
        Number of heights less that of the fitted parameters.
    form
        "error-function" or "exponential".
    share
        The change over the velocity of the platens against each other [1], as far as it is known; else over the change
        from the lowest height to the highest one.
    """

    width: Estimate
    centre: Estimate
    velocity_change: Estimate
    chi_square: float
    degrees_of_freedom: int
    form: Form
    share: Estimate


class BoundarySlip(NamedTuple):
    """Slip between the platens and the grains next to them.

    Parameters
    ----------
    bottom, top
        Velocity of the grains at the reference plane less that of the bottom platen, and that of the top platen less
        that of the grains [m s-1]: positive where the layer slips.
    share
        Sum of the two over the velocity of the platens against each other [1].
    """

    bottom: Estimate
    top: Estimate
    share: Estimate


def shear_band(
    height: "npt.ArrayLike | Dataset",
    velocity: npt.ArrayLike | None = None,
    errors: npt.ArrayLike | None = None,
    form: Form = "error-function",
) -> ShearBand:
    """Width of the shear band by a fit to the profile of velocity.

    v(y) = v_m + (dv/2) erf((y - y_c)/(sqrt(2) w)), a band within the layer, whose shear rate is a Gauss curve of
    standard deviation w                                                                                (1)
    v(y) = v_0 + dv (1 - exp(-(y - y_0)/l)), a band at a platen at the lowest (l > 0) or the highest y (l < 0)   (2)

    Parameters
    ----------
    height
        What `profiles` gives, best of many snapshots, of which heights without grains are left out. Or (n,) y [m],
        rising.
    velocity
        (n,) velocity along the shear [m s-1], averaged over many snapshots; not beside profiles.
    errors
        (n,) its standard errors [m s-1]; without them all heights count alike and residuals tell the error.
    form
        "error-function" is right for bands away from walls, "exponential" for those at a wall. Fit both where it is not
        known and compare chi-square.

    Returns
    -------
    ShearBand
        Errors by the curvature of the sum of squares, for heights whose velocities are independent. The error of the
        width is nan, with the reason, if it is beyond twice the height of the profile: such a profile is a straight
        line, and shear fills the layer.

    Raises
    ------
    InputError
        For fewer than 6 heights, another form, errors that are not positive, and a fit that does not end.

    References
    ----------
    Fenistein & van Hecke (2003), doi:10.1038/425256a, for (1); Mueth et al. (2000), doi:10.1038/35019032, for (2).
    """
    from scipy.optimize import curve_fit

    height, velocity, whole = _of_profiles(height, velocity)
    v = series("velocity", velocity, LEAST_HEIGHTS)
    y = series("height", height, LEAST_HEIGHTS, v.size)
    rising("height", y)
    if form not in TENTHS:
        raise InputError(f"form: {form!r}, must be one of {', '.join(TENTHS)}")
    sigma = None if errors is None else _positive(errors, v.size)
    span = float(y[-1] - y[0])
    shape, start = _starts(y, v, span)[form]
    try:
        found, covariance = curve_fit(shape, y, v, start, sigma, sigma is not None, maxfev=4000)
    except RuntimeError as error:
        raise _no_end(form, error) from None
    freedom, deviations, scale = v.size - len(found), np.sqrt(np.diag(covariance)), TENTHS[form]
    student = math.inf if sigma is not None else float(freedom)
    width = Estimate(scale * abs(float(found[-1])), scale * float(deviations[-1]), v.size, student)
    if not width.mean < WIDEST * span:
        width = Estimate(width.mean, math.nan, v.size, student, "the profile is nearly straight: shear fills the layer")
    change, centre = _change_and_centre(form, y, found, deviations, student)
    chi_square = math.nan if sigma is None else float(np.sum(((v - shape(y, *found)) / sigma) ** 2))
    share = _share(change, float(v[-1] - v[0]) if whole is None else whole)
    return ShearBand(width, centre, change, chi_square, freedom, form, share)


def _no_end(form: str, error: Exception) -> InputError:
    """Why a fit does not end, and what to try."""
    other = next(name for name in TENTHS if name != form)
    return InputError(
        f"velocity: the fit of form = {form!r} does not end, as of a profile that is nearly straight, without a "
        f"band ({error}); try form = {other!r}"
    )


def _positive(errors: npt.ArrayLike, size: int) -> Array:
    """Errors (n,) > 0."""
    sigma = series("errors", errors, LEAST_HEIGHTS, size)
    if not np.all(sigma > 0):
        raise InputError(f"errors: {sigma.min():g}, must be > 0 m/s; leave errors out where they are not known")
    return sigma


def _share(change: Estimate, whole: float) -> Estimate:
    """A change over the whole one."""
    if whole == 0.0:
        return NO_SHARE
    return change._replace(mean=change.mean / whole, standard_error=change.standard_error / abs(whole))


def _of_profiles(
    height: "npt.ArrayLike | Dataset", velocity: npt.ArrayLike | None
) -> tuple[npt.ArrayLike, npt.ArrayLike, float | None]:
    """Heights, velocities along the shear, and the velocity of the platens against each other if it is known."""
    if hasattr(height, "data_vars"):
        profiles: Dataset = height  # pyright: ignore[reportAssignmentType]
        if velocity is not None or not {"height", "velocity"} <= set(profiles.variables):
            raise InputError("profiles: must be what lsm.profiles gives, without velocities beside it")
        along = np.asarray(profiles.velocity, float)[:, 0]
        there = np.isfinite(along)
        whole = None
        if "platen_velocity" in profiles:
            whole = float(np.diff(np.asarray(profiles.platen_velocity)[:, 0])[0])
        return np.asarray(profiles.height, float)[there], along[there], whole or None
    if velocity is None:
        raise InputError("velocity: None, must be the velocity at each height, or give lsm.profiles alone")
    return height, velocity, None  # pyright: ignore[reportReturnType]


def _change_and_centre(
    form: Form, y: Array, found: Array, deviations: Array, student: float
) -> tuple[Estimate, Estimate]:
    """Change of velocity [m s-1] and height [m] of a band by the parameters of its fit."""
    if form == "error-function":
        change, centre = (Estimate(float(found[i]), float(deviations[i]), y.size, student) for i in (1, 2))
        return change, centre
    at_bottom = found[-1] > 0
    change = Estimate(float(found[1] if at_bottom else -found[1]), float(deviations[1]), y.size, student)
    return change, Estimate(float(y[0] if at_bottom else y[-1]), 0.0, y.size, student)


def _starts(y: Array, v: Array, span: float) -> dict:
    """{form: (function, parameters at the start)}; the last parameter is the length."""
    from scipy.special import erf

    middle = float(np.interp(0.5, np.linspace(0, 1, v.size), np.sort(v)))
    steepest = int(np.argmax(np.abs(np.gradient(v, y))))
    at_top = steepest > v.size // 2

    def error_function(x: Array, mean: float, change: float, centre: float, w: float) -> Array:
        return mean + 0.5 * change * erf((x - centre) / (math.sqrt(2.0) * w))

    def exponential(x: Array, plateau: float, change: float, length: float) -> Array:
        # From the platen at which the band lies: the lowest height for a positive length, else the highest one.
        from_platen = np.abs(x - (y[-1] if at_top else y[0]))
        return plateau - change * np.exp(-from_platen / abs(length))

    change = float(v[-1] - v[0])
    sign = -1.0 if at_top else 1.0
    return {
        "error-function": (error_function, (middle, change, float(y[steepest]), 0.2 * span)),
        "exponential": (exponential, (float(v[0] if at_top else v[-1]), sign * change, sign * 0.2 * span)),
    }


def boundary_slip(
    height: npt.ArrayLike,
    velocity: npt.ArrayLike,
    planes: tuple[float, float],
    platen_velocities: tuple[float, float],
    reach: float,
) -> BoundarySlip:
    """Slip at both platens: the velocity of the grains nearby, continued to the reference planes by a straight line.

    Parameters
    ----------
    height, velocity
        (n,) profile as for `shear_band`.
    planes
        Heights [m] of the lower and the upper reference plane.
    platen_velocities
        Velocities [m s-1] of the lower and the upper platen along the shear.
    reach
        Distance [m] from each plane within which heights are taken, such as 3 d: at least 3 heights.

    Returns
    -------
    BoundarySlip
        Errors are those of the lines by their residuals, with Student's t.

    Raises
    ------
    InputError
        For too few heights within reach, and platens at the same velocity.
    """
    v = series("velocity", velocity, LEAST_HEIGHTS)
    y = series("height", height, LEAST_HEIGHTS, v.size)
    rising("height", y)
    relative = platen_velocities[1] - platen_velocities[0]
    if relative == 0.0:
        raise InputError(f"platen_velocities: both {platen_velocities[0]:g} m/s, must differ")
    ends = [_at_plane(y, v, plane, reach) for plane in planes]
    bottom = ends[0]._replace(mean=ends[0].mean - platen_velocities[0])
    top = ends[1]._replace(mean=platen_velocities[1] - ends[1].mean)
    error = math.hypot(bottom.standard_error, top.standard_error) / abs(relative)
    freedom = min(bottom.degrees_of_freedom, top.degrees_of_freedom)
    share = Estimate((bottom.mean + top.mean) / relative, error, math.nan, freedom)
    return BoundarySlip(bottom, top, share)


def _at_plane(y: Array, v: Array, plane: float, reach: float) -> Estimate:
    """Velocity that a line through the heights within reach has at the plane."""
    near = np.abs(y - plane) <= reach
    count = int(np.sum(near))
    if count < 3:
        raise InputError(f"reach: {reach:g} m, {count} heights lie within it of {plane:g} m, at least 3 are needed")
    shapes = np.column_stack([np.ones(count), y[near] - plane])
    coefficients, *_ = np.linalg.lstsq(shapes, v[near], rcond=None)
    variance = float(np.sum((v[near] - shapes @ coefficients) ** 2)) / (count - 2)
    error = math.sqrt(variance * np.linalg.inv(shapes.T @ shapes)[0, 0])
    return Estimate(float(coefficients[0]), error, float(count), count - 2.0)
