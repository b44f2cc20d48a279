"""Files made to exhaust or break their reader: a problem each, and nobody else notices."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import pyarrow as pa
import pytest
import scipy.io

from tests.app.hostile.api_process import MIB, ApiProcess, Onlooker, api_process
from tests.app.hostile.bombs import BOMBS, NAMES, parquet
from tests.app.hostile.log_bombs import LOG_BOMBS
from tests.waiting import until

ANSWER_S = 40.0  # the wall limit of a parser is 20 s; the machine of the tests is a busy one
GROWN_MIB = 64.0  # the largest upload here has 16 MB; what one reader would take is ten times as much
# one of each kind of harm; the others are as bad in the same ways
FAST = frozenset(
    {
        "csv_of_a_million_columns.csv",
        "mat_of_nested_cells.mat",
        "mat_of_many_objects.mat",
        "parquet_of_many_rows.parquet",
        "hdf5_of_a_huge_piece.mat",
        "hdf5_of_cycles.mat",
        "log_of_a_type_in_itself.ulg",
        "log_of_damage.ulg",
    }
)
ALL_BOMBS = BOMBS | LOG_BOMBS
CALM_S = 3.0  # of /livez meanwhile: milliseconds on a quiet machine


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ApiProcess]:
    """One API with the limits that a service has."""
    with api_process(tmp_path_factory.mktemp("api")) as running:
        # everything that is loaded on first use is loaded
        upload(running, b"x", "x.csv")
        yield running


def upload(api: ApiProcess, content: bytes, filename: str) -> httpx.Response:
    """Upload a file as a form."""
    return api.client.post("/trajectories", files={"file": (filename, content)})


def assert_no_process_left(api: ApiProcess) -> None:
    """Every parser was ended and reaped."""
    until(lambda: not api.children(), 5.0, seen=api.children)


@pytest.mark.parametrize(
    "name", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in ALL_BOMBS]
)
def test_a_bomb_harms_nobody(api: ApiProcess, name: str) -> None:
    """It is answered with a problem within seconds; the API's memory and the other requests stay calm."""
    ending, made = ALL_BOMBS[name]
    content = made()
    with Onlooker(api) as onlooker:
        start = time.perf_counter()
        answer = upload(api, content, f"flight{ending}")
        took_s = time.perf_counter() - start
    problem = answer.json()
    print(
        f"{name}: {answer.status_code} {problem['code']} in {took_s:.1f} s, "
        f"+{onlooker.grown_mib:.0f} MiB, livez {1000 * onlooker.slowest_s:.0f} ms: {problem['detail']}"
    )
    assert answer.status_code in (413, 415, 422), answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert problem["pointer"].startswith("/file")
    assert problem["hint"]
    assert took_s < ANSWER_S
    assert onlooker.failures == []
    assert onlooker.grown_mib < GROWN_MIB
    assert onlooker.slowest_s < CALM_S
    assert_no_process_left(api)


@pytest.mark.slow
def test_many_bombs_at_once_wait_in_line(api: ApiProcess) -> None:
    """Two are read at once, the others wait or get a retry response; the API stays responsive."""
    _, made = BOMBS["mat_of_many_objects.mat"]
    content = made()

    def send(_: int) -> int:
        with httpx.Client(base_url=api.client.base_url, timeout=120.0) as client:
            return client.post("/trajectories", files={"file": ("x.mat", content)}).status_code

    with Onlooker(api) as onlooker, ThreadPoolExecutor(8) as threads:
        maximum = 0
        answers = threads.map(send, range(8))
        while not onlooker.answers or onlooker.answers < 20:
            maximum = max(maximum, len(api.children()))
            time.sleep(0.02)
        statuses = list(answers)
    assert set(statuses) <= {422, 503}, statuses
    assert 1 <= maximum <= 2
    assert onlooker.grown_mib < GROWN_MIB
    assert onlooker.slowest_s < CALM_S
    assert_no_process_left(api)


def test_columns_nobody_asked_for_are_not_read(api: ApiProcess) -> None:
    """A column of enormous texts in a valid flight costs nothing: it is never decoded."""
    time_s = 0.01 * np.arange(10)
    texts = pa.array(["x" * MIB] * 10, pa.large_string())
    content = parquet(pa.table({**dict.fromkeys(NAMES, time_s), "note": texts}), compression="zstd")
    answer = upload(api, content, "flight.parquet")
    assert (answer.status_code, answer.json().get("rows")) == (201, 10)


@pytest.mark.parametrize("ending", ["csv", "json", "parquet", "mat"])
def test_every_format_stores_the_same_flight(api: ApiProcess, ending: str) -> None:
    """CSV, JSON, Parquet and MATLAB files of one flight read back alike, to the last digit."""
    time_s = 0.01 * np.arange(100)
    columns = {name: np.sin(time_s + number) for number, name in enumerate(NAMES)} | {"t": time_s}
    if ending == "parquet":
        content = parquet(pa.table(columns))
    elif ending == "mat":
        stream = io.BytesIO()
        scipy.io.savemat(stream, {"flight": columns}, do_compression=True)
        content = stream.getvalue()
    elif ending == "json":
        content = str({name: column.tolist() for name, column in columns.items()}).replace("'", '"').encode()
    else:
        rows = "\n".join(",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True))
        content = (",".join(columns) + "\n" + rows).encode()
    answer = upload(api, content, f"my flight.{ending}")
    assert answer.status_code == 201, answer.text
    back = api.client.get(answer.headers["location"]).json()
    assert back["name"] == "my-flight"
    assert back["time_s"] == time_s.tolist()
    assert back["theta_rad"] == columns["theta"].tolist()


def test_the_api_never_loads_the_readers(api: ApiProcess) -> None:
    """After all these files the API process has mapped neither numpy nor scipy nor Arrow."""
    mapped = Path(f"/proc/{api.pid}/maps").read_text()
    for library in ("numpy", "scipy", "arrow"):
        assert f"/{library}/" not in mapped
        assert f"/py{library}/" not in mapped
