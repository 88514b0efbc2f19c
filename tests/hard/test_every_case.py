"""Every hard case, in its quick form, respects its bound."""

import pytest

from tests.helpers import scenes
from workflows import hard

EXPENSIVE = {  # to compile or to run: `make validate` runs them
    "any_list",
    "brushing_edges",
    "chain_that_snaps",
    "cohesive_pair",
    "coincident_centres",
    "corner_on_corner",
    "corners",
    "creep_of_the_friction",
    "creep_of_the_thickness",
    "crossed_edges",
    "elastic_impacts",
    "face_on_face",
    "far_from_the_origin",
    "flat_on_flat",
    "friction_of_ten",
    "frictionless_oblique_impact",
    "gas_of_stars",
    "giant_among_dwarfs",
    "grazing_seams",
    "half_a_radian_per_step",
    "inertia_ratio",
    "interlocked",
    "into_a_notch",
    "jammed_column_energy",
    "jammed_column_rests",
    "middle_axis",
    "momentum_of_the_pieces",
    "needle",
    "needle_tips",
    "needles_in_a_crowd",
    "one_grain",
    "orientations_stay_unit",
    "overlapping_start",
    "parallel_edges",
    "parallel_faces_do_not_turn",
    "plate",
    "polydisperse_shear",
    "random_angular",
    "random_discs",
    "relaxed_start",
    "rolling_to_rest",
    "sharp_corner",
    "sizes_of_grains",
    "servo_on_one_contact",
    "sliding_reversed",
    "smallest_restitution",
    "soft_spring",
    "spread_in_open_space",
    "spring_too_stiff",
    "stack_at_rest",
    "static_above_dynamic",
    "step_of_a_pair_in_a_crowd",
    "stiffest_spring",
    "tiny_cycles",
    "unit_quaternions",
    "velocity_jump",
    "very_stiff",
}
CASES = {case.name: (kind, case) for kind in hard.modules() for case in hard.cases_of(kind)}
RUNS = [
    pytest.param(case, id=f"{kind}-{name}", marks=[pytest.mark.validate] if name in EXPENSIVE else [])
    for name, (kind, case) in CASES.items()
]


@pytest.mark.parametrize("case", RUNS)
def test_a_hard_case_respects_its_bound(bench, case):
    if scenes.PRECISION == "f32" and case.excepted:
        pytest.skip(case.excepted)
    assert case.run(bench) <= case.bound_in(scenes.PRECISION)


def test_what_is_expensive_is_a_case():
    assert set(CASES) > EXPENSIVE
