"""Parameters of a homogeneously sheared cell of grains, and the rules between them."""

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from workflows.gouge.grain_parameters import MOST_GRAINS, GrainParams
from workflows.gouge.parameters import LEAST_ROWS, SHEAR, STRAIN, steady_from_field
from workflows.protocol.stage_tables import StageTable, Until

LEAST_HEIGHT = 8  # of a cell [mean diameters]


class CellParams(GrainParams):
    """Grains in a periodic cell that is sheared homogeneously, at constant normal stress or constant volume."""

    thickness_name: ClassVar[str] = "cell_height"

    normal_stress: float = Field(
        default=5e6, ge=1e-3, le=1e12, description="normal stress that the height of the cell keeps [Pa]"
    )
    cell_height: float | None = Field(
        default=None,
        ge=LEAST_HEIGHT,
        le=1e4,
        description="height of the consolidated cell; none: 24 in 2D, 15 in 3D, or that of the grains [mean diameters]",
    )
    grains: int | None = Field(
        default=None, ge=20, le=MOST_GRAINS, description="number of grains; none: from height and length [1]"
    )
    solid_fraction: float | None = Field(
        default=None,
        ge=0.1,
        le=0.99,
        description="share of the cell that grains fill, at which its height is held in the shear; none: the normal "
        "stress is held [1]",
    )
    strain: float = STRAIN
    steady_from: float = steady_from_field(f"{LEAST_ROWS} rows are left")

    presets: ClassVar[dict[str, dict]] = {
        "smoke": {
            "length": 16.0,
            "cell_height": 16.0,
            "width": 5.0,
            "inertial_number": 1e-2,
            "strain": 2.0,
            "step_safety": 0.6,
        },
        "demo": {"inertial_number": 3e-3, "strain": 3.0},
        "standard": {},
        "reference": {
            "length": 60.0,
            "cell_height": 48.0,
            "inertial_number": 3e-4,
            "strain": 10.0,
            "stiffness_number": 1e4,
        },
    }

    def problems_of_shear(self) -> Iterator[str]:
        """Contradictions between the strain to reach and the steady state."""
        least = LEAST_ROWS / self.rows_per_strain
        if self.strain < self.steady_from + least:
            yield (
                f"--strain {self.strain:g} must be >= --steady-from {self.steady_from:g} + {least:g}: "
                f"the steady state needs {LEAST_ROWS} rows"
            )

    def shear_tables(self) -> list[StageTable]:
        """One stage, at the shear rate of the inertial number."""
        return [StageTable(name=SHEAR, velocity=1.0, until=Until(strain=self.strain))]

    @property
    def given_thickness(self) -> float | None:
        """Height of the cell that is given [mean diameters]."""
        return self.cell_height

    def how_far(self) -> str:
        """What says how far the cell is sheared."""
        return f"--strain {self.strain:g}"

    @property
    def staged(self) -> bool:
        """There are no stages of different kinds."""
        return False
