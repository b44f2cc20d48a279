"""What an optimisation would cost, before it is run."""

from __future__ import annotations

from app.simulate.cost import STEP_CORE_S
from morphdata.optimize import OptimizeRequest, ScheduleCost
from morphdata.simulate import DEFAULT_STEP_S

# nominal figures, to an order of magnitude: what a request does not say is the solver's choice
SWARM_PARTICLES, SWARM_GENERATIONS = 50, 100
SCREEN, DESCENT_STARTS, DESCENT_ITERATIONS = 16, 3, 8
REAL_TIME_FACTOR = 150.0  # on one core: every flight has a schedule, and so a lattice over time, of its own
SEARCHES = 2  # with the rigid model too
COMPARED_SCHEDULES = 3  # constant rate and both optima
DURATIONS_TRIED = 10  # on the way to the least time


def estimate(request: OptimizeRequest) -> ScheduleCost:
    """Estimate flights and computing time."""
    morph, search = request.morph, request.search
    parameters = (morph.knots - 2) * (2 if morph.free_values else 1)
    if search.method == "pso" or search.preset == "paper":
        flights = (search.particles or SWARM_PARTICLES) * (search.generations or SWARM_GENERATIONS)
    else:
        iterations = search.generations or DESCENT_ITERATIONS
        flights = (search.particles or SCREEN) + DESCENT_STARTS * iterations * (parameters + 1)
    flights *= (
        SEARCHES * {"variation": 1, "minimum_time": DURATIONS_TRIED, "pareto": morph.front_points}[morph.goal]
    )
    each_s = morph.duration_s + morph.settle_s
    core_s = flights * each_s / REAL_TIME_FACTOR
    if request.verify == "flexible":
        core_s += COMPARED_SCHEDULES * each_s * STEP_CORE_S["flexible"] / DEFAULT_STEP_S["flexible"]
    return ScheduleCost(parameters=parameters, flights=flights, flight_s=flights * each_s, core_s=core_s)
