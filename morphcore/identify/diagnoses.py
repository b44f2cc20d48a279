"""What is probably wrong with samples that no model flies well, or whose columns contradict each other.

Each diagnosis is a warning with a hint that is true for the case at hand. Columns are looked at first, then
the flights that are there anyway (rigid, guessed, identified); only where the fit is poor are other readings
of the samples flown (`other_readings`, `refit_checks`). One is named where it lowers the cost tenfold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from morphcore.identify.aircraft_checks import start_warnings, wrong_aircraft
from morphcore.identify.column_checks import MIN_MOTION_RAD, column_warnings
from morphcore.identify.other_readings import (
    HALF,
    TENFOLD,
    angle_costs,
    attitude_cost,
    drive_readings,
    flown_guess,
)
from morphcore.identify.refit_checks import cut_off_warnings, late_warnings, measurement_warnings
from morphcore.identify.sample_fit import SampleFit
from morphcore.validity import ResultWarning
from morphdata.measurement import ANGLES

if TYPE_CHECKING:
    from morphcore.identify.identification import Identification

Array = NDArray[np.float64]

# wrong data: whatever the fit looks like, its parameters are not the aircraft's
WRONG_DATA = frozenset(
    {
        "looks_like_degrees",
        "flipped_sign",
        "swapped_sides",
        "late",
        "clipped_column",
        "frozen_column",
        "wrong_aircraft",
    }
)
MISSED_SHARE = 0.1  # of the motion of one angle
POOR_SHARE = 0.05  # of the motion, rms: no equivalent model that fits leaves so much
LATE_SHARE = 0.005  # chains of two links and more leave a thousandth; a delay of 20 ms leaves this much


def diagnoses(
    run: Identification,
    fits: Sequence[SampleFit],
    best: Array,
    measurement: Mapping[str, Any] | None = None,
    *,
    fly: bool = True,
) -> tuple[ResultWarning, ...]:
    """Diagnose all samples of an identification.

    Parameters
    ----------
    run : Identification
    fits : sequence of SampleFit
        Of its samples, in their order.
    best : ndarray, shape (d,)
        The best search point.
    measurement : mapping of str to dict, optional
        Biases and delays that were found, by the name of the sample, as the result has them.
    fly : bool
        Whether other readings of the samples may be flown; who waits for a stopped search has no time.
    """
    found: list[ResultWarning] = []
    for number, fit in enumerate(fits):
        pointer = f"/samples/{number}"
        found += column_warnings(fit.case.sample, pointer, _reference(fit))
        if fly and _misses_an_angle(fit):
            found += _angle_warnings(run, fit, pointer)
    if fly and not _explained(found):
        for number, fit in enumerate(fits):
            found += _drive_warnings(run, fit, f"/samples/{number}")
    trained = [(number, fit) for number, fit in enumerate(fits) if fit.case.sample.role == "train"]
    flies = all(np.all(np.isfinite(fit.identified)) for _, fit in trained)
    chain = run.space.dimension > 0 and run.model.links_per_wing != 1
    if fly and flies and chain and max(fit.error_share() for _, fit in trained) > LATE_SHARE:
        for look in (late_warnings, cut_off_warnings):
            if not _explained(found):
                found += look(run, trained, best)
    if not _explained(found):
        found += wrong_aircraft(run, trained, best)
    if not _explained(found):
        found += measurement_warnings(fits, measurement or {})
        for number, fit in enumerate(fits):
            found += start_warnings(fit, f"/samples/{number}")
    return tuple(found)


def _explained(found: Sequence[ResultWarning]) -> bool:
    return any(warning.code in WRONG_DATA for warning in found)


def _reference(fit: SampleFit) -> Array | None:
    """Attitudes of a model that knows nothing of the sample's: the physical guess, else the rigid one."""
    return next((flown for flown in (fit.initial, fit.rigid) if np.all(np.isfinite(flown))), None)


# measured angles


def _misses_an_angle(fit: SampleFit) -> bool:
    """Whether the model misses an angle by more than a share of its motion, or does not fly at all."""
    if not np.all(np.isfinite(fit.identified)):
        return True
    errors = np.sqrt(np.mean(fit.errors("identified") ** 2, axis=0))
    motion = np.sqrt(np.mean(fit.case.motion**2, axis=0))
    return bool(np.any(errors > np.maximum(MISSED_SHARE * motion, MIN_MOTION_RAD)))


def _angle_warnings(run: Identification, fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Units and signs of the measured angles, by a flight of the physical guess without any correction."""
    sample = fit.case.sample
    reference = flown_guess(run, sample)
    if reference is None:
        return
    readings = _other_readings(fit, reference)
    degrees = [name for name, reading in readings.items() if reading.endswith("degrees")]
    negated = [name for name, reading in readings.items() if reading.startswith("negated")]
    if degrees:
        yield ResultWarning(
            "looks_like_degrees",
            f"the angles {_listed(degrees)} of sample {sample.name!r} fit if they are read as "
            "degrees, and not as rad",
            f"give them in rad, or name the columns {', '.join(f'{name}_deg' for name in degrees)}",
            pointer if len(degrees) > 1 else f"{pointer}/{degrees[0]}_rad",
        )
    if negated == ["phi", "psi"]:
        yield ResultWarning(
            "swapped_sides",
            f"left and right are probably swapped in sample {sample.name!r}: the aircraft rolls and yaws "
            "to the other side than its drives make it",
            "exchange the columns of the left and the right drives, or change the signs of both phi and psi",
            pointer,
        )
    elif negated:
        yield ResultWarning(
            "flipped_sign",
            f"the sign of {_listed(negated)} in sample {sample.name!r} is probably wrong: with the opposite "
            "one the aircraft does what the model does",
            f"change the sign of {_listed(negated)}: roll to the right, nose up and nose to the right are "
            "positive",
            pointer if len(negated) > 1 else f"{pointer}/{negated[0]}_rad",
        )


def _other_readings(fit: SampleFit, reference: Array) -> dict[str, str]:
    """The reading of each angle that fits tenfold better than as it is given; "" where there is none.

    A model that does something else altogether proves nothing: with the best reading of every angle it must
    follow the sample.
    """
    sample, found = fit.case.sample, {}
    left, motion = 0.0, 0.0
    for number, name in enumerate(ANGLES):
        costs = angle_costs(sample, reference, number)
        given = costs.pop("given")
        best = min(costs, key=lambda each: costs[each])
        fitted = angle_costs(sample, fit.identified, number)["given"]
        clear = TENFOLD * costs[best] < given and given > sample.time_s.size * MIN_MOTION_RAD**2
        missed = not np.isfinite(fitted) or fitted > costs[best]
        found[name] = best if clear and missed else ""
        turned = np.unwrap(sample.euler[:, number]) - sample.euler[0, number]
        left += costs[best] if found[name] else given
        motion += float(np.sum((np.radians(turned) if found[name].endswith("degrees") else turned) ** 2))
    return found if left < HALF**2 * motion else dict.fromkeys(ANGLES, "")


# drives


def _drive_warnings(run: Identification, fit: SampleFit, pointer: str) -> Iterator[ResultWarning]:
    """Units, signs and sides of drives: each reading is flown by the physical guess."""
    sample = fit.case.sample
    # a rigid model leaves what bending does; a chain does not
    if not fit.error_share() > (POOR_SHARE if run.model.links_per_wing != 1 else HALF):
        return
    given = min(attitude_cost(sample, flown) for flown in (fit.initial, fit.identified))
    motion = float(np.sum(fit.case.motion**2))
    costs = {
        reading: attitude_cost(sample, flown_guess(run, reading.change(sample)))
        for reading in drive_readings(sample)
    }
    best = min(costs, key=lambda reading: costs[reading], default=None)
    if best is None or TENFOLD * costs[best] >= given or costs[best] > HALF**2 * motion:
        return
    yield ResultWarning(
        best.code, best.message.format(name=f"sample {sample.name!r}"), best.hint, f"{pointer}/{best.column}"
    )


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
