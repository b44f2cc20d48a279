"""Identification as an iterator of steps of a search, each with its complete state."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.cost import SampleCase, costs, longest_step, residuals, sample_cases
from morphcore.identify.descents import METHODS, PRIOR_RAD, descent
from morphcore.identify.drive_histories import SmoothedSamples, smoothed_samples
from morphcore.identify.first_angles import first_angle_columns, with_first_angles
from morphcore.identify.free_corrections import (
    OWN_LIFT,
    determined_corrections,
    linearised,
    sources,
    spare_freedoms,
)
from morphcore.identify.free_start import with_start
from morphcore.identify.measurement import Openness, first_openness, measured
from morphcore.identify.other_readings import require_seconds
from morphcore.identify.parameters import SearchSpace, search_space
from morphcore.identify.profile import require_names
from morphcore.identify.result import IdentifyResult, identify_result
from morphcore.identify.rounds import Prepared, reviewed
from morphcore.identify.settings import SearchSettings
from morphcore.models.equivalent import ChainModel, chain_model
from morphcore.search.checkpoint import pack, unpack
from morphcore.search.hybrid import HybridState
from morphcore.search.least_squares import LeastSquaresState
from morphcore.search.methods import method
from morphcore.search.run import Clock, Search, SearchState
from morphcore.search.solver import Batch, Box, Outcome
from morphcore.search.step import Step
from morphcore.simulate.compilation import compile_flights
from morphcore.simulate.time_grid import STEP_S
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Deadline, Stop, say
from morphcore.threads import one_blas_thread
from morphdata.faults import refuse
from morphdata.identify import EquivalentModel
from morphdata.links import LinksPerWing, to_choose
from morphdata.measurement import Measurement, foreign_channels
from morphdata.uncertainty import UncertaintySettings

Array = NDArray[np.float64]

VERSION = "identification 7"  # of the checkpoint; another one is not read


class Identification:
    """The search for the parameters of an equivalent model from sample flights.

    It is the problem that the search methods of `morphcore.search` work on, and the iterator of their steps.

    Parameters
    ----------
    aircraft : morphcore.geometry.aircraft.Aircraft
        The aircraft as the numerics take it, `Aircraft.of` a document.
    flight : morphcore.geometry.aircraft.Flight
        The flight condition, `Flight.of` a document.
    samples : sequence of Trajectory or SmoothedSamples
        Sample flights, angles in rad; one at least has the role "train".
    model : EquivalentModel, optional
        The model whose parameters are searched.
    search : SearchSettings, optional
        Method and effort of the search.
    measurement : Measurement, optional
        How the samples were measured; what is left out is decided from the data.
    uncertainty : UncertaintySettings, optional
        What is computed beside standard errors and intervals.
    clock : callable
        Wall time, s.

    Raises
    ------
    InvalidInput
        No sample to train on, two samples of one name, or a setting that makes no sense.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Flight,
        samples: Sequence[Trajectory] | SmoothedSamples,
        model: EquivalentModel | None = None,
        search: SearchSettings | None = None,
        *,
        measurement: Measurement | None = None,
        uncertainty: UncertaintySettings | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.settings = model or EquivalentModel()
        self.search = search or SearchSettings()
        self._clock = clock
        self._step_s = self.settings.step_s
        self._round = 0
        self._plans: dict[tuple[bool, ...], tuple[SampleCase, ...]] = {}
        self._angle_columns: dict[tuple[int, bool, tuple[float, ...]], Array] = {}
        self._cases: tuple[tuple[Openness, ...], tuple[SampleCase, ...]] | None = None
        self._linear: tuple[tuple[Openness, ...], Array, Array, Array] | None = None
        self.measurement = measurement or Measurement()
        surfaces = [(each.name, each.side, bool(each.hinges)) for each in aircraft.surfaces]
        refuse(foreign_channels(self.measurement, surfaces))
        if not isinstance(samples, SmoothedSamples):
            samples = smoothed_samples(aircraft, samples, measurement)
        self.samples, self.histories = samples.smooth, samples.histories
        self.uncertainty = uncertainty or UncertaintySettings()
        self._first_openness = first_openness(self.samples, self.measurement)
        # of each sample, what is unknown about its measurement; the same in a round of the search
        self.openness: tuple[Openness, ...] = self._first_openness
        if self.settings.start == "given" and flight.start is None:
            raise InvalidInput(
                "the flight has no start", pointer="/flight/start", hint='add it, or use start = "trim"'
            )
        if to_choose(self.settings.links_per_wing):
            raise InvalidInput(
                "one identification has one number of links per wing",
                pointer="/model/links_per_wing",
                hint='use AutoIdentification, or identify(..., links_per_wing="auto")',
            )
        self.model = self.chain(aircraft, flight, self.settings.numbers_of_links()[0])
        self._bounds = None if self.settings.bounds is None else self.settings.bounds.given()
        training = [sample for sample in samples.given if sample.role == "train"]
        given: Sequence[str] | None = self.settings.aero_coefficients
        determined = determined_corrections(self.model.parameters, training, self._bounds or ())
        # that are searched from the beginning
        self.first_corrections: tuple[str, ...] = determined if given is None else tuple(given)
        self.prior_weight = PRIOR_RAD**2  # that the search gives the physical guess by now
        self._begin(())
        self._spare = spare_freedoms(self, training)
        require_names(self.space, self.uncertainty.profile)

    def _begin(self, further: tuple[str, ...]) -> None:
        """Take up the search space with further freedoms, which the flights call for."""
        self.further = further
        self._first_space = self._space_of(further)
        self.space = self._first_space  # the same with the bounds that the search has widened by now
        warm = self.search.warm_start
        # (k, d) what is known before the search: the model to begin from, and always the physical guess
        self.known: Array = np.stack([*([] if warm is None else [self.space.encode(warm)]), self.space.guess])

    def _space_of(self, further: Sequence[str]) -> SearchSpace:
        return search_space(
            self.model,
            separate_wings=self.settings.separate_wings,
            aero_coefficients=[*self.first_corrections, *(name for name in further if name != OWN_LIFT)],
            bounds=self._bounds,
            own_lift=None if OWN_LIFT in further else self.settings.own_lift or (),
        )

    def chain(self, aircraft: Aircraft, flight: Flight, links: LinksPerWing) -> ChainModel:
        """A chain model with the lattice that the settings ask for."""
        return chain_model(aircraft, flight, links, self.settings.lattice)

    @property
    def step_s(self) -> float:
        """The time step of all flights, s: the one asked for, or chosen from the samples to fit."""
        return self._chosen_step()

    def _chosen_step(self, stop: Stop | None = None) -> float:
        """Choose the step if none is given: from the inputs alone, so that a resumed search has the same."""
        if self._step_s is None:
            with one_blas_thread():
                self._step_s = longest_step(
                    self.model,
                    self.space.decode(self.space.guess),
                    [sample for sample in self.samples if sample.role == "train"],
                    self.settings.start,
                    stop,
                    separate_wings=self.settings.separate_wings,
                )
        return self._step_s

    @property
    def cases(self) -> tuple[SampleCase, ...]:
        """All samples with their plans, and with what is unknown about their measurement."""
        if self._cases is None or self._cases[0] is not self.openness:
            self._cases = (self.openness, self.opened(self.openness))
        return self._cases[1]

    def opened(self, openness: tuple[Openness, ...]) -> tuple[SampleCase, ...]:
        """All samples with what might be unknown about their measurement."""
        whole = tuple(each.start for each in openness)
        if whole not in self._plans:
            self._plans[whole] = sample_cases(
                self.model,
                self.samples,
                self.step_s,
                separate_wings=self.settings.separate_wings,
                whole=whole,
                start=self.settings.start,
            )
        numbered = enumerate(zip(self._plans[whole], openness, strict=True))
        with one_blas_thread():
            return tuple(self._opened_case(number, case, each) for number, (case, each) in numbered)

    def _opened_case(self, number: int, case: SampleCase, openness: Openness) -> SampleCase:
        """A sample with its readings; derivatives by the first angles are flown once for a start."""
        sample, histories, start = case.sample, self.histories[number], self.settings.start
        setup = measured(sample, self.measurement, openness)
        if openness.start:
            point = openness.reference if openness.reference.size else self.known[0]
            setup = with_start(self.model, self.space.decode(point), replace(case, given=setup), start)
        key = (number, openness.start, openness.start_value)
        if key not in self._angle_columns:
            guess, opened = self.space.decode(self.known[0]), replace(case, given=setup)
            self._angle_columns[key] = first_angle_columns(self.model, guess, opened, histories, start)
        return replace(case, given=with_first_angles(setup, sample, histories, self._angle_columns[key]))

    @property
    def training(self) -> tuple[SampleCase, ...]:
        """The samples to fit."""
        return tuple(case for case in self.cases if case.sample.role == "train")

    def widened(self) -> tuple[str, ...]:
        """Names of the parameters whose bounds the search has widened by now."""
        first, now = self._first_space.box, self.space.box
        return self.space.named((now.lower < first.lower) | (now.upper > first.upper))

    @property
    def spare(self) -> tuple[str, ...]:
        """Freedoms that the search has not, and would have if the flights called for them."""
        return tuple(name for name in self._spare if name not in self.further)

    def space_with(self, freedoms: Sequence[str]) -> SearchSpace:
        """The search space as it is by now, and with further freedoms."""
        wide = self._space_of((*self.further, *freedoms))
        at = sources(self.space, wide)
        lower, upper = (
            np.where(at < 0, own, now[at])
            for own, now in ((wide.lower, self.space.lower), (wide.upper, self.space.upper))
        )
        return wide.widened(Box(lower, upper))

    def shapes(self) -> list[tuple[int, int]]:
        """Rows and channels of the residuals of each sample to fit."""
        return [(case.sample.time_s.size, int(case.setup.fitted.sum())) for case in self.training]

    @property
    def floors(self) -> dict[str, float]:
        """The least noise that each channel is credited with."""
        return self._first_openness[0].sigma

    def linearised(self, point: Array) -> tuple[Array, Array]:
        """Residuals (m,) and their Jacobian (m, d) at a search point (d,); the last ones are kept."""
        kept = self._linear
        if kept is None or kept[0] is not self.openness or not np.array_equal(kept[1], point):
            kept = self._linear = (self.openness, point, *linearised(self, self.space, point))
        return kept[2:]

    # the iterator

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Search, one step after the other.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts anew.
        stop : asked between chunks of well under a second; True raises Interrupted.
        """
        state = SearchState(self.search.max_seconds) if checkpoint is None else self.state(checkpoint)
        while not state.over:
            state = self.entered(self._search.advance(state, stop))
            if state.over:
                state = self._reviewed(state, stop)
            yield self._step(state)

    def result(self, checkpoint: bytes) -> IdentifyResult:
        """The identified model at any step, with its fit, uncertainty and cost.

        Raises
        ------
        NotFlyable : the best model does not fly the samples that it was fitted to.
        """
        return self.judged(checkpoint).require_flown()

    def judged(self, checkpoint: bytes) -> IdentifyResult:
        """The same whether its model flies or not; one that does not has no model in its document."""
        say("evaluating the result")
        with one_blas_thread():
            return identify_result(self, self.state(checkpoint))

    def best_so_far(self, checkpoint: bytes) -> IdentifyResult:
        """Give the result without uncertainty and timing, fast: someone waits for a cancelled search.

        Where nothing has flown yet it holds no model, and a warning says so.
        """
        with one_blas_thread():
            return identify_result(self, self.state(checkpoint), judged=False)

    def state(self, checkpoint: bytes) -> SearchState:
        """Return the state in a checkpoint, whose flights are flown in the steps that it was begun with.

        Raises
        ------
        UnreadableCheckpoint : the bytes are damaged or of another version.
        """
        return self.entered(unpack(checkpoint, VERSION, SearchState))

    def entered(self, state: SearchState) -> SearchState:
        """Return the state, after taking over what its flights go by: step, unknowns, bounds and prior."""
        if isinstance(state.prepared, Prepared):
            self._step_s = state.prepared.step_s if self._step_s is None else self._step_s
            if self._round != state.prepared.round:
                self.openness, self._round = state.prepared.openness, state.prepared.round
            if self.further != state.prepared.further:
                self._begin(state.prepared.further)
        self.space, self.prior_weight = self._first_space, PRIOR_RAD**2
        if isinstance(state.solver, LeastSquaresState | HybridState):
            own = state.solver if isinstance(state.solver, LeastSquaresState) else state.solver.descent
            self.prior_weight = float(own.best_weight.max())
            # the descent before a review that has freed something was in a smaller space
            if own.box.lower.size == self.space.dimension:
                self.space = self._first_space.widened(own.box)
        return state

    def _reviewed(self, state: SearchState, stop: Stop | None) -> SearchState:
        """Return the state of the next round, where the residuals call for one; else the same."""
        begin = self._clock()
        with one_blas_thread():
            found = reviewed(self, state, stop)
        if found is None:
            return self.entered(state)
        return replace(found, wall_s=state.wall_s + self._clock() - begin)

    # steps whose flights others fly

    def task(self, checkpoint: bytes) -> Batch | None:
        """Return the points whose costs the step after a checkpoint needs; None where it needs more."""
        return self._search.task(self.state(checkpoint))

    def task_costs(self, points: Array, stop: Stop | None = None) -> Array:
        """Costs (p,) of search points (p, d), rad^2: of any part of a task, whoever flies the rest."""
        # a step whose costs are all that it needs comes before any review of the residuals
        self.entered(SearchState(prepared=Prepared(self.step_s, self._first_openness)))
        with one_blas_thread():
            return self.evaluate(Batch(points), stop).cost

    def tell(self, checkpoint: bytes, cost: Array, *, wall_s: float = 0.0) -> Step:
        """Return the step after a checkpoint, given the costs of its task: the step that ``steps`` gives.

        Parameters
        ----------
        checkpoint : bytes
        cost : (p,) rad^2
        wall_s : what the flights took, s.

        Raises
        ------
        ValueError : there is no such task, or it has another number of points.
        """
        state = self.state(checkpoint)
        task = self._search.task(state)
        if task is None or cost.shape != task.points.shape[:1]:
            raise ValueError(f"costs {cost.shape} do not answer the task after generation {state.generation}")
        return self._step(self._search.tell(state, Outcome(task.points, cost, None, cost.size), wall_s))

    # the problem

    @property
    def box(self) -> Box:
        """The bounds of the search coordinates."""
        return self._first_space.box

    @property
    def flights_each(self) -> int:
        """Flights of one parameter set: one for each sample to fit."""
        return sum(sample.role == "train" for sample in self.samples)

    def arranged(self, points: Array) -> Array:
        """Return random points as they are: the coordinates have no order."""
        return points

    def prepare(self, deadline: Deadline) -> Prepared:
        """Choose the time step of all flights; the default where the time is up before it is chosen."""
        compile_flights()
        require_seconds(self)
        if self._step_s is None:
            self._step_s = deadline.before_it(self._chosen_step, STEP_S)
        say("flying the first guess")
        return Prepared(self._step_s, self._first_openness)

    def first(self) -> Batch:
        """Return what is known beforehand."""
        return Batch(self.known)

    def evaluate(self, batch: Batch, stop: Stop | None) -> Outcome:
        """Fly parameter sets: their costs J, rad^2, or all errors, rad."""
        sets = self.space.decode(batch.points)
        count = batch.points.shape[0]
        if not batch.residuals:
            cost = costs(self.model, sets, self.training, self.settings.start, stop)
            return Outcome(batch.points, cost, None, count)
        errors = residuals(self.model, sets, self.training, self.settings.start, stop)
        return Outcome(batch.points, np.einsum("pm,pm->p", errors, errors), errors, count)

    @property
    def _search(self) -> Search[Outcome]:
        """The search of the present round: after a review, a descent from what was found."""
        if self._round:
            return Search(self, descent(self, self.search), self._clock)
        return Search(self, method(self.search.method, self, self.search, METHODS), self._clock)

    def _step(self, state: SearchState) -> Step:
        phase = str(state.history[-1]["phase"])
        return Step(
            phase=phase,
            generation=state.generation,
            fraction=self._search.fraction(state),
            best_cost=state.best_cost,
            flights=state.flights,
            message=f"{phase}: J = {state.best_cost:.3g} rad^2 after {state.flights} flights",
            checkpoint=pack(state, VERSION),
        )
