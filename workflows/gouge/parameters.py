"""Parameters of one shear experiment on a layer of gouge: to a strain, through stages, or to a wanted error."""

from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import Field

from workflows.gouge.layer_parameters import LayerParams
from workflows.protocol.stage_tables import StageTable, Until, problems_of_stages

LEAST_ROWS = 12  # of the steady state: the correlation of fewer cannot be estimated
STICK_SLIP = 4  # times as much strain lies between two rows while a layer on a spring slips
SHEAR = "shear"  # the stage in which friction is measured, where no stages are given
STRAIN: Any = Field(default=5.0, gt=0, le=1e4, description="shear strain to reach [1]")


def steady_from_field(rows: str) -> Any:
    """The parameter `steady_from`, of which `rows` says how far below the strain it must lie."""
    words = "shear strain from which on friction and the other means are taken, as those of the steady state; so far "
    return Field(default=1.0, ge=0, le=1e4, description=f"{words}below --strain that {rows} [1]")


class Params(LayerParams):
    """One shear experiment on a layer of gouge."""

    stages: list[StageTable] = Field(
        default=[],
        description="stages of the shear in place of one at the velocity of the inertial number: tables [[stages]] "
        "with name, velocity, until and more, see docs/protocols.md",
    )
    strain: float = STRAIN
    steady_from: float = steady_from_field(f"{LEAST_ROWS} rows are left, {STICK_SLIP * LEAST_ROWS} with a load spring")
    target_error: float | None = Field(
        default=None,
        ge=1e-6,
        le=1,
        description="wanted half-width of the 95 % interval of the mean friction; sets strain, seeds and step; "
        "none: they are as given [1]",
    )

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "layer_thickness": 10.0,
            "width": 4.0,
            "inertial_number": 1e-2,
            "strain": 2.0,
            "step_safety": 0.6,
        },
        "demo": {"strain": 3.0},
        "standard": {},
        "reference": {"length": 60.0, "inertial_number": 3e-4, "strain": 10.0, "stiffness_number": 1e4},
    }

    def problems_of_shear(self) -> Iterator[str]:
        """Contradictions among the strain to reach, the steady state and the target error."""
        yield from problems_of_stages(self.stages)
        if self.pushed and self.spring:
            yield (
                "stages with shear_stress are not for a layer on a load spring, which has no part in a test at an "
                "imposed stress: leave out the stiffness of the spring, or give velocity"
            )
        if self.stages and self.target_error is not None:
            yield "--target-error plans the strain itself: leave out either it or [[stages]]"
        if self.target_error is None and not self.stages and self.strain < self.steady_from + self.least_steady:
            slips = f", which lie up to {STICK_SLIP} times as far apart where a layer on a spring slips"
            yield (
                f"--strain {self.strain:g} must be >= --steady-from {self.steady_from:g} + {self.least_steady:g}: "
                f"the steady state needs {LEAST_ROWS} rows{slips if self.spring else ''}"
            )
        if self.target_error and (self.breakable or self.spring or self.effects or self.normal_stiffness):
            yield (
                "--target-error is for layers of whole grains at an imposed velocity and a constant normal stress, "
                "with the default effects"
            )

    def idle(self) -> dict[str, str]:
        """As of the layer; a target error and stages make parameters of the shear idle."""
        found = super().idle()
        if self.target_error is not None:
            found |= dict.fromkeys(
                ("strain", "step_safety", "profile", "keep_checkpoint", "checkpoint_seconds"),
                "with --target-error, which makes the runs",
            )
        if self.stages:
            found |= dict.fromkeys(
                ("strain", "steady_from"), "beside [[stages]], which say how far the layer is sheared"
            )
        return found

    def shear_tables(self) -> list[StageTable]:
        """The stages that are given, or one at the velocity of the inertial number."""
        return self.stages or [StageTable(name=SHEAR, velocity=1.0, until=Until(strain=self.strain))]

    def how_far(self) -> str:
        """The option that says how far the layer is sheared, with its value; or that stages do."""
        return super().how_far() if self.stages else f"--strain {self.strain:g}"

    @property
    def staged(self) -> bool:
        """Whether stages are given."""
        return bool(self.stages)

    @property
    def least_steady(self) -> float:
        """Least strain of the steady state that is averaged [1]."""
        return LEAST_ROWS / self.rows_per_strain * (STICK_SLIP if self.spring else 1)
