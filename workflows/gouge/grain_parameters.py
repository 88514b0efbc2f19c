"""Parameters of grains in shear, of a layer or a cell, and of what acts between them."""

import dataclasses
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

import taichi_lsm as lsm
from workflows.common.parameter_files import listed
from workflows.common.parameter_problems import BrokenRules
from workflows.common.parameter_types import OtherNames
from workflows.common.parameters import Params as BaseParams
from workflows.common.refusals import in_terms_of
from workflows.gouge.expected_shear import expected
from workflows.gouge.labels import ROUND
from workflows.protocol.moments import checked_words, interval
from workflows.protocol.stage_tables import StageTable

if TYPE_CHECKING:
    from taichi_lsm.effects import Effect

PACKED = {2: 0.80, 3: 0.59}  # solid fraction of a consolidated layer, which ties its thickness to its grains
MOST_GRAINS = 10_000_000  # some 20 GB of state and lists
ROW = 1.0 - 1e-9  # of the strain from row to row
LARGE, LITTLE = 1.0, 100.0  # size [m] and stress [Pa] beyond which other units may be meant
FLAT = ("side_half_width", "face_flatness")  # parameters of flat sides (2D) and faces (3D)
SIDE = 0.7  # of a long side of an angular grain [diameters]
F32, ROUNDED = 6e-8, 0.01  # rounding of a radius, and the greatest share of an overlap that it may be
EFFECTS_HELP = "lsm list --effects shows what there is"
REPLACED = {  # parameters of the default effects, by the role of an effect that replaces one
    "elasticity": ("stiffness_number",),
    "damping": ("restitution",),
    "friction": ("friction", "tangential_ratio"),
    "bonds": ("bond_strength", "weibull_modulus"),
}


ROUND_WORDS = ("disc", "discs", "sphere", "spheres")  # understood in either dimension
Shape = Annotated[Literal["round", "angular"], OtherNames("round", ROUND_WORDS)]


def round_grains(word: str, dim: int) -> str | None:
    """What a word for round grains means in this dimension, where it is the other one's: "in 2D means discs"."""
    other = word in ROUND_WORDS and not ROUND[dim].startswith(word)
    return f"in {dim}D means {ROUND[dim]}" if other else None


class GrainParams(BaseParams):
    """Grains that are sheared, what acts between them and how a run is made: what layers and cells share."""

    without_result: ClassVar[frozenset[str]] = BaseParams.without_result | {
        *("profile", "keep_checkpoint", "checkpoint_seconds")
    }
    thickness_name: ClassVar[str]  # of the parameter that gives the height of the grains [mean diameters]

    dim: int = Field(default=2, ge=2, le=3, description="dimension of space [1]")
    shape: Shape = Field(default="round", description="grain shape; round: discs in 2D, spheres in 3D")
    smallest_diameter: float = Field(default=105e-6, ge=1e-9, le=1e3, description="least equivalent diameter [m]")
    largest_diameter: float = Field(default=149e-6, ge=1e-9, le=1e3, description="greatest equivalent diameter [m]")
    density: float = Field(default=2500.0, ge=1e-3, le=1e6, description="density of the grains [kg m-3]")
    normal_stress: float = Field(default=5e6, ge=1e-3, le=1e12, description="normal stress on the layer [Pa]")
    length: float | None = Field(
        default=None,
        ge=6,
        le=1e5,
        description="periodic length along the shear; none: 30 in 2D, 20 in 3D [mean diameters]",
    )
    width: float = Field(default=7.0, ge=4, le=1e4, description="periodic width, 3D only [mean diameters]")
    start: Literal["dense", "loose"] = Field(
        default="dense",
        description="how the grains lie before consolidation: packed, or in a tall pile in which none is near another",
    )
    grains: int | None = Field(
        default=None, ge=20, le=MOST_GRAINS, description="number of mobile grains; none: from thickness and length [1]"
    )
    friction: float = Field(default=0.5, ge=0, le=100, description="Coulomb coefficient between grains [1]")
    tangential_ratio: float = Field(default=0.5, ge=1e-6, le=1, description="tangential over normal stiffness [1]")
    restitution: float = Field(
        default=0.5, ge=0.01, le=1, description="coefficient of restitution of a normal impact [1]"
    )
    stiffness_number: float = Field(
        default=1000.0, ge=100, le=1e9, description="kappa = k/(P b) in 2D, k/(P d) in 3D [1]"
    )
    inertial_number: float = Field(default=1e-3, ge=1e-9, le=0.1, description="I = shear rate d sqrt(rho/P) [1]")
    corner_radius: float = Field(
        default=0.05, ge=0.01, le=0.25, description="corner radius of angular grains [equivalent diameters]"
    )
    side_half_width: float | None = Field(
        default=None,
        ge=1e-4,
        le=0.2,
        description="angle by which a side of an angular grain turns to either side of its normal, 2D only: the less, "
        "the flatter; none: 3 degrees, 0.0524 [rad]",
    )
    face_flatness: float | None = Field(
        default=None,
        ge=2,
        le=1e4,
        description="radius of the faces of an angular grain over its size, 3D only; none: 5, more where a face would "
        "stand out far [1]",
    )
    rows_per_strain: int = Field(
        default=100, ge=10, le=100_000, description="rows of run.nc per unit of shear strain [1]"
    )
    keep_checkpoint: bool = Field(
        default=False, description="keep the checkpoint of a complete run, so that it can be made longer"
    )
    checkpoint_seconds: float | None = Field(
        default=None,
        ge=0.01,
        le=1e6,
        description="wall-clock time between two checkpoints; none: a minute, or more where they take long [s]",
    )
    contacts: Annotated[list[str], AfterValidator(checked_words)] = Field(
        default=[],
        description="when contacts.nc is written, with all contacts of the moment: every=STRAIN, at the begin of the "
        "shear and at the first row beyond each multiple of this shear strain; events, at the first and the last row "
        "of every slip event and at rows in which bonds broke; stages, at the end of each; end, of the last; or "
        "several of these; none: there is no such file",
    )
    snapshots: Annotated[list[str], AfterValidator(checked_words)] = Field(
        default=[],
        description="when grains.nc is written, besides the begin and the ends of stages of which it always has those "
        "that are not repeated: every=STRAIN, events or stages, as for contacts; none: every=1, of breakable grains "
        "every=0.25",
    )
    profile: bool = Field(default=False, description="print the run time of each stage of a step")
    effects: list[dict] = Field(
        default=[],
        description="effects that are added to elasticity, damping and friction, or replace one of the same kind: "
        "tables with name = NAME and its parameters in SI units, see lsm list --effects",
    )
    step_safety: float = Field(default=0.4, ge=1e-3, le=0.8, description="time step over the largest stable one [1]")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = [*self.problems_of_grains(), *self.problems_of_shear(), *self.problems_of_output()]
        if problems:
            raise BrokenRules(problems)
        return self

    def problems_of_grains(self) -> Iterator[str]:
        """Contradictions among sizes, shapes and stiffness of the grains."""
        if self.smallest_diameter > self.largest_diameter:
            low, high = self.smallest_diameter, self.largest_diameter
            yield f"--smallest-diameter {low:g} m is above --largest-diameter {high:g} m: no size is left"
        least = self.least_stiffness_number
        if self.shape == "angular" and self.stiffness_number < least and not self.effects:
            yield (
                f"--stiffness-number {self.stiffness_number:g} must be >= {least:g} with --corner-radius "
                f"{self.corner_radius:g}, or overlaps exceed a tenth of what corners can carry; raise one of the two"
            )
        if self.precision == "f32" and not self.effects:
            yield from self._rounded_sides()

    def _rounded_sides(self) -> Iterator[str]:
        """Sides so flat that rounding their radius in f32 shifts them by too large a share of an overlap, d/kappa."""
        idle, most = self.idle(), ROUNDED / (F32 * self.stiffness_number)  # radius [diameters]
        half, flatness = self.side_half_width, self.face_flatness
        why = (
            f"with --precision f32 and --stiffness-number {self.stiffness_number:g}, or rounding shifts the surface by "
            "more than a hundredth of an overlap"
        )
        if half is not None and "side_half_width" not in idle and half < 0.5 * SIDE / most:
            yield f"--side-half-width {half:g}: must be >= {0.5 * SIDE / most:.3g} {why}; raise it, or give f64"
        if flatness is not None and "face_flatness" not in idle and flatness > most:
            yield f"--face-flatness {flatness:g}: must be <= {most:.3g} {why}; lower it, or give f64"

    def problems_of_shear(self) -> Iterator[str]:
        """Contradictions in how the grains are sheared, which each experiment has its own parameters of; none here."""
        yield from ()

    def problems_of_output(self) -> Iterator[str]:
        """Moments that never come."""
        for name in ("contacts", "snapshots"):
            words = getattr(self, name)
            if "events" in words and not self.has_events:
                yield (
                    f"--{name} {','.join(words)}: there are no events, which need a load spring, a stage with "
                    "shear_stress or --breakable; leave out events"
                )
            if interval(words) and not self.sheared:
                yield f"--{name} {','.join(words)}: nothing is sheared; leave out every"
        if "end" in self.snapshots:
            yield f"--snapshots {','.join(self.snapshots)}: the end always has one; leave out end"

    @property
    def sheared(self) -> bool:
        """Whether there is a shear strain at all."""
        return True

    @property
    def has_events(self) -> bool:
        """Whether there may be slip events, or bonds that break."""
        return False

    def shear_tables(self) -> list[StageTable]:
        """The stages after the consolidation; every experiment has its own."""
        raise NotImplementedError

    def how_far(self) -> str:
        """What says how far the grains are sheared, in words of the options."""
        return "the stages"

    @property
    def staged(self) -> bool:
        """Whether the shear has stages of different kinds: rows tell the repetition of theirs, and slip within it."""
        return True

    def time_of_stages(self) -> float:
        """Expected time of the stages after the consolidation [s]."""
        return expected(self)[1] * self.inertial_time

    @property
    def pushed(self) -> bool:
        """Whether a shear stress pushes the grains in any of the stages."""
        return any(table.shear_stress is not None for table in self.shear_tables())

    def remarks(self) -> Iterator[str]:
        """Sizes and stresses that look as if they were given in other units."""
        if self.largest_diameter > LARGE:
            yield f"--largest-diameter {self.largest_diameter:g}: sizes are in m, 149e-6 is 149 um"
        if self.normal_stress < LITTLE:
            yield f"--normal-stress {self.normal_stress:g}: stresses are in Pa, 5e6 is 5 MPa"
        for name in ("contacts", "snapshots"):
            every = interval(getattr(self, name))
            by_strain = any(table.sample is None for table in self.shear_tables())
            if every and by_strain and every * self.rows_per_strain < ROW:
                yield (
                    f"--{name} every={every:g}: there is one at each row at most, and rows are "
                    f"{1.0 / self.rows_per_strain:g} apart; raise --rows-per-strain"
                )

    def idle(self) -> dict[str, str]:
        """Fields that have no effect: of the other dimension or shape, or of an effect that another one replaces."""
        found = {}
        if self.grains is not None:
            found[self.thickness_name] = (
                f"beside --grains {self.grains}, from which the {self.thickness_name.rpartition('_')[2]} follows"
            )
        if self.dim == 2:
            found |= dict.fromkeys(("width", "face_flatness"), "with --dim 2")
        else:
            found["side_half_width"] = "with --dim 3"
        if self.shape != "angular":
            found |= dict.fromkeys(("corner_radius", *FLAT), f"with --shape {self.shape}")
        fields = type(self).model_fields
        for effect in self.given_effects():
            replaced = [name for name in REPLACED.get(effect.role or effect.phase, ()) if name in fields]
            found |= dict.fromkeys(replaced, f"beside the effect {effect.name}, which replaces its own")
        return found

    def read_as(self, name: str, word: str) -> str | None:
        """That a word for the round grains of the other dimension means those of this one."""
        return round_grains(word, self.dim) if name == "shape" else None

    def given_effects(self) -> list["Effect"]:
        """The effects of `effects`; InputError if they are wrong."""
        if not self.effects:
            return []  # and Taichi, which effects need, is not imported
        with in_terms_of("effects", EFFECTS_HELP + self._misplaced()):
            return lsm.effects.make_effects(self.effects)

    def _misplaced(self) -> str:
        """Where parameters of the experiment belong that stand in a table of an effect, "" if none does."""
        effects, keys = lsm.effects.find_effects(), set()
        for table in self.effects:
            effect = effects.get(str(table.get("name")))
            own = {field.name for field in dataclasses.fields(effect)} if effect else set()  # pyright: ignore[reportArgumentType]  effects are dataclasses
            keys |= (table.keys() - own) & type(self).model_fields.keys()
        return f"; {listed(sorted(keys))}, of the experiment, must stand above the first [[effects]]" if keys else ""

    def resolved(self) -> dict[str, Any]:
        """Values by field; of the thickness, length and number of grains those that stand for none."""
        thickness, lengths = self.layer
        sizes = {self.thickness_name: thickness / self.diameter, "length": lengths[0] / self.diameter}
        return super().resolved() | sizes

    @property
    def flat_sides(self) -> dict[str, Any]:
        """How flat sides or faces of angular grains are, as an argument of what makes them; {}: as these make them."""
        given = {"side_half_width": self.side_half_width} if self.dim == 2 else {"flatness": self.face_flatness}
        return {name: value for name, value in given.items() if value is not None}

    @property
    def given_thickness(self) -> float | None:
        """Height of the grains that is given [mean diameters]; None: that of the dimension or of the grains."""
        raise NotImplementedError

    @property
    def pieces_of_one(self) -> int:
        """Of how many pieces a grain consists [1]."""
        return 1

    @property
    def pieces_across(self) -> float:
        """Diameter of a grain over that of one of its pieces [1]."""
        return self.pieces_of_one ** (1.0 / self.dim)

    @property
    def least_stiffness_number(self) -> float:
        """Least stiffness number with which overlaps of angular grains stay within what their corners carry [1]."""
        return 5.0 / self.corner_radius * self.pieces_across

    @property
    def layer(self) -> tuple[float, tuple[float, ...]]:
        """(thickness, periodic lengths) of the grains [m]; as given, by dimension, or the thickness of the grains."""
        thickness = self.given_thickness or (24.0 if self.dim == 2 else 15.0)
        length = self.length or (30.0 if self.dim == 2 else 20.0)
        across = () if self.dim == 2 else (self.width,)
        if self.grains is not None:
            one = np.pi / 4.0 if self.dim == 2 else np.pi / 6.0  # of a grain of the mean diameter
            thickness = self.grains * one / (PACKED[self.dim] * float(np.prod((length, *across))))
        return thickness * self.diameter, tuple(size * self.diameter for size in (length, *across))

    @property
    def area(self) -> float:
        """Area [m2] of the layer along the shear; in 2D the out-of-plane depth b is d."""
        return float(np.prod(self.layer[1])) * (self.diameter if self.dim == 2 else 1.0)

    @property
    def diameter(self) -> float:
        """Mean diameter d [m]."""
        return 0.5 * (self.smallest_diameter + self.largest_diameter)

    @property
    def inertial_time(self) -> float:
        """Inertial time d sqrt(rho/P) [s]: in which the stress moves a grain by about its diameter."""
        return self.diameter * float(np.sqrt(self.density / self.normal_stress))

    @property
    def stiffness(self) -> float:
        """Normal stiffness k [N m-1] of the contacts: of the stiffness number, or of the effects that replace it.

        In 2D the out-of-plane depth b is d.
        """
        elastic = [effect for effect in self.given_effects() if effect.role == "elasticity"]
        if elastic:
            return lsm.contact_stiffness(elastic, self.normal_stress, self.diameter)
        return self.stiffness_number * self.normal_stress * self.diameter
