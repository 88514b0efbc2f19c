"""Non-convex meshes become unions whose parts overlap inside only."""

import numpy as np
import pytest
import trimesh

from taichi_lsm.core.errors import InputError
from taichi_lsm.shapes import non_convex_mesh
from taichi_lsm.shapes.solid_parts import grown_solids
from tests.shapes.non_convex_bodies import L_CORNERS, bone_mesh, cross_outline, horseshoe_outline, prism, scan_mesh


def boxes_of_an_l():
    """The two boxes of an L 0.8 high, side by side."""
    low, high = ((0, 0, 0), (0.8, 0, 0)), ((0.8, 2.5, 0.8), (2.2, 0.8, 0.8))
    return [trimesh.creation.box(bounds=pair) for pair in zip(low, high, strict=True)]


def test_the_plane_between_two_boxes_is_a_cut_and_the_smaller_one_is_drawn_in():
    small, large = grown_solids(boxes_of_an_l()[::-1], 24, 0.03)
    assert small.cut.sum() == 1 and large.cut.sum() == 0  # the side of the large box is outside in its upper half
    assert small.normal[small.cut][0] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    # Bottom, top and the end of the L lie on the same planes as those of the large box; the re-entrant face does not.
    assert small.tilted.sum() == 3 and not large.tilted.any()


def test_an_l_of_two_boxes_keeps_its_volume_and_is_nowhere_stiffer():
    shape, misfit = non_convex_mesh(prism(L_CORNERS, 0.8), parts=boxes_of_an_l())
    print("l", misfit)
    assert shape.measure == pytest.approx(np.pi / 6, rel=1e-6) and misfit.parts == 2
    assert abs(misfit.measure) < 0.01 and abs(misfit.inertia) < 0.02
    assert misfit.least_stiffness >= 0.9 and misfit.greatest_stiffness <= 1.1
    assert misfit.doubled_share == 0.0 and misfit.least_radius == pytest.approx(0.03)


BODIES = {
    "cross": lambda: prism(cross_outline(), 1.0),
    "horseshoe": lambda: prism(horseshoe_outline(), 0.5),
    "bone": bone_mesh,
    "scan 1": lambda: scan_mesh(1),
    "scan 2": lambda: scan_mesh(2),
    "scan 3": lambda: scan_mesh(3),
}


@pytest.mark.validate
@pytest.mark.parametrize("name", BODIES)
def test_non_convex_meshes_keep_volume_and_inertia_and_are_hardly_stiffer(name):
    pytest.importorskip("coacd")
    _, misfit = non_convex_mesh(BODIES[name](), **({"concavity": 0.02, "faces": 30} if name == "bone" else {}))
    print(name, misfit)
    assert abs(misfit.measure) < 0.01 and abs(misfit.inertia) < 0.02
    assert misfit.least_stiffness >= 0.9 and misfit.doubled_share < 5e-3


def test_wrong_parts_of_meshes_are_refused():
    with pytest.raises(InputError, match="concavity = 0"):
        non_convex_mesh(prism(L_CORNERS, 0.8), concavity=0.0)
    with pytest.raises(InputError, match="faces = 3"):
        non_convex_mesh(prism(L_CORNERS, 0.8), 3)
