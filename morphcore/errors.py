"""The errors of the numeric library; each carries data and a hint."""

from __future__ import annotations

from morphdata.faults import InvalidInput, MorphError

__all__ = ["FlightDiverged", "InvalidInput", "MorphError", "NotFlyable", "TrimNotFound", "UnsupportedRegime"]


class NotFlyable(MorphError):
    """No flyable answer: the best one found diverges, or has no trim."""

    code = "not_flyable"


class TrimNotFound(NotFlyable):
    """Newton's iteration found no steady level flight.

    Parameters
    ----------
    residual : largest remaining joint acceleration or vertical specific force, rad/s^2 or m/s^2.
    iterations : Newton steps taken.
    """

    code = "trim_not_found"

    def __init__(self, *, residual: float, iterations: int) -> None:
        super().__init__(
            f"no trimmed level flight found: residual {residual:.3g} after {iterations} Newton steps",
            pointer="/flight",
            hint="raise the airspeed, lower the mass, or stiffen the wings",
        )
        self.residual = residual
        self.iterations = iterations


class FlightDiverged(NotFlyable):
    """The integration left the domain in which the model is valid.

    Parameters
    ----------
    time_s : the last time at which the state was finite and within limits.
    """

    code = "diverged"

    def __init__(self, *, time_s: float) -> None:
        super().__init__(
            f"the flight diverged at t = {time_s:.3f} s",
            pointer="/model",
            hint="check stiffness and damping, or choose a smaller step_s",
        )
        self.time_s = time_s


class UnsupportedRegime(MorphError):
    """A condition outside the validity of a method, such as Mach numbers beyond 0.7."""

    code = "unsupported_regime"
