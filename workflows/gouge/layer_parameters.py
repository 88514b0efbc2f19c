"""Parameters of a layer of gouge, which all experiments on layers share, and the rules between them."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from pydantic import Field

from workflows.gouge.expected_shear import short_stages
from workflows.gouge.grain_parameters import FLAT, PACKED, GrainParams

LEAST_THICKNESS = 8  # of a layer [mean diameters]
LEAST_INERTIA = 0.05  # of the top platen, in layer masses; docs/decisions/0007
SPRINGS = ("load_stiffness", "load_stiffness_area", "load_stiffness_ratio")  # ways to give the spring of the load point


class LayerParams(GrainParams):
    """A layer of gouge, what acts in it and what drives it: the parameters that experiments on layers share."""

    thickness_name: ClassVar[str] = "layer_thickness"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (SPRINGS,)

    layer_thickness: float | None = Field(
        default=None,
        ge=LEAST_THICKNESS,
        le=1e4,
        description="thickness of the layer; none: 24 in 2D, 15 in 3D, or that of the grains [mean diameters]",
    )
    platen_roughness: float = Field(
        default=1.0,
        ge=0.3,
        le=3.0,
        description="diameter of the platens' grains over that of the mobile ones: the roughness of the walls [1]",
    )
    breakable: bool = Field(default=False, description="angular grains are bonded pieces that can break")
    pieces: int = Field(default=7, ge=2, le=40, description="pieces of a breakable grain [1]")
    bond_strength: float = Field(
        default=20.0, ge=1e-6, le=1e6, description="tensile strength of the bonds over the normal stress [1]"
    )
    weibull_modulus: float | None = Field(
        default=None,
        ge=1,
        le=1e3,
        description="Weibull modulus of the scatter of the strengths of bonds, with --seed; none: no scatter [1]",
    )
    load_stiffness: float | None = Field(
        default=None,
        ge=1e-9,
        le=1e15,
        description="stiffness of the spring that pulls the top platen, also to be given in one of the next two ways; "
        "none: the velocity of the platen is imposed [N m-1]",
    )
    load_stiffness_area: float | None = Field(
        default=None,
        ge=1e-9,
        le=1e24,
        description="the same over the area of the layer, as of a testing machine: 1e12 is 1 MPa/um [Pa m-1]",
    )
    load_stiffness_ratio: float | None = Field(
        default=None,
        ge=1e-9,
        le=1e9,
        description="the same over the shear stiffness of the layer, that of columns of contacts through its "
        "thickness: far below 1 the machine is soft and the layer may slip in events [1]",
    )
    normal_stiffness: float | None = Field(
        default=None,
        ge=1e-9,
        le=1e24,
        description="stiffness of a spring behind the servo over the area of the layer: by so much the normal stress "
        "rises as the layer thickens, from when shear begins on; none: it is constant [Pa m-1]",
    )

    def problems_of_grains(self) -> Iterator[str]:
        """Contradictions among the grains, in what breaks, at the platens and of the spring of the load point."""
        yield from super().problems_of_grains()
        if self.breakable and self.shape != "angular":
            yield f"--breakable needs --shape angular, not --shape {self.shape}"
        if self.dim == 3 and self.platen_roughness > 1.0:
            yield f"--platen-roughness {self.platen_roughness:g} must be <= 1 in 3D: mobile grains would pass"
        springs = [name for name in SPRINGS if getattr(self, name)]
        if len(springs) > 1:
            options = " and ".join("--" + name.replace("_", "-") for name in springs)
            yield f"{options} are ways to give the stiffness of one load spring: give one of them"

    def remarks(self) -> Iterator[str]:
        """What may be a mistake: other units, a layer too thin to have a bulk, a stage shorter than its first row."""
        yield from super().remarks()
        thickness = self.layer[0] / self.diameter
        if self.grains is not None and thickness < LEAST_THICKNESS:
            yield (
                f"--grains {self.grains}: the layer is {thickness:.2g} mean diameters thick, less than the "
                f"{LEAST_THICKNESS} that --layer-thickness allows: between its platens it has no bulk"
            )
        for name, row, end in short_stages(self):
            yield (
                f"stage {name}: it is to end after {end:.2g} inertial times, its first row after {row:.2g}, and a "
                "stage ends with a row; give it a later end, or closer rows by sample"
            )

    def idle(self) -> dict[str, str]:
        """As of grains; and parameters of grains that break."""
        found = super().idle()
        if not self.breakable:
            found |= dict.fromkeys(("pieces", "bond_strength", "weibull_modulus"), "without --breakable")
        else:
            found |= dict.fromkeys(FLAT, "with --breakable, whose pieces have sides of their own")
        return found

    @property
    def has_events(self) -> bool:
        """Whether there may be slip events, or bonds that break."""
        return self.breakable or self.spring is not None or self.pushed

    @property
    def given_thickness(self) -> float | None:
        """Thickness of the layer that is given [mean diameters]."""
        return self.layer_thickness

    @property
    def pieces_of_one(self) -> int:
        """Of how many pieces a grain consists [1]."""
        return self.pieces if self.breakable else 1

    @property
    def shear_stiffness(self) -> float:
        """Shear stiffness [N m-1] of the layer: columns side by side of h/d tangential springs in series.

        k_t (A/d^(D-1)) / (h/d), in 2D k_t L/h.
        """
        thickness, lengths = self.layer
        per_column = self.tangential_ratio * self.stiffness * self.diameter / thickness
        return per_column * float(np.prod(lengths)) / self.diameter ** len(lengths)

    @property
    def spring(self) -> float | None:
        """Stiffness [N m-1] of the spring that pulls the top platen, in whichever way it is given; None without one."""
        if self.load_stiffness_area:
            return self.load_stiffness_area * self.area
        if self.load_stiffness_ratio:
            return self.load_stiffness_ratio * self.shear_stiffness
        return self.load_stiffness

    @property
    def spring_period(self) -> float | None:
        """Period [t_i] of the top platen on the spring that pulls it, 2 pi sqrt(M/K)/t_i; None without a spring.

        M is about the mass of one layer of grains, or LEAST_INERTIA of that of the layer if that is more.
        """
        if self.spring is None:
            return None
        one = np.pi / 4.0 if self.dim == 2 else np.pi / 6.0  # filled by grains that lie side by side
        glued = one * self.platen_roughness * self.diameter
        filled = max(glued, LEAST_INERTIA * PACKED[self.dim] * self.layer[0])  # height of solid [m]
        return 2.0 * float(np.pi * np.sqrt(self.density * self.area * filled / self.spring)) / self.inertial_time
