"""The figures as lines to print: description, value and requirement."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from benchmarks.requirements import BY_PATH
from benchmarks.search import search_table
from benchmarks.setting import LINKS, Figures
from benchmarks.work_precision import work_precision_table
from morphcore.lanes import TOGETHER


class Line(NamedTuple):
    """One line; ``must`` is empty if there is no requirement."""

    what: str
    value: str
    must: str = ""


def benchmark_table(figures: Figures) -> list[Line]:
    """Lines of all sections that were measured."""
    found: list[Line] = []
    for section, lines in LINES.items():
        if section not in figures:
            continue
        if isinstance(figures[section], dict) and "skipped" in figures[section]:
            found.append(Line(section, f"skipped: {figures[section]['skipped']}"))
        else:
            found += lines(figures)
    return found


def _must(figures: Figures, path: str, unit: str = "") -> str:
    """The bound of a figure and whether it holds."""
    requirement = BY_PATH[path]
    value = requirement.value(figures)
    if value is None:
        return ""
    verdict = "holds" if requirement.holds(value) else "FALLS SHORT"
    return f"{requirement.text}{unit}  {verdict}"


def _batch(figures: Figures) -> Iterator[Line]:
    settings, batch = figures["settings"], figures["batch"]
    what = f"{settings['particles']} models x {settings['flight_s']:.2f} s of flight, {LINKS} links a wing"
    path = "batch/real_time_factor_per_core"
    value = f"{batch['real_time_factor_per_core']:,.0f} x"
    yield Line(f"{what}, real time per core", value, _must(figures, path, unit=" x"))
    yield Line("the same with every model's trim", f"{batch['real_time_factor_per_core_with_trim']:,.0f} x")
    yield Line("flights a second on one core", f"{batch['flights_per_s']:,.0f}")


def _threads(figures: Figures) -> Iterator[Line]:
    threads = figures["threads"]
    for count, seconds in threads["generation_s"].items():
        yield Line(
            f"a whole generation of the swarm on {count} thread{'s' * (count != '1')}", f"{seconds:.3g} s"
        )
    path = "threads/speed_up"
    yield Line(
        "speed-up by threads, wall time",
        f"{threads['speed_up']:.2f} x",
        _must(figures, path, unit=" x"),
    )
    if "serial_share" in threads:
        path = "threads/speed_up_by_computing_time"
        value = f"{threads['speed_up_by_computing_time']:.2f} x"
        yield Line("by computing time, as on otherwise idle cores", value, _must(figures, path, unit=" x"))
        yield Line("of it on the calling thread alone", f"{100 * threads['serial_share']:.2g} %")
        yield Line("computing on two threads over that on one", f"{threads['work_growth']:.3g} x")


def _kernel(figures: Figures) -> Iterator[Line]:
    kernel = figures["kernel"]
    for name, text in (("batch", "a model in a batch"), ("single", "a model alone")):
        cost, share = kernel["s_per_simulated_s"][name], kernel["share_of_flight"][name]
        yield Line(f"the kernel of flight, a simulated second of {text}", f"{1e3 * cost:.3g} ms")
        yield Line("share of the kernel in the flight", f"{100 * share:.3g} %")
    yield Line(f"single lane over {TOGETHER} lanes", f"{kernel['lanes_gain']:.2g} x")
    yield Line("floating-point operations a second in lanes", f"{1e-9 * kernel['operations_per_s']:.3g} G/s")


def _single(figures: Figures) -> Iterator[Line]:
    single = figures["single_flight"]
    yield Line(f"one flight of {single['flight_s']:.2f} s, rigid", f"{1e3 * single['rigid_s']:.3g} ms")
    yield Line(f"one flight, {LINKS} links a wing", f"{1e3 * single['equivalent_s']:.3g} ms")
    yield Line("trim of one model", f"{1e3 * single['trim_s']:.3g} ms")
    yield Line("plan of one flight (lattice along the morph)", f"{1e3 * single['plan_s']:.3g} ms")


def _flexible(figures: Figures) -> Iterator[Line]:
    yield Line("one flight, flexible, with its trim", f"{figures['flexible']['flexible_s']:.3g} s")


def _growth(figures: Figures) -> Iterator[Line]:
    for links, s in figures["growth_with_links"]["s_per_simulated_s"].items():
        what = f"{TOGETHER} models of {links} link{'s' * (links != '1')} a wing, a simulated second"
        yield Line(what, f"{1e3 * s:.3g} ms")


def _hinges(figures: Figures) -> Iterator[Line]:
    for number, ratio in figures["hinges"]["ratio_to_one_hinge"].items():
        if number != "1":
            yield Line(f"the swarm on {number} hinges a wing over the swarm on one", f"{ratio:.3g} times")


def _operations(figures: Figures) -> Iterator[Line]:
    for sweep, by_links in figures["operations"].items():
        for links in sorted(by_links, key=int):
            parts = by_links[links]
            what = f"operations a simulated second, {sweep}, {links} a wing: structure + lattice"
            value = " + ".join(f"{1e-6 * parts[part]['total']:.2f}" for part in ("structure", "lattice"))
            yield Line(what, f"{value} M")
    growth = f"{figures['structural_growth']:.4g}"
    yield Line(
        "most expensive additional link relative to the second", growth, _must(figures, "structural_growth")
    )


def _search(figures: Figures) -> Iterator[Line]:
    found = figures["search"]
    methods = found["methods"].values()
    arrived, runs = (sum(method[name] for method in methods) for name in ("arrived", "seeds"))
    what = f"searches from {len(found['samples'])} flights that end within 10 % of the best J"
    yield Line(what, f"{arrived} of {runs}", _must(figures, "search/arrived_share"))
    path = "search/flight_sets_to_target"
    yield Line(
        "model evaluations to target, worst", f"{found['flight_sets_to_target']:,}", _must(figures, path)
    )
    path = "search/wall_s_to_target"
    value = f"{found['wall_s_to_target']:.3g} s"
    yield Line("time to there, median", value, _must(figures, path, unit=" s"))
    for name, value in search_table(found):
        yield Line(f"search: {name}", value)


def _mujoco(figures: Figures) -> Iterator[Line]:
    found = figures["mujoco"]
    what = (
        f"{found['links_per_wing']} links, {found['flight_s']:g} s without air, to {found['error_rad']:g} rad"
    )
    for name, cost in found["flight_cost_s"].items():
        who = {"batch": "ours in a batch", "single": "ours alone"}.get(name, f"MuJoCo, {name}")
        yield Line(f"{what}: {who}", f"{1e3 * cost:.3g} ms ({1e3 * found['step_s'][name]:.3g} ms steps)")
    for name, text in (("batch", "in a batch"), ("single", "alone")):
        value = f"{found[f'{name}_ratio']:.3g} x"
        yield Line(
            f"time of MuJoCo's best integrator over ours {text}",
            value,
            _must(figures, f"mujoco/{name}_ratio", unit=" x"),
        )
    yield Line("both programs' converged attitudes differ by", f"{found['agreement_rad']:.2g} rad")


def _step_error(figures: Figures) -> Iterator[Line]:
    error = figures["step_error"]
    what = f"attitude error of the step {1e3 * error['step_s']:g} ms"
    yield Line(what, f"{error['worst_rad']:.2g} rad", _must(figures, "step_error/worst_rad"))


def _lattice(figures: Figures) -> Iterator[Line]:
    yield Line("one lattice operator", f"{1e3 * figures['lattice']['operator_s']:.3g} ms")


def _memory(figures: Figures) -> Iterator[Line]:
    memory = figures["memory"]
    for flights, peak in memory["beyond_mb"].items():
        path = f"memory/beyond_mb/{flights}"
        must = _must(figures, path, unit=" MB") if path in BY_PATH else ""
        yield Line(f"memory of {memory['particles']} models, flights {flights}", f"{peak:.0f} MB", must)


def _start_up(figures: Figures) -> Iterator[Line]:
    stages = figures["start_up"]
    for stage, what in (
        ("warm_up", "loading compiled kernels"),
        ("job", "warm process: from a request to its first generation"),
        ("generation", "its first generation"),
    ):
        value = f"{stages[stage]['wall_s']:.2f} s ({stages[stage]['computing_s']:.2f} s computing)"
        must = _must(figures, "start_up/job/computing_s", unit=" s") if stage == "job" else ""
        yield Line(what, value, must)
    imported = stages["import"]
    yield Line(
        "import time relative to numpy, scipy.optimize and numba",
        f"{imported['library_s']:.2f} s, {imported['ratio']:.2f} times",
        _must(figures, "start_up/import/ratio"),
    )


def _compilation(figures: Figures) -> Iterator[Line]:
    found = figures["compilation"]
    value = f"{found['computing_s']:.0f} s"
    must = _must(figures, "compilation/computing_s", unit=" s")
    yield Line("compiling the kernels of an identification", value, must)
    yield Line("then all other kernels", f"{found['further_computing_s']:.0f} s")
    for kernel, seconds in list(found["by_entry_s"].items())[:5]:
        yield Line(f"of it {kernel.removeprefix('morphcore.')}", f"{seconds:.1f} s")


def _work_precision(figures: Figures) -> Iterator[Line]:
    found = figures["work_precision"]
    for name, step, stages, cost in work_precision_table(found):
        what = f"longest step within {found['goal_rad']:g} rad, {name}"
        yield Line(what, f"{step}, {stages} stages a second, cost {cost}")


LINES: Mapping[str, Callable[[Figures], Iterator[Line]]] = {
    "batch": _batch,
    "threads": _threads,
    "kernel": _kernel,
    "single_flight": _single,
    "flexible": _flexible,
    "growth_with_links": _growth,
    "hinges": _hinges,
    "operations": _operations,
    "search": _search,
    "mujoco": _mujoco,
    "work_precision": _work_precision,
    "step_error": _step_error,
    "lattice": _lattice,
    "memory": _memory,
    "start_up": _start_up,
    "compilation": _compilation,
}
