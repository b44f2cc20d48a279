"""What an optimisation of a morph is asked to do, read from its JSON document."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.fields import Fields, WholeNumbers
from morphcore.geometry.lattice import LatticeSettings, lattice_settings
from morphcore.search.evolution import EvolutionSettings
from morphcore.search.swarm import SwarmSettings

Array = NDArray[np.float64]

Goal = Literal["variation", "minimum_time", "pareto"]
Method = Literal["hybrid", "pso"]
Verify = Literal["flexible", "none"]

GOALS: tuple[Goal, ...] = ("variation", "minimum_time", "pareto")
METHODS: tuple[Method, ...] = ("hybrid", "pso")
VERIFICATIONS: tuple[Verify, ...] = ("flexible", "none")

FEWEST_KNOTS, MOST_KNOTS = 3, 20
LONGEST_MORPH_S = 100.0
LARGEST_SEED = 2**53 - 1
PAPER_PARTICLES = 50  # of the paper's swarm
DEFAULT_SCREEN = 16  # schedules flown to find the descent's starts
DEFAULT_STARTS = 3
DEFAULT_ITERATIONS = 25
DEFAULT_ELEMENTS = 10  # of each surface of the flexible model
DEFAULT_FRONT_POINTS = 7


@dataclass(frozen=True)
class Morph(WholeNumbers):
    """The change of shape that is wanted; all hinges follow one schedule.

    initial_rad, final_rad : angles before and after it. duration_s : its time; of the goals "minimum_time"
    and "pareto" the longest that is looked at. knots : points of the spline, both ends included: with 6 and
    fixed values, 4 times are sought. settle_s : how long after ``duration_s`` the attitude still counts, of
    shorter morphs too. free_values : seek the angles at the knots too. goal : least variation in the given
    duration, least duration with a variation of at most ``max_variation_rad2``, or the front of both, of
    ``front_points`` durations.
    """

    final_rad: float
    duration_s: float
    initial_rad: float = 0.0
    knots: int = 6
    settle_s: float = 2.0
    free_values: bool = False
    goal: Goal = "variation"
    max_variation_rad2: float | None = None
    front_points: int = DEFAULT_FRONT_POINTS

    @property
    def change_rad(self) -> float:
        """By how much the angle changes, with its sign."""
        return self.final_rad - self.initial_rad


@dataclass(frozen=True)
class Limits:
    """What no schedule may exceed; None is no limit.

    monotonic : the rate never changes its sign. max_hinge_torque_nm : of any hinge's motor, at the steps of
    the flight in the model that is searched with.
    """

    max_rate_rad_s: float | None = None
    max_accel_rad_s2: float | None = None
    monotonic: bool = True
    max_hinge_torque_nm: float | None = None


@dataclass(frozen=True)
class Weights:
    """Weights of the angles' squared departures in what is minimised."""

    phi: float = 1.0
    theta: float = 1.0
    psi: float = 1.0

    @property
    def root(self) -> Array:
        """(3,) square roots, the factors of the departures."""
        return np.asarray(np.sqrt([self.phi, self.theta, self.psi]), dtype=np.float64)


@dataclass(frozen=True)
class ScheduleSearch(WholeNumbers):
    """How the schedule is sought.

    "hybrid" descends from ``starts`` of ``screen`` schedules by constrained Gauss-Newton steps,
    ``iterations`` at most; "pso" is the swarm. max_seconds : for all searches together, in equal parts.
    """

    method: Method = "hybrid"
    seed: int = 1
    max_seconds: float | None = None
    swarm: SwarmSettings = field(default_factory=lambda: SwarmSettings(particles=PAPER_PARTICLES))
    evolution: EvolutionSettings = field(default_factory=EvolutionSettings)
    screen: int = DEFAULT_SCREEN
    starts: int = DEFAULT_STARTS
    iterations: int = DEFAULT_ITERATIONS


@dataclass(frozen=True)
class FlexibleSettings(WholeNumbers):
    """The flexible model that verifies.

    elements : of each surface. lattice : None for the equivalent model's.
    """

    elements: int = DEFAULT_ELEMENTS
    lattice: LatticeSettings | None = None


def morph_settings(document: dict[str, Any], pointer: str = "/morph") -> Morph:
    """Read the morph's part of a request."""
    fields = Fields(document, pointer)
    longest = {"above": 0.0, "most": LONGEST_MORPH_S}
    morph = Morph(
        final_rad=fields.number("final_rad", least=-np.pi, most=np.pi),
        duration_s=fields.number("duration_s", **longest),
        initial_rad=fields.number("initial_rad", default=0.0, least=-np.pi, most=np.pi),
        knots=fields.whole("knots", default=Morph.knots, least=FEWEST_KNOTS, most=MOST_KNOTS),
        settle_s=fields.number("settle_s", default=Morph.settle_s, least=0.0, most=LONGEST_MORPH_S),
        free_values=fields.flag("free_values", default=False),
        goal=fields.choice("goal", GOALS, default="variation"),  # type: ignore[arg-type]
        max_variation_rad2=fields.optional_number("max_variation_rad2", above=0.0),
        front_points=fields.whole("front_points", default=DEFAULT_FRONT_POINTS, least=2, most=50),
    )
    fields.done()
    return morph


def limits_settings(document: dict[str, Any], pointer: str = "/limits") -> Limits:
    """Read the limits of a request."""
    fields = Fields(document, pointer)
    limits = Limits(
        max_rate_rad_s=fields.optional_number("max_rate_rad_s", above=0.0),
        max_accel_rad_s2=fields.optional_number("max_accel_rad_s2", above=0.0),
        monotonic=fields.flag("monotonic", default=True),
        max_hinge_torque_nm=fields.optional_number("max_hinge_torque_nm", above=0.0),
    )
    fields.done()
    return limits


def weights_settings(document: dict[str, Any], pointer: str = "/weights") -> Weights:
    """Read the weights of a request."""
    fields = Fields(document, pointer)
    weights = Weights(*(fields.number(n, default=1.0, least=0.0, most=1e6) for n in ("phi", "theta", "psi")))
    fields.done()
    if weights == Weights(0.0, 0.0, 0.0):
        raise InvalidInput("all weights are zero", pointer=pointer, hint="give one angle a weight")
    return weights


def schedule_search(document: dict[str, Any], pointer: str = "/search") -> ScheduleSearch:
    """Read the search's part of a request; ``preset: "paper"`` is the swarm of the 2021 paper."""
    fields = Fields(document, pointer)
    paper = fields.choice("preset", ("paper",)) == "paper" if fields.has("preset") else False
    method = fields.choice("method", METHODS, default="pso" if paper else "hybrid")
    default = ScheduleSearch()
    swarm = SwarmSettings(
        particles=fields.whole("particles", default=PAPER_PARTICLES, least=1, most=10_000),
        generations=fields.whole("generations", default=default.swarm.generations, least=1, most=10_000),
        c1=fields.number("c1", default=1.0, least=0.0, most=4.0),
        c2=fields.number("c2", default=1.0, least=0.0, most=4.0),
        inertia=fields.number("inertia", default=default.swarm.inertia, least=0.0, most=1.5),
    )
    search = ScheduleSearch(
        method="pso" if paper else method,  # type: ignore[arg-type]
        seed=fields.whole("seed", default=1, least=0, most=LARGEST_SEED),
        max_seconds=fields.optional_number("max_seconds", above=0.0),
        swarm=swarm,
        screen=swarm.particles if fields.has("particles") else default.screen,
        iterations=swarm.generations if fields.has("generations") else default.iterations,
    )
    fields.done()
    return search


def flexible_settings(document: dict[str, Any], pointer: str = "/flexible") -> FlexibleSettings:
    """Read the flexible model's part of a request."""
    fields = Fields(document, pointer)
    settings = FlexibleSettings(
        elements=fields.whole("elements", default=DEFAULT_ELEMENTS, least=1, most=100),
        lattice=lattice_settings(fields.raw("lattice"), f"{pointer}/lattice")
        if fields.has("lattice")
        else None,
    )
    fields.done()
    return settings
