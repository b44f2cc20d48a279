"""What flies in an optimisation: the models, their lattice and time step, and the spaces of schedules."""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput, NotFlyable
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.geometry.obstacle import Obstacle, naming_obstacles
from morphcore.models.equivalent import ChainModel, ParameterBatch, chain_model, fitted, physical_guess
from morphcore.models.soft_joints import chain_obstacle, soft_joint
from morphcore.optimise.feasible import constant_rate, morph_drives, morph_space, morph_word
from morphcore.optimise.flights import MorphFlights, sample_times
from morphcore.optimise.goals import ModelName
from morphcore.optimise.limits import MorphSpace
from morphcore.simulate.common_path import CommonPath, common_path, path_schedules
from morphcore.simulate.schedule import Schedule
from morphcore.simulate.step_choice import busiest_part, choose_step
from morphcore.simulate.trim import StartMode
from morphcore.stopping import Stop
from morphdata.lattice import Lattice
from morphdata.optimize import Limits, Morph

Array = NDArray[np.float64]


class MorphCase:
    """A morph of an aircraft with one equivalent model, and the rigid one.

    Parameters
    ----------
    model : one parameter set of the equivalent model.
    lattice, start, step_s : settings of the flights of both models. A step of None selects the longest with
    which both fly the constant-rate morph to the tolerance of `choose_step`.

    Raises
    ------
    InvalidInput : there is more than one parameter set, or the flight has no start.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Flight,
        model: ParameterBatch,
        *,
        morph: Morph,
        limits: Limits,
        lattice: Lattice,
        start: StartMode,
        step_s: float | None,
    ) -> None:
        self.aircraft, self.flight, self.parameters = aircraft, flight, model
        self.morph, self.limits = morph, limits.in_unit(morph.unit)
        self.lattice, self.start, self._step_s = lattice, start, step_s
        self._flights: dict[ModelName, MorphFlights] = {}
        if model.particles != 1:
            raise InvalidInput(
                f"{model.particles} parameter sets to optimise with",
                pointer="/model/parameters",
                hint="choose one with ParameterBatch.select",
            )
        if self.start == "given" and flight.start is None:
            raise InvalidInput(
                "the flight has no start", pointer="/flight/start", hint='add it, or use start = "trim"'
            )

    def space(self, duration_s: float) -> MorphSpace:
        """The unknowns and limits for one duration."""
        return morph_space(self.aircraft, self.morph, self.limits, duration_s)

    @cached_property
    def path(self) -> CommonPath:
        """The lattice over all angles that a schedule may reach, shared by all models and durations."""
        space, morph = self.space(self.morph.duration_s), self.morph
        low, high = (0.0, 1.0) if self.limits.monotonic else (space.low, space.high)
        ends = sorted(morph.begin + morph.change * share for share in (low, high))
        return common_path(
            self.chain("rigid")[0], *ends, drives=self.drives, may_halve=self.is_even, start=self.start,
            initial_rad=morph.begin,
        )  # fmt: skip

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the drives that the morph moves together; the others hold their hinges' angles."""
        return morph_drives(self.aircraft, self.morph)

    @property
    def word(self) -> str:
        """The word or drive name that the result uses for what the morph moves."""
        return morph_word(self.aircraft, self.morph)

    @cached_property
    def is_even(self) -> bool:
        """Whether both sides have the same parameters, so that half the aircraft can represent it."""
        model, batch = self.chain("equivalent")
        return model.is_even(batch)

    @property
    def step_s(self) -> float:
        """The longest step, s, of the rigid and the equivalent model, as requested or chosen."""
        return self._chosen_step()

    def _chosen_step(self, stop: Stop | None = None) -> float:
        """Choose the step if none is given: from the inputs alone, so that a resumed run uses the same."""
        if self._step_s is None:
            self._step_s = self._found_step(stop)
        return self._step_s

    def _found_step(self, stop: Stop | None) -> float:
        constant = self.constant(self.morph.duration_s)
        schedules = path_schedules(self.aircraft, self.drives, constant)
        flight = schedules, busiest_part([constant], self.times_s)
        chains = [self.chain(name) for name in ("rigid", "equivalent")]
        steps_s = []
        for model, batch in chains:
            with naming_obstacles(partial(chain_obstacle, model, batch)):
                found = choose_step(
                    model, [flight], batch, start=self.start, may_halve=self.is_even, stop=stop
                )
            steps_s.append(found.step_s)
        return min(steps_s)

    def chain(self, name: ModelName) -> tuple[ChainModel, ParameterBatch]:
        """One of the models used in the search, and its parameters."""
        if name == "equivalent":
            links = self.parameters.links_per_wing
            model = chain_model(self.aircraft, self.flight, links, self.lattice)
            return model, fitted(model, self.parameters)
        rigid = chain_model(self.aircraft, self.flight, 1, self.lattice)
        return rigid, physical_guess(rigid)

    @property
    def times_s(self) -> Array:
        """Times of the rows that count: from the start of the morph to the end of the longest morph's window.

        Every morph is judged over the same time, whatever its duration. Otherwise a quick morph would look
        calm only because its window ends sooner.
        """
        return sample_times(self.morph.duration_s, self.morph.settle_s)

    def flights(self, name: ModelName) -> MorphFlights:
        """Flights over the window shared by morphs of all durations."""
        if name not in self._flights:
            model, batch = self.chain(name)
            self._flights[name] = MorphFlights(
                model,
                batch,
                self.path,
                self.times_s,
                initial_rad=self.morph.begin,
                start=self.start,
                step_s=self.step_s,
            )
        return self._flights[name]

    def constant(self, duration_s: float) -> Schedule:
        """The constant-rate schedule that the optimum is compared with."""
        return constant_rate(self.morph, self.limits, duration_s)

    def not_flyable(self) -> NotFlyable:
        """The error of a search in which no schedule flew to its end."""
        why = soft_joint(*self.chain("equivalent")) or Obstacle(
            "/model/parameters",
            "the model leaves its range of validity in every morph that was tried: check its stiffness and "
            "damping, or "
            "identify the model again",
        )
        return NotFlyable(
            "no morph that was tried could be flown to its end with the equivalent model",
            pointer=why.pointer,
            hint=why.hint,
        )
