"""Identification that chooses the number of links per wing by the flights to fit.

Models of one, two, three ... links are identified one after the other, and the smallest is taken under which
the flights are about as likely as under any: by the marginal likelihood that weighs the prior of each of them
(`evidence`), which charges a model for every parameter that it needs. A link that only fits what no chain can
fly hardly raises it. The search ends with the largest number, or after two in a row without a gain.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.identify.drive_histories import smoothed_samples
from morphcore.identify.evidence import Linear, linear_model, log_evidence
from morphcore.identify.identification import Identification
from morphcore.identify.result import IdentifyResult
from morphcore.identify.settings import SearchSettings
from morphcore.search.checkpoint import pack, stored, unpack
from morphcore.search.run import Clock
from morphcore.search.step import Step
from morphcore.simulate.trajectory import Trajectory
from morphcore.stopping import Stop
from morphcore.threads import one_blas_thread
from morphdata.identify import AUTO_LINKS, EquivalentModel
from morphdata.links import LinksPerWing, mean_links, shown_links, with_links
from morphdata.measurement import Measurement
from morphdata.uncertainty import UncertaintySettings

VERSION = "automatic links 1"  # of the checkpoint; another one is not read
WORTH_A_LINK = 1.0  # by which links have to raise the logarithm of the likelihood: e times likelier
FRUITLESS = 2  # numbers of links in a row that do not raise the likelihood end the search


@stored
@dataclass(frozen=True)
class Tried:
    """A number of links that was searched to the end.

    Attributes
    ----------
    links : int
    linear : Linear
        The model linearised at its best point.
    flights : int
    best_cost : float
        rad^2.
    checkpoint : bytes
        Of the end of its search.
    """

    links: int
    linear: Linear
    flights: int
    best_cost: float
    checkpoint: bytes


@stored
@dataclass(frozen=True)
class AutoState:
    """A search over numbers of links between two steps.

    Attributes
    ----------
    tried : tuple of Tried
        In rising order of links.
    search : bytes
        Checkpoint of the identification that runs, or empty.
    share : float
        How far the one that runs has come, 0..1.
    generation : int
        Steps of all so far.
    wall_s : float
        Of all so far, s.
    over : bool
    """

    tried: tuple[Tried, ...] = ()
    search: bytes = b""
    share: float = 0.0
    generation: int = 0
    wall_s: float = 0.0
    over: bool = False

    @property
    def flights(self) -> int:
        """Flights of all that are done."""
        return sum(each.flights for each in self.tried)

    def likelihoods(self) -> dict[int, float]:
        """Logarithm of the marginal likelihood by number of links, the likeliest at zero."""
        if not self.tried:
            return {}
        # the same rows for all: as many as the model with the most correlated residuals leaves
        count = min(each.linear.count for each in self.tried)
        found = {each.links: log_evidence(each.linear, count) for each in self.tried}
        return {links: value - max(found.values()) for links, value in found.items()}

    @property
    def chosen(self) -> Tried:
        """The fewest links that are about as likely as the likeliest number."""
        found = self.likelihoods()
        return next(each for each in self.tried if found[each.links] >= -WORTH_A_LINK)


class AutoIdentification:
    """An identification of each number of links in turn; its steps and results are as of one.

    Parameters
    ----------
    aircraft, flight, samples, model, search, measurement, uncertainty, clock
        As of `Identification`; the time limit is for all together.
    """

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Flight,
        samples: Sequence[Trajectory],
        model: EquivalentModel,
        search: SearchSettings | None = None,
        *,
        measurement: Measurement | None = None,
        uncertainty: UncertaintySettings | None = None,
        clock: Clock = time.perf_counter,
    ) -> None:
        self.search = search or SearchSettings()
        self._clock = clock

        smoothed = smoothed_samples(aircraft, samples, measurement)

        def run(links: int) -> Identification:
            asked = with_links(model.links_per_wing, links)
            settings = model.model_copy(update={"links_per_wing": asked})
            return Identification(
                aircraft,
                flight,
                smoothed,
                settings,
                self._settings(asked),
                measurement=measurement,
                uncertainty=uncertainty,
                clock=clock,
            )

        # all at once: what is wrong with the settings of six links is said before one link is identified
        self.runs = {links: run(links) for links in AUTO_LINKS}

    def _settings(self, links: LinksPerWing) -> SearchSettings:
        """As requested, but a rigid wing, which may fit nothing, is not searched for elsewhere."""
        rigid = mean_links(links) == 1 and self.search.method == "hybrid"
        return replace(self.search, method="least_squares") if rigid else self.search

    def steps(self, checkpoint: bytes | None = None, stop: Stop | None = None) -> Iterator[Step]:
        """Search, one step of one identification after the other.

        Parameters
        ----------
        checkpoint : of an earlier step; None starts anew.
        stop : asked between chunks of well under a second; True raises Interrupted.
        """
        state = AutoState() if checkpoint is None else self.state(checkpoint)
        while not state.over:
            begin = self._clock()
            state, step = self._advance(state, stop)
            state = replace(state, wall_s=state.wall_s + self._clock() - begin)
            yield replace(step, fraction=self._fraction(state), checkpoint=pack(state, VERSION))

    def result(self, checkpoint: bytes) -> IdentifyResult:
        """The likeliest model, or the best so far of the one that runs where none is done.

        Raises
        ------
        NotFlyable : it does not fly the samples that it was fitted to.
        """
        return self.judged(checkpoint).require_flown()

    def judged(self, checkpoint: bytes) -> IdentifyResult:
        """The same whether its model flies or not."""
        state = self.state(checkpoint)
        run, own = self._shown(state)
        return self._with_report(run.judged(own), state)

    def best_so_far(self, checkpoint: bytes) -> IdentifyResult:
        """The same without uncertainty and timing, fast."""
        state = self.state(checkpoint)
        run, own = self._shown(state)
        return self._with_report(run.best_so_far(own), state)

    def state(self, checkpoint: bytes) -> AutoState:
        """Return the state in a checkpoint.

        Raises
        ------
        UnreadableCheckpoint : the bytes are damaged or of another version.
        """
        return unpack(checkpoint, VERSION, AutoState)

    # pieces

    def _advance(self, state: AutoState, stop: Stop | None) -> tuple[AutoState, Step]:
        """One step of the identification that runs; judged by its likelihood where it ends."""
        links = AUTO_LINKS[len(state.tried)]
        run = self.runs[links]
        if self.search.max_seconds is not None:
            left_s = max(self.search.max_seconds - state.wall_s, 1e-9)
            run.search = replace(run.search, max_seconds=left_s / (len(AUTO_LINKS) - len(state.tried)))
        step = next(run.steps(state.search or None, stop))
        moved = replace(state, search=step.checkpoint, share=step.fraction, generation=state.generation + 1)
        flights = state.flights + step.flights
        if step.fraction >= 1.0:
            moved = self._ended(moved, run, links, step)
        message = f"{shown_links(run.model.links_per_wing)}: {step.message}"
        return moved, replace(step, generation=moved.generation, flights=flights, message=message)

    def _ended(self, state: AutoState, run: Identification, links: int, step: Step) -> AutoState:
        """The state after the end of one identification, and whether it is the last."""
        found = run.state(step.checkpoint)
        with one_blas_thread():
            error, jacobian = run.linearised(found.best)
            linear = linear_model(
                error, jacobian, found.best - run.space.guess, run.prior_weight, run.shapes()
            )
        tried = (*state.tried, Tried(links, linear, step.flights, step.best_cost, step.checkpoint))
        moved = replace(state, tried=tried, search=b"", share=0.0)
        fruitless = moved.chosen.links <= links - FRUITLESS
        up = self.search.max_seconds is not None and state.wall_s >= self.search.max_seconds
        return replace(moved, over=fruitless or len(tried) == len(AUTO_LINKS) or up)

    def _fraction(self, state: AutoState) -> float:
        return 1.0 if state.over else (len(state.tried) + state.share) / len(AUTO_LINKS)

    def _shown(self, state: AutoState) -> tuple[Identification, bytes]:
        """The identification whose result counts, with its checkpoint."""
        if state.tried:
            return self.runs[state.chosen.links], state.chosen.checkpoint
        return self.runs[AUTO_LINKS[0]], state.search

    def _with_report(self, result: IdentifyResult, state: AutoState) -> IdentifyResult:
        """The result with what was tried."""
        likelihood = state.likelihoods()
        tried = [
            {
                "links_per_wing": self.runs[each.links].model.links_per_wing,
                "log_likelihood": likelihood[each.links],
                "J_train": each.best_cost,
                "flights": each.flights,
            }
            for each in state.tried
        ]
        flights = state.flights or result.search["flights"]
        search = {**result.search, "flights": flights, "wall_s": state.wall_s, "links_tried": tried}
        return replace(result, search=search)
