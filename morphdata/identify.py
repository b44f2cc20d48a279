"""What POST /identify takes and what an identification results in."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, create_model

from morphdata.aircraft import EXAMPLE_AIRCRAFT, Aircraft
from morphdata.base import Document
from morphdata.execution import Request, SpreadExecution
from morphdata.faults import Fault
from morphdata.flight import EXAMPLE_FLIGHT, Flight
from morphdata.identifiable import IDENTIFIABLE, Identifiable, corrections
from morphdata.lattice import Lattice, Start, StepS
from morphdata.links import (
    MAX_WINGS,
    AskedLinks,
    LinksPerWing,
    SurfaceKey,
    shown_links,
    shown_per_wing,
    to_choose,
    with_links,
)
from morphdata.measurement import Measurement, absent_channels, foreign_channels
from morphdata.options import MODEL, SEARCH, VEHICLE, Option
from morphdata.pairs import links_by_name, links_faults, own_lift_faults
from morphdata.parameters import parameters_in
from morphdata.renamed import RENAMED, both_spellings, current_name
from morphdata.samples import EXAMPLE_SAMPLE, InlineSample, Sample
from morphdata.search import SwarmSearch, WarmStart
from morphdata.uncertainty import UncertaintySettings
from morphdata.vehicle import (
    flexible_wing_faults,
    model_surfaces_faults,
    sliding_faults,
    start_faults,
    trim_drive_faults,
)

MAX_SAMPLES = 64
MAX_TOTAL_ROWS = 200_000
MAX_DECADES = 12.0  # of bounds: more is no knowledge at all, and spoils a logarithmic search
MIN_EVOLUTION = 4  # models of a generation of CMA-ES: of fewer the best half is no sample

if TYPE_CHECKING:
    Correction = str
else:
    Correction = Annotated[
        Literal[corrections()],
        WithJsonSchema({"type": "string", "enum": both_spellings(corrections())}),
    ]
Method = Literal["hybrid", "least_squares", "cma", "pso"]
AUTO_LINKS = (1, 2, 3, 4, 5, 6)  # numbers of links per wing that "auto" tries, in this order
Range = Annotated[
    list[Annotated[float, Field(ge=-1e15, le=1e15)]],
    Field(min_length=2, max_length=2, description="[low, high], low below high."),
]


class _Bounds(Document):
    """What the bounds of all parameters have in common."""

    def given(self) -> dict[str, tuple[float, float]]:
        """Collect the bounds that are given, SI units."""
        return {name: (low, high) for name, (low, high) in self.model_dump(exclude_none=True).items()}

    def faults(self) -> Iterator[Fault]:
        """Check that each pair rises, is physical and can be searched."""
        limits = {each.name: each for each in IDENTIFIABLE}
        for name, pair in self.given().items():
            yield from _bound_faults(name, *pair, limits[name])


if TYPE_CHECKING:
    Bounds = _Bounds
else:  # type checkers see no fields that come from a list
    Bounds = create_model(
        "Bounds",
        __base__=_Bounds,
        __doc__="Where the search may look; what is left out gets bounds from beam theory around the "
        "physical guess.",
        **{
            each.name: (Range | None, Field(default=None, description=each.bounds_description))
            for each in IDENTIFIABLE
        },
    )


def _bound_faults(name: str, low: float, high: float, limit: Identifiable) -> Iterator[Fault]:
    if low >= high:
        yield Fault(
            "range_upside_down",
            f"The lower bound {low:g} is not below the upper bound {high:g}.",
            f"/{name}/0",
            "Give [low, high] with low < high.",
        )
    elif limit.positive and low <= 0.0:
        yield Fault(
            "bound_not_positive",
            f"{name} is searched on a logarithmic scale; {low:g} has no logarithm.",
            f"/{name}/0",
            "Give a small positive lower bound, or leave the bounds out: beam theory gives them.",
        )
    elif low < limit.low or high > limit.high:
        yield Fault(
            "bound_out_of_range",
            f"[{low:g}, {high:g}] exceeds the physical range [{limit.low:g}, {limit.high:g}].",
            f"/{name}/{0 if low < limit.low else 1}",
            "Narrow the bounds, or leave them out: they follow from beam theory.",
        )
    elif low > 0.0 and math.log10(high / low) > MAX_DECADES:
        yield Fault(
            "bound_too_wide",
            f"[{low:g}, {high:g}] spans {math.log10(high / low):.0f} decades.",
            f"/{name}/1",
            f"Narrow it to {MAX_DECADES:g} decades, or leave the bounds out: beam theory gives them.",
        )


def _current_corrections(given: Any) -> Any:
    """Take old names of corrections, also next to their new ones, as results list them."""
    if not (isinstance(given, list) and all(isinstance(name, str) for name in given)):
        return given
    present = set(given)
    return [current_name(name) for name in given if name not in RENAMED or RENAMED[name] not in present]


class SearchedModel(Document):
    """A model whose parameters are searched: wings of rigid links with gimbal joints."""

    separate_wings: Annotated[bool, Option("--separate-wings", MODEL)] = Field(
        default=False, description="Left and right wings get parameters of their own."
    )
    own_lift: Annotated[list[SurfaceKey] | None, Option("--own-lift", MODEL)] = Field(
        default=None,
        max_length=MAX_WINGS,
        description="Surfaces that get a lift factor of their own, mirror images by a name for both; the "
        "others share one. Left out: one for all, and one for each where three training samples or more tell "
        "them apart.",
    )
    aero_coefficients: Annotated[list[Correction] | None, BeforeValidator(_current_corrections)] = Field(
        default=None,
        max_length=len(both_spellings(corrections())),
        description="Aerodynamic corrections that are searched; the others keep their neutral values. "
        "Left out: those that the training samples determine, which are all, but `profile_drag` only if one "
        "is asymmetric (its sweeps differ, or it rolls or yaws, by more than 0.01 rad), and `zero_lift_rad` "
        "and `cm0` only if `bounds` has them or the samples are far likelier with them.",
    )
    bounds: Annotated[Bounds | None, Option("--bounds", MODEL)] = Field(
        default=None, description="Where the search may look."
    )
    lattice: Lattice = Lattice()
    step_s: StepS | None = Field(
        default=None,
        description="Longest time step. Left out: the longest of 10, 5 and 2.5 ms that holds the training "
        "samples' attitude to 5e-5 rad with the physical guess; the result's `model` says which.",
    )
    start: Annotated[Start, Option("--start", MODEL)] = Field(
        default="trim", description="Trim each model by itself, or start from `flight.start`."
    )

    def numbers_of_links(self) -> Sequence[LinksPerWing]:
        """List the links per wing of all models that are searched."""
        raise NotImplementedError

    def links_at(self) -> Iterator[tuple[str, LinksPerWing]]:
        """Give those that name surfaces, with their pointers below `links_per_wing`."""
        raise NotImplementedError

    def faults(self) -> Iterator[Fault]:
        """Check that corrections are named once, and that the links fit into the bounds of their lengths."""
        yield from repeated_faults(
            self.aero_coefficients or (), "/aero_coefficients", "Name each correction once."
        )
        listed = self.aero_coefficients
        if self.own_lift and listed is not None and "lift_factor" not in listed:
            yield Fault(
                "not_searched",
                "own_lift names surfaces, but no lift factor is searched.",
                "/own_lift",
                "Add lift_factor to aero_coefficients, or leave own_lift out.",
            )
        division = None if self.bounds is None else self.bounds.given().get("division")
        if division is not None:
            numbers = [
                links.values() if isinstance(links, dict) else [links] for links in self.numbers_of_links()
            ]
            yield from _division_faults([links for each in numbers for links in each], *division)


def repeated_faults(items: Sequence[object], pointer: str, hint: str) -> Iterator[Fault]:
    """Check that no item of a list comes twice."""
    for number, item in enumerate(items):
        if item in items[:number]:
            yield Fault("name_not_unique", f"{item} appears twice.", f"{pointer}/{number}", hint)


def _division_faults(numbers: Sequence[int], low: float, high: float) -> Iterator[Fault]:
    """Check that links of lengths within the bounds can make up the span."""
    for links in numbers:
        if links > 1 and not low * links < 1.0 < high * links:
            sum_bound = f"{links} x {low:g} = {links * low:g}" if low * links >= 1.0 else ""
            sum_bound = sum_bound or f"{links} x {high:g} = {links * high:g}"
            yield Fault(
                "bounds_without_room",
                f"The shares of {links} links add up to 1, and with these bounds to "
                f"{'at least' if low * links >= 1.0 else 'at most'} {sum_bound}.",
                f"/bounds/division/{0 if low * links >= 1.0 else 1}",
                f"Give bounds with 1/{links} = {1 / links:.3g} between them.",
            )
            return


class EquivalentModel(SearchedModel):
    """The model whose parameters are searched: wings of rigid links with gimbal joints."""

    links_per_wing: Annotated[AskedLinks, Option("--links", MODEL)] = Field(
        default=3,
        description="Links per wing: one number for all flexible surfaces, or one for each by name, mirror "
        "images by a name for both. `auto`: models of one link, two links and so on up to six are "
        "identified, and the one under which the training samples are most likely is taken.",
    )

    def numbers_of_links(self) -> Sequence[LinksPerWing]:
        """List the number of links per wing, or all that are tried."""
        numbers = AUTO_LINKS if to_choose(self.links_per_wing) else AUTO_LINKS[:1]
        return [with_links(self.links_per_wing, number) for number in numbers]

    def links_at(self) -> Iterator[tuple[str, LinksPerWing]]:
        """Give those that name surfaces; numbers that are tried name the same."""
        yield "", self.numbers_of_links()[-1]


class Search(SwarmSearch):
    """How the parameters are searched; what is left out depends on the method."""

    method: Annotated[Method, Option("--method", SEARCH)] = Field(
        default="hybrid", description="How the parameters are searched."
    )
    particles: Annotated[Annotated[int, Field(ge=1, le=100_000)] | None, Option("--particles", SEARCH)] = (
        Field(default=None, description="Size of the swarm, or candidates of the other methods.")
    )
    generations: Annotated[
        Annotated[int, Field(ge=1, le=100_000)] | None, Option("--generations", SEARCH)
    ] = Field(default=None, description="Generations of the swarm, or iterations of the other methods.")
    preset: Annotated[Literal["paper"] | None, Option("--preset", SEARCH)] = Field(
        default=None, description="`paper`: 2500 particles, c1 = c2 = 1, as published."
    )

    def faults(self) -> Iterator[Fault]:
        """Check that an evolution strategy has enough models to choose from."""
        if self.method == "cma" and self.preset is None and (self.particles or MIN_EVOLUTION) < MIN_EVOLUTION:
            yield Fault(
                "greater_than_equal",
                f"{self.particles} models a generation are too few for the method cma.",
                "/particles",
                f"Give at least {MIN_EVOLUTION}, or another method.",
            )


class IdentifySearch(Search):
    """How the parameters are searched, and from where."""

    warm_start: WarmStart | None = Field(
        default=None,
        description="Begin from this model instead of the physical guess, which stays among the candidates. "
        "The search then looks at fewer of them, unless `particles` says how many.",
    )


EXAMPLE_REQUEST: dict[str, Any] = {
    "aircraft": EXAMPLE_AIRCRAFT,
    "flight": EXAMPLE_FLIGHT,
    "samples": [EXAMPLE_SAMPLE],
    "model": {"links_per_wing": 3},
    "search": {"method": "hybrid", "seed": 1},
}


class SamplesRequest(Request):
    """A request to fit models to sample flights."""

    aircraft: Annotated[Aircraft, Option("--aircraft", VEHICLE)] = Field(description="Aircraft.")
    flight: Annotated[Flight, Option("--flight", VEHICLE)] = Field(description="Flight condition.")
    samples: list[Sample] = Field(min_length=1, max_length=MAX_SAMPLES)
    model: SearchedModel
    search: Search = Search()
    measurement: Measurement | None = Field(
        default=None,
        description="How the samples were measured: channels, noise, biases, delays. Left out: the three "
        "angles, and what else is free is decided from the data.",
    )

    def inline_samples(self) -> dict[int, InlineSample]:
        """Collect the samples whose rows are here, by their place in the list."""
        return {
            number: sample for number, sample in enumerate(self.samples) if isinstance(sample, InlineSample)
        }

    def faults(self) -> Iterator[Fault]:
        """Check aircraft, flight and samples together."""
        yield from start_faults(self.flight, self.model.start)
        yield from trim_drive_faults(self.aircraft, self.flight)
        yield from sliding_faults(self.aircraft, self.flight, self.model.lattice)
        yield from flexible_wing_faults(self.aircraft, "nothing_to_identify")
        for pointer, links in self.model.links_at():
            yield from links_faults(self.aircraft, links, f"/model/links_per_wing{pointer}")
        yield from own_lift_faults(self.aircraft, self.model.own_lift or (), "/model/own_lift")
        yield from samples_faults(self.samples)
        samples = self.inline_samples()
        yield from total_rows_faults(sum(len(sample.time_s) for sample in samples.values()))
        drives = self.aircraft.drives
        for number, sample in samples.items():
            yield from (fault.under(f"/samples/{number}") for fault in sample.drive_faults(drives))
        yield from foreign_channels(
            self.measurement,
            [(each.name, each.side, bool(each.all_hinges)) for each in self.aircraft.surfaces],
        )
        yield from absent_channels(
            self.measurement,
            [(f"/samples/{n}", sample.role, tuple(sample.channels)) for n, sample in samples.items()],
        )


def total_rows_faults(total: int) -> Iterator[Fault]:
    """Check the rows of all samples together."""
    if total > MAX_TOTAL_ROWS:
        yield Fault(
            "too_many_rows",
            f"The samples have {total} rows in total.",
            "/samples",
            f"At most {MAX_TOTAL_ROWS}: 10 ms between rows are enough.",
        )


class Named(Protocol):
    """A sample flight as far as others must be told apart from it."""

    @property
    def name(self) -> str | None:
        """Its name; None for that of the uploaded flight."""
        ...

    @property
    def role(self) -> str:
        """``train`` or ``held_out``."""
        ...


def samples_faults(samples: Sequence[Named]) -> Iterator[Fault]:
    """Check that something can be fitted, and that every sample has a name of its own."""
    if all(sample.role != "train" for sample in samples):
        yield Fault(
            "no_training_sample",
            "Every sample is held out.",
            "/samples/0/role",
            'Give at least one sample the role "train".',
        )
    names: dict[str, int] = {}
    for number, sample in enumerate(samples):
        if sample.name is None:
            continue
        if sample.name in names:
            yield Fault(
                "name_not_unique",
                f"Samples {names[sample.name]} and {number} are both called {sample.name!r}.",
                f"/samples/{number}/name",
                "Give every sample a name of its own: plots are named after it.",
            )
        names.setdefault(sample.name, number)


class IdentifyRequest(SamplesRequest):
    """Aircraft, flight condition and samples; model and search have good defaults."""

    model_config = ConfigDict(json_schema_extra={"examples": [EXAMPLE_REQUEST]})

    model: EquivalentModel = EquivalentModel()
    search: IdentifySearch = IdentifySearch()
    uncertainty: UncertaintySettings = UncertaintySettings()
    execution: SpreadExecution = SpreadExecution()

    def faults(self) -> Iterator[Fault]:
        """Check what belongs together, and that the model to begin from has the form that is searched."""
        yield from super().faults()
        warm_start = self.search.warm_start
        known = None if warm_start is None else parameters_in(warm_start.parameters)
        if known is None:
            return
        yield from model_surfaces_faults(self.aircraft, known, "/search/warm_start/parameters")
        at, links = "/search/warm_start/parameters", self.model.links_per_wing
        own = self.model.numbers_of_links()[0]
        if to_choose(links):
            yield Fault(
                "links_differ",
                "The number of links per wing is to be chosen, and the model to begin from has one already.",
                at,
                f"Set model.links_per_wing to {json.dumps(known.links_per_wing)}, or begin from no model.",
            )
        elif links_by_name(self.aircraft, known.links_per_wing) != links_by_name(self.aircraft, own):
            yield Fault(
                "links_differ",
                f"The search is for {shown_per_wing(own)} and would begin from a model with "
                f"{shown_links(known.links_per_wing)}.",
                at,
                "Begin from a model with as many, or set model.links_per_wing to "
                f"{json.dumps(known.links_per_wing)}.",
            )
        elif known.separate_wings and not self.model.separate_wings:
            yield Fault(
                "wings_differ",
                "The search is for wings that are alike and would begin from a model with wings of their "
                "own.",
                at,
                "Set model.separate_wings, or begin from a model whose wings are alike.",
            )
