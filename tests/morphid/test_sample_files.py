"""Sample files of the command line, in every format."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from morphcore import load_trajectory
from morphid.exits import CommandError, Exit
from morphid.running import sample_document


def test_every_format_makes_the_same_request(examples: Path, tmp_path: Path) -> None:
    """A flight as CSV, JSON, Parquet and MATLAB file becomes the same sample of a request."""
    source = examples / "train_rate_0.8.csv"
    flown = load_trajectory(source)
    columns = {
        "t": flown.time_s,
        **{name: getattr(flown, name) for name in ("sweep_left", "sweep_right", "phi", "theta", "psi")},
    }
    places = {ending: tmp_path / f"train_rate_0.8.{ending}" for ending in ("json", "parquet", "mat")}
    places["json"].write_text(json.dumps({name: column.tolist() for name, column in columns.items()}))
    pq.write_table(pa.table(columns), places["parquet"])
    scipy.io.savemat(places["mat"], {"flight": columns}, do_compression=True)
    expected = sample_document(source, "train")
    for path in places.values():
        assert sample_document(path, "train") == expected


@pytest.mark.parametrize("ending", ["csv", "json", "parquet", "mat"])
def test_a_broken_file_is_told_in_a_sentence(tmp_path: Path, ending: str) -> None:
    """The file is named, the exit code says invalid input, and there is a way out."""
    path = tmp_path / f"x.{ending}"
    path.write_bytes(np.random.default_rng(1).bytes(1000))
    with pytest.raises(CommandError, match=path.name) as caught:
        sample_document(path, "train")
    assert caught.value.code is Exit.INVALID_INPUT
    assert caught.value.hint
