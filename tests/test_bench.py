"""Benchmarks: what they report, where the flights come from, whose clock counts."""

from __future__ import annotations

import itertools
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.requirements import judged
from benchmarks.run import SECTIONS, run_benchmarks
from benchmarks.setting import Effort
from benchmarks.table import LINES, benchmark_table
from morphcore.errors import InvalidInput
from morphcore.geometry.aircraft import Aircraft, Flight
from morphcore.models.equivalent import chain_model, physical_guess
from morphcore.paper.computation import benchmark_swarm
from morphcore.threads import thread_count
from morphdata.aircraft import load_aircraft
from morphdata.flight import load_flight
from morphdata.lattice import Lattice

SMALLEST = Effort(particles=17, rounds=1, singles=1, links=(1, 2), refinement=2)
TIMED = ("batch", "single_flight", "growth_with_links", "step_error", "lattice")


def test_figures_follow_from_the_times() -> None:
    """With a clock that ticks one second a look, every time is known, and so is every factor made of them."""
    threads = thread_count()
    ticks = itertools.count()

    def tick() -> float:
        return float(next(ticks))

    figures = run_benchmarks(effort=SMALLEST, sections=TIMED, clock=tick, computing=tick)
    assert thread_count() == threads, "the caller's threads are as before"
    json.dumps(figures, allow_nan=False)
    flights_s, batch = figures["settings"]["flight_s"], figures["batch"]
    assert flights_s == pytest.approx(5.49 + 2.49 + 1.74)
    assert batch["flights"] == 17 * 3
    assert (batch["fly_s"], batch["trim_s"], batch["untrimmed"]) == (3.0, 1.0, 0)
    assert batch["real_time_factor_per_core"] == pytest.approx(17 * flights_s / 3)
    assert batch["real_time_factor_per_core_with_trim"] == pytest.approx(17 * flights_s / 4)
    assert figures["growth_with_links"]["s_per_simulated_s"] == pytest.approx({"1": 1 / 2.49, "2": 1 / 2.49})
    assert figures["single_flight"] | {"flight_s": 0} == {
        "flight_s": 0,
        "rigid_s": 1.0,
        "equivalent_s": 1.0,
        "trim_s": 1.0,
        "plan_s": 1.0,
    }
    assert 1e-9 < figures["step_error"]["worst_rad"] < 1e-4
    assert figures["step_error"]["worst_rad"] == max(figures["step_error"]["rad"].values())
    table = {line.what: line for line in benchmark_table(figures)}
    assert table["one lattice operator"].value == "1e+03 ms"
    (speed,) = [line for what, line in table.items() if what.endswith("real time per core")]
    assert speed.must == ">= 3,000 x  FALLS SHORT"  # 17 flights in three seconds
    holds = {each["figure"]: each["holds"] for each in figures["requirements"]}
    assert holds["batch/real_time_factor_per_core"] is False
    assert holds["step_error/worst_rad"] is True
    assert not any(name.startswith("mujoco") for name in holds), "what was not measured is not judged"


def test_every_section_has_lines_and_a_wrong_name_is_reported() -> None:
    """No section is measured that the table would swallow; a name that is none is refused with the list."""
    shown = {name for name, lines in LINES.items() if lines is not None}
    given = (set(SECTIONS) | {"threads"}) - shown
    assert not given
    with pytest.raises(InvalidInput, match="no benchmark 'speed'") as caught:
        run_benchmarks(effort=SMALLEST, sections=["speed"])
    assert "mujoco" in str(caught.value.hint)


def test_without_mujoco_the_comparison_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is skipped with a word, in the table too, and no bound on it is judged."""
    monkeypatch.setitem(sys.modules, "benchmarks.mujoco_tree", None)
    figures = run_benchmarks(effort=SMALLEST, sections=["mujoco"])
    assert "`oracles`" in figures["mujoco"]["skipped"]
    (line,) = benchmark_table(figures)
    assert line.value.startswith("skipped: MuJoCo is not installed")
    assert figures["requirements"] == []


@pytest.mark.parametrize(("value", "holds"), [(3000.0, True), (2999.9, False), (float("nan"), False)])
def test_a_bound_is_held_or_not(value: float, holds: bool) -> None:  # noqa: FBT001
    """A figure on its bound holds; one that is no number does not."""
    (found,) = judged({"batch": {"real_time_factor_per_core": value}})
    assert found["holds"] is holds


def test_swarm_is_the_same_every_time(examples: Path) -> None:
    """The benchmark's parameter sets depend on the seed alone, lie on the simplex and around the guess."""
    model = chain_model(
        Aircraft.of(load_aircraft(examples / "aircraft.json")),
        Flight.of(load_flight(examples / "flight.json")),
        3,
        Lattice(chordwise=1),
    )
    one, same, other = (benchmark_swarm(model, 500, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one["stiffness_nm_rad"], same["stiffness_nm_rad"])
    assert not np.array_equal(one["stiffness_nm_rad"], other["stiffness_nm_rad"])
    np.testing.assert_allclose(one["division"].sum(axis=-1), 1.0, rtol=1e-14)
    spread = np.log(one["stiffness_nm_rad"] / physical_guess(model, one["division"])["stiffness_nm_rad"])
    assert np.std(spread) == pytest.approx(0.3, rel=0.1)


def test_flights_may_lie_anywhere(tmp_path: Path) -> None:
    """A folder that does not hold them is refused."""
    with pytest.raises(InvalidInput, match=r"aircraft\.json does not exist"):
        run_benchmarks(effort=SMALLEST, samples_dir=tmp_path)
