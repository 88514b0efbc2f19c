"""Variables of run.nc: what is recorded of a sheared layer, or of a sheared cell, row by row."""

from ..core.schema import Variable


def series(name: str, units: str, long_name: str, dtype: str = "f64", dims: tuple[str, ...] = ("time",)) -> Variable:
    """Schema row of a time series."""
    return Variable(name, dims, dtype, units, long_name)


def energy_rows(moved: str) -> list[Variable]:
    """Schema rows of the budget, of the contacts and of the inertial number; `moved`: what has kinetic energy too."""
    return [
        series("translational_energy", "J", f"kinetic energy of translation, {moved}"),
        series("rotational_energy", "J", "kinetic energy of rotation"),
        series("elastic_energy", "J", "energy stored in the contacts"),
        series("dissipated_energy", "J", "energy dissipated since the start, by effect", dims=("time", "effect")),
        series("external_work", "J", "work of the drives since the start"),
        series(
            "energy_residual",
            "J",
            "external work less changes of kinetic and elastic energy less dissipation",
        ),
        series(
            "work_throughput",
            "J",
            "integral of the absolute power of shear and of normal load since shear began",
        ),
        series("contact_count", "1", "contacts with at least one mobile grain"),
        series("coordination_number", "1", "mean number of contacts of a mobile grain"),
        series("sliding_fraction", "1", "share of the contacts that slide, by their friction law"),
        series("deepest_overlap", "1", "greatest overlap over its limit"),
        series("inertial_number", "1", "mean shear rate since the last row times diameter times sqrt(density/stress)"),
    ]


ALWAYS = [
    series(
        "shear_strain",
        "1",
        "shear strain: sum of displacement increments over the thickness at each, since shear began",
    ),
    series("displacement", "m", "shear displacement of the top platen against the bottom platen"),
    series("friction", "1", "shear stress over normal stress in the bulk of the layer"),
    series("shear_stress", "Pa", "shear stress in the bulk, at least 3 diameters from the platens"),
    series("normal_stress", "Pa", "normal stress in the bulk, compression positive"),
    series(
        "platen_shear_stress",
        "Pa",
        "shear stress on the top platen, mean over all steps since the last row",
    ),
    series(
        "platen_normal_stress",
        "Pa",
        "normal stress on the top platen, mean over all steps since the last row",
    ),
    series(
        "platen_normal_rms",
        "Pa",
        "root mean square deviation of the normal stress on the platen from its target",
    ),
    series("layer_thickness", "m", "distance between the reference planes of the platens"),
    series("porosity", "1", "share of the layer not filled by mobile grains"),
    series(
        "plate_velocity",
        "m s-1",
        "velocity of the top platen against the bottom platen along the shear, mean since the last row",
    ),
    series("instantaneous_plate_velocity", "m s-1", "the same at the time of the row"),
    series(
        "load_point_velocity",
        "m s-1",
        "velocity imposed on the load point, or on the platen if no spring pulls it",
    ),
    *energy_rows("platens included"),
]
BONDS = [
    series("bond_count", "1", "bonds that have not broken", dtype="i32"),
    series("fracture_area", "m2", "area of the bonds that have broken; the new surface is twice as large"),
    series("fragment_count", "1", "mobile grains that no intact bond joins, or groups that bonds join", dtype="i32"),
]
STRETCH = series("spring_stretch", "m", "stretch of the spring between load point and top platen")
IMPOSED = series("imposed_shear_stress", "Pa", "shear stress imposed on the top platen; missing where its velocity is")
SERVO = series("servo_stress", "Pa", "normal stress that the servo keeps, with the spring behind it")


def layer_rows(
    bonded: bool = False, sprung: bool = False, pushed: bool = False, confined: bool = False
) -> list[Variable]:
    """Schema rows of run.nc; of a scene with bonds, and of one whose top platen has other drives than the usual ones.

    sprung: a spring pulls it; pushed: a shear stress may be imposed on it; confined: a spring is behind its servo.
    """
    return [*ALWAYS, *BONDS * bonded, *[STRETCH] * sprung, *[IMPOSED] * pushed, *[SERVO] * confined]


def cell_rows() -> list[Variable]:
    """Schema rows of run.nc of a sheared cell."""
    return [
        series("shear_strain", "1", "shear strain of the cell since shear began"),
        series("displacement", "m", "displacement of the image above the cell along the shear"),
        series("friction", "1", "shear stress over normal stress of the cell"),
        series("shear_stress", "Pa", "shear stress of the cell, mean of the samples of the row"),
        series("normal_stress", "Pa", "normal stress of the cell across the shear, compression positive"),
        series("normal_stress_along", "Pa", "normal stress of the cell along the shear, compression positive"),
        series("cell_normal_stress", "Pa", "normal stress across the shear, mean over all steps since the last row"),
        series("cell_normal_rms", "Pa", "root mean square deviation of that normal stress from its target"),
        series("cell_height", "m", "height of the cell"),
        series("porosity", "1", "share of the cell not filled by grains"),
        series("shear_rate", "s-1", "rate of shear, mean since the last row"),
        *energy_rows("relative to the mean flow, that of the cell's height included"),
    ]
