"""Laws of compiled kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from morphcore.jit import KernelOnly, entry_kernel, inlined, is_kept, kernel
from tests.kernels import from_python

ROOT = Path(__file__).resolve().parents[1]


@kernel
def _doubled(values):
    for i in range(values.size):
        values[i] *= 2.0


@entry_kernel
def _four_times(values):
    _doubled(values)
    _doubled(values)


def test_kernels_without_doors_refuse_python_and_serve_kernels() -> None:
    """Called from Python they say so, before and after they were compiled, instead of ending the process."""
    values = np.ones(3)
    if isinstance(_doubled, KernelOnly):  # not with compilation switched off
        with pytest.raises(TypeError, match="_doubled is called by kernels only"):
            _doubled(values)
    _four_times(values)
    np.testing.assert_array_equal(values, 4.0)
    if isinstance(_doubled, KernelOnly):
        with pytest.raises(TypeError, match="kernels only"):
            _doubled(values)
    from_python(_doubled)(values)
    np.testing.assert_array_equal(values, 8.0)


@inlined
def _thrice(value):
    return 3.0 * value


@entry_kernel
def _nine_times(values):
    for i in range(values.size):
        values[i] = _thrice(_thrice(values[i]))


def test_inlined_functions_serve_kernels_and_python() -> None:
    """Python runs their Python; kernels hold their code."""
    assert _thrice(2.0) == 6.0
    values = np.ones(3)
    _nine_times(values)
    np.testing.assert_array_equal(values, 9.0)
    assert _thrice(2.0) == 6.0


SCALED = """
from morphcore.jit import entry_kernel

@entry_kernel
def scaled(x):
    return 2 * x.sum()
"""
SCALE = """
import sys, numpy as np
sys.path.insert(0, {folder!r})
from scaled import scaled
for dtype in {dtypes!r}:
    scaled(np.ones(3, dtype=dtype))
print(sum(scaled.stats.cache_hits.values()))
"""


def test_processes_that_compile_at_once_keep_all_their_code(tmp_path: Path) -> None:
    """Two processes compile one entry for two types at the same time: a third finds both in the cache."""
    if is_kept(_four_times) is None:
        pytest.skip("nothing is compiled, or nothing is kept")
    (tmp_path / "scaled.py").write_text(SCALED, "utf-8")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}

    def hits(*calls: tuple[str, ...]) -> list[str]:
        running = [
            subprocess.Popen(
                [sys.executable, "-P", "-c", SCALE.format(folder=str(tmp_path), dtypes=dtypes)],
                env=environment,
                stdout=subprocess.PIPE,
                text=True,
            )
            for dtypes in calls
        ]
        return [each.communicate()[0].strip() for each in running]

    assert hits(("float64",), ("float32",)) == ["0", "0"]
    assert hits(("float64", "float32")) == ["2"]


def test_code_is_kept_only_while_all_kernels_are_what_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    """If a kernel in its code changes, an entry is compiled again although its own file is unchanged."""
    if is_kept(_four_times) is None:
        pytest.skip("nothing is compiled here")
    _four_times(np.ones(3))
    function = _four_times.py_func  # type: ignore[attr-defined]  # of a dispatcher
    assert is_kept(entry_kernel(function))
    monkeypatch.setattr("morphcore.jit.kernel_digest", lambda: "of other kernels")
    assert is_kept(entry_kernel(function)) is False


def test_kernels_that_cannot_be_kept_are_compiled_anew(tmp_path: Path) -> None:
    """A read-only library used without a home folder works and says once what would help."""
    (tmp_path / "__pycache__").touch()  # a file: not even root makes a folder of it
    (tmp_path / "twice.py").write_text(
        "from morphcore.jit import entry_kernel\n"
        "@entry_kernel\ndef twice(x):\n    return 2 * x\n"
        "@entry_kernel\ndef thrice(x):\n    return 3 * x\n"
        "print(twice(3) + thrice(1))\n",
        "utf-8",
    )
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": "/dev/null/home", "XDG_CACHE_HOME": "/dev/null/cache", "PYTHONPATH": str(ROOT)}
    environment["MPLCONFIGDIR"] = str(tmp_path / "plots")  # what matplotlib says of its own is its business
    ended = subprocess.run(
        [sys.executable, "-B", str(tmp_path / "twice.py")],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.stdout.strip() == "9", ended.stderr
    (sentence,) = ended.stderr.splitlines()
    assert "set NUMBA_CACHE_DIR" in sentence
