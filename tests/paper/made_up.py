"""Small made-up results of all stages: shapes and names as the stages give them, figures invented."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from morphcore.paper.scenario import paper_flights
from morphcore.paper.stages import Finished

Document = dict[str, Any]

WHERE = {
    "machine": {"processor": "abacus <1 bead>", "cores": 2, "threads": 2, "system": "Desk"},
    "versions": {"morphid": "0.0", "python": "3"},
}
TIME_S = np.linspace(0.0, 0.4, 41)
LATTICE = {"chordwise": 4, "spanwise": 10, "core": {"law": "line", "fraction": 0.1}}
RESOLUTION = {"what": "as flown", "elements": 10, "step_s": 0.001, "lattice": LATTICE}


def results() -> dict[str, Document]:
    """Give the results of all stages; a caller may change them."""
    made = {
        "truth": _truth(),
        "study": _study(),
        "identification": _identification(5e-8, 4e-5),
        "swarm": _identification(4e-4, 2e-2),
        "computation": _computation(),
        "morph": _morph(),
        "swarm_morph": _search(2.0),
        "unsettled_morph": _search(0.0),
        "fastest_morph": _search(2.0) | {"duration_s": 1.2},
        "front": _front(),
        "flown_morphs": _flown(),
        "independent": _independent(),
    }
    return copy.deepcopy(made)


def finished(made: dict[str, Document] | None = None) -> dict[str, Finished]:
    """Give them as the runner does."""
    return {
        name: Finished("0123456789abcdef", result, 10.0, "2026-01-02T03:04:05+00:00", WHERE)
        for name, result in (made or results()).items()
    }


def angles(theta: np.ndarray[Any, Any]) -> dict[str, list[float]]:
    """Give the angles of a symmetric flight."""
    still = np.zeros_like(theta).tolist()
    return {"phi_rad": still, "theta_rad": theta.tolist(), "psi_rad": still}


def per_angle(theta: float) -> dict[str, float]:
    """Give a figure of pitch, and round-off for the others."""
    return {"phi": 1e-13, "theta": theta, "psi": 1e-13}


def _sweeps() -> dict[str, list[float]]:
    return dict.fromkeys(("sweep_left_rad", "sweep_right_rad"), (TIME_S / 0.4).tolist())


def _truth() -> Document:
    flights = [
        {
            "label": each.label,
            "sample": {
                "name": each.name,
                "role": each.role,
                "time_s": TIME_S.tolist(),
                **_sweeps(),
                **angles(-0.1 * TIME_S),
            },
            "tip_left_z_m": (-0.2 + TIME_S).tolist(),
            "tip_right_z_m": (-0.2 + TIME_S).tolist(),
            "trim": {"alpha_rad": 0.068, "tip_z_m": -0.276},
            "wall_s": 3.0,
        }
        for each in paper_flights()
    ]
    rows = [
        RESOLUTION | {"what": "elements doubled", "elements": 20, "max_abs_rad": per_angle(1e-6)},
        RESOLUTION | {"what": "step halved", "step_s": 0.0005, "max_abs_rad": per_angle(2e-6)},
    ]
    return {
        "resolution": RESOLUTION,
        "flights": flights,
        "convergence": {"flight": "rate_0.5", "rows": rows},
    }


def _fit(J: float, rms: float) -> list[Document]:
    return [
        {
            "sample": each.name,
            "role": each.role,
            "J_rigid": 0.1,
            "J_initial": 0.03,
            "J_identified": J,
            "rms_rad": per_angle(rms),
            "max_abs_rad": per_angle(2 * rms),
            "rms_rigid_rad": per_angle(0.02),
            "range_rad": per_angle(0.2),
        }
        for each in paper_flights()
    ]


def _model() -> Document:
    return {
        "links_per_wing": 3,
        "division": [0.2, 0.5, 0.3],
        "stiffness_nm_rad": [[5e4, 5e4, 5e5], [3e4, 4e4, 5e5]],
        "damping_nms_rad": [200.0, [100.0, 200.0, 2000.0]],
        "aero": {"lift_factor": 0.99, "ac_offset_m": -0.001, "profile_drag": 0.01, "lag_s": 0.004},
    }


def _study() -> Document:
    rows = [
        {
            "links_per_wing": n,
            "bodies": 1 + 2 * n,
            "parameters": 4 + 7 * (n - 1),
            "J_train": 10.0 ** (-2 * n),
            "J_held_out": 10.0 ** (-2 * n + 1),
            "rms_rad": per_angle(10.0**-n),
            "flight_s": 0.01 * (1 + n),
            "identify_s": 5.0 * n,
            "fit": _fit(10.0 ** (-2 * n), 10.0**-n),
        }
        for n in (1, 2, 3)
    ]
    return {
        "rows": rows,
        "rigid": {"J_train": 0.3, "J_held_out": 0.3, "flight_s": 0.01},
        "recommended": {"links_per_wing": 3, "reason": "3 links: J = 1e-06 rad^2.", "judged_by": "held_out"},
        "cost": {"flight_duration_s": 2.0},
    }


def _identification(J: float, rms: float) -> Document:
    curves = [
        {
            "name": each.name,
            "role": each.role,
            "time_s": TIME_S.tolist(),
            **_sweeps(),
            "measured": angles(-0.1 * TIME_S),
            "rigid": angles(-0.12 * TIME_S),
            "identified": angles(-0.1 * TIME_S + rms),
        }
        for each in paper_flights()
    ]
    history = [
        {"generation": i, "particles": 100, "flights": 300 * (i + 1), "best_cost": J * 10.0 ** (3 - i)}
        for i in range(4)
    ]
    search = {"flights": 1200, "generations": 3, "best_cost": J, "wall_s": 12.0, "history": history}
    return {"model": _model(), "fit": _fit(J, rms), "curves": curves, "search": search}


def _times(total_s: float) -> dict[str, float]:
    return {"prepare_s": 0.1 * total_s, "fly_s": 0.9 * total_s, "total_s": total_s, "wall_s": 1.1 * total_s}


def _computation() -> Document:
    models = {"rigid": _times(0.01), "equivalent": _times(0.012), "flexible": _times(3.0)}
    rows = [
        {
            "flight": name,
            "label": label,
            "duration_s": duration_s,
            "models": models,
            "slowest_over_fastest": dict.fromkeys(models, 1.1),
        }
        for name, label, duration_s in (("two_seconds", "1 rad in 2 s", 2.0), ("rate_0.5", "0.5 rad/s", 2.5))
    ]
    batch = {"parameter_sets": 480, "rounds": 3, "prepare_s": 0.2, "fly_s": 0.4, "flight_s": 0.6 / 480}
    return {"flights": rows, "batch": batch, "links_per_wing": 3}


def _spline(duration_s: float) -> Document:
    return {"kind": "spline", "knot_time_s": [0.0, duration_s], "knot_angle_rad": [0.0, 1.0]}


def _search(settle_s: float) -> Document:
    reached = {"max_rate_rad_s": 0.99, "max_accel_rad_s2": 5.0}
    return {
        "duration_s": 2.0,
        "morph": {"settle_s": settle_s},
        "schedules": {"optimum": _spline(2.0)},
        "reached": {"constant": reached, "rigid_optimum": reached, "optimum": reached},
        "variation": {
            "constant": {"rigid": 19.0, "equivalent": 20.0, "flexible": None},
            "rigid_optimum": {"rigid": 15.0, "equivalent": 15.5, "flexible": None},
            "optimum": {"rigid": 15.0, "equivalent": 15.0, "flexible": None},
        },
        "search": {"search_s": 7.0, "wall_s": 8.0},
    }


def _morph() -> Document:
    time_s = np.linspace(0.0, 4.0, 401)
    motion = {
        "sweep_rad": np.clip(time_s / 2.0, 0.0, 1.0).tolist(),
        "rate_rad_s": (0.5 * (time_s < 2.0)).tolist(),
        "acceleration_rad_s2": np.zeros_like(time_s).tolist(),
    }
    names = ("constant", "rigid_optimum", "optimum")
    flown = {name: angles(-0.1 * time_s) for name in names}
    found = _search(2.0)
    variation = {
        name: values | {"flexible": flexible}
        for (name, values), flexible in zip(found["variation"].items(), (20.0, 20.824, 15.0), strict=True)
    }
    return found | {
        "variation": variation,
        "schedule": {"knot_time_s": [0.0, 2.0], "knot_sweep_rad": [0.0, 1.0]},
        "limits": {"max_rate_rad_s": 1.0, "max_accel_rad_s2": None},
        "reduction_percent": 25.0,
        "checked": {"max_rate_rad_s": 0.9999, "min_rate_rad_s": -1e-16, "found_s": 7.0},
        "curves": {
            "time_s": time_s.tolist(),
            "schedules": dict.fromkeys(names, motion),
            "flights": {"flexible": flown},
        },
    }


def _front() -> Document:
    points = [
        {"duration_s": t, "schedule": _spline(t), "optimum_rad2": 20.0 - t, "constant_rad2": 21.0}
        for t in (1.5, 2.5)
    ]
    return {"window_s": 4.0, "points": points}


def _flown() -> Document:
    names = ("swarm_morph", "unsettled_morph", "fastest_morph", "front_1.50_s", "front_2.50_s")
    rows = [
        {"name": name, "duration_s": 2.0, "variation_rad2": 16.0, "variation_of_morph_rad2": 2.0}
        for name in names
    ]
    return {"window_s": 4.0, "flown": rows}


def _independent() -> Document:
    names = ("train_asymmetric", "train_rate_0.5")
    shares = {
        "train_asymmetric": {"phi": 0.015, "theta": 0.005, "psi": 0.01},
        "train_rate_0.5": {"phi": None, "theta": 0.006, "psi": None},
    }
    flights = [
        {
            "sample": name,
            "rms_rad": per_angle(7e-4),
            "max_abs_rad": per_angle(2e-3),
            "range_rad": per_angle(0.2),
            "worst_share": shares[name],
            "ours": angles(-0.1 * TIME_S),
        }
        for name in names
    ]
    laws = [
        {"core": core, "trim": {"alpha_rad": alpha, "tip_z_m": -0.2768}, "flights": copy.deepcopy(flights)}
        for core, alpha in (("line", 0.0684), ("smoothed", 0.0626))
    ]
    return {
        "available": True,
        "laws": laws,
        "theirs": {"alpha_rad": 0.0623, "tip_z_m": -0.273, "wall_s": {"train_rate_0.5": 16.7}},
        "samples": [{"name": name, "time_s": TIME_S.tolist(), **angles(-0.101 * TIME_S)} for name in names],
    }
