"""The errors of the numeric library; each carries data and a hint."""

from __future__ import annotations

from morphdata.faults import InvalidInput, MorphError

__all__ = ["FlightDiverged", "InvalidInput", "MorphError", "NotFlyable", "TrimNotFound", "UnsupportedRegime"]


class NotFlyable(MorphError):
    """No flyable answer: the best one found diverges, or has no trim."""

    code = "not_flyable"


class TrimNotFound(NotFlyable):
    """Newton's iteration found no equilibrium in the steady flight that was asked for.

    Parameters
    ----------
    residual : what is left: of a chain the last Newton step, rad; of beams the largest imbalance of the angle
    of attack and the elements' strains, rad and m. iterations : Newton steps taken.
    limit : what was found on the way, a clause: where the equilibrium was lost, and at what shape.
    hint : what would trim. flight : the steady flight that was asked for, in words.
    A residual of 0 is not mentioned: there is a root, but not one to be flown.
    """

    code = "trim_not_found"

    def __init__(
        self,
        *,
        residual: float,
        iterations: int,
        limit: str = "",
        hint: str = "",
        flight: str = "level flight",
    ) -> None:
        asked = "level flight" if flight == "level flight" else f"flight with {flight}"
        left = [f"residual {residual:.3g} after {iterations} Newton steps"] if residual else []
        super().__init__(
            f"no trimmed {asked} found: {'; '.join([limit][: len(limit)] + left)}",
            pointer="/flight",
            hint=hint,
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
