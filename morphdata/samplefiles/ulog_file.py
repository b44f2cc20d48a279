"""Flights as ULog files, the logs of PX4, through pyulog.

By the definition of its messages, PX4 logs attitude as a quaternion from FRD to NED, scalar first. Messages
come at rates of their own: all are interpolated onto the times of the attitude.
"""

from __future__ import annotations

import contextlib
import io
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from morphdata.samplefiles.columns import FlightColumns, Wanted
from morphdata.samplefiles.fault import FileFault, shown
from morphdata.samplefiles.frames import HERE, QUATERNION
from morphdata.samplefiles.matlab_file import vectors

Array = NDArray[np.float64]

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
HEADER_BYTES = 16
MESSAGE_HEAD = struct.Struct("<HB")  # size and kind
LONGEST_MESSAGE = 10_000
DATA, SUBSCRIPTION, FLAGS, FORMAT = map(ord, "DABF")
NUMBER = struct.Struct("<H")  # of a subscription
OFFSETS = struct.Struct("<3Q")  # of appended data, last in the flags
SYNC = MESSAGE_HEAD.pack(8, ord("S")) + b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
ATTITUDE = "vehicle_attitude"
CHANNELS = {  # ours -> where PX4 logs it; the first that there is counts
    "p": ("vehicle_angular_velocity.xyz[0]",),
    "q": ("vehicle_angular_velocity.xyz[1]",),
    "r": ("vehicle_angular_velocity.xyz[2]",),
    "fx": ("vehicle_acceleration.xyz[0]",),
    "fy": ("vehicle_acceleration.xyz[1]",),
    "fz": ("vehicle_acceleration.xyz[2]",),
    **{name: (f"vehicle_local_position.{name}",) for name in ("x", "y", "z", "vx", "vy", "vz")},
    "airspeed": ("airspeed_validated.true_airspeed_m_s", "airspeed.true_airspeed_m_s"),
}
MICROSECOND = 1e-6
LONGEST_DELAY_US = 1_000_000  # from a measurement to its message; a time of measurement beyond is none
SHORTEST_GAP_S = 0.1  # between two values of a channel
GAP_STEPS = 5.0  # of a channel's usual step: nothing is interpolated across more
OF_MOTORS = ("actuator", "servo", "tilt", "flap", "wing", "hinge", "morph", "debug", "encoder")
MAX_LISTED = 8


@dataclass(frozen=True)
class _Stream:
    """One field of one message: times (us, rising) and values."""

    times_us: NDArray[np.int64]
    values: Array


def read_ulog(stream: BinaryIO, wanted: Wanted) -> FlightColumns:
    """Read attitude, channels, and those fields that were declared to be drives.

    Raises
    ------
    FileFault : naming the message or the field.
    """
    try:
        from pyulog import ULog
    except ImportError:
        raise FileFault(
            "needs_pyulog",
            "ULog files are read by pyulog, which is not installed",
            "pip install 'morphid[formats]', or convert the log to CSV",
        ) from None
    if wanted.declared.frames != HERE:
        raise FileFault(
            "two_frames", "a ULog file is in NED and FRD by its format", "declare no other axes for it"
        )
    content = stream.read()
    if not content.startswith(MAGIC):
        raise FileFault("not_ulog", "this is not a ULog file", "give the .ulg file as PX4 wrote it")
    topics = _topics(wanted)
    try:
        # pyulog closes what it reads, and prints
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(io.BytesIO(_excerpt(content, topics)), topics)
        return _read(log, wanted)
    except (FileFault, MemoryError):
        raise
    # pyulog has no error of its own for a broken file: anything comes out of it
    except Exception as error:  # noqa: BLE001
        words = shown(error) or type(error).__name__
        raise FileFault(
            "not_ulog", f"this is not a readable ULog file: {words}", "download the log again"
        ) from None


def _excerpt(content: bytes, topics: Collection[str]) -> bytes:
    """The messages of a log that count: definitions, and the data of some topics.

    pyulog takes microseconds for each of the others, and looks for the end of a damage byte by byte, at the
    end of a file for ever; here reading goes on at the next mark for that.
    """
    numbers: set[int] = set()
    pieces, at = [content[:HEADER_BYTES]], HEADER_BYTES
    seams = _seams(content)
    while at + MESSAGE_HEAD.size <= len(content):
        size, kind = MESSAGE_HEAD.unpack_from(content, at)
        end = at + MESSAGE_HEAD.size + size
        seam = next((seam for seam in seams if at < seam < end), None) if seams else None
        if seam is not None:  # what was cut off there is no message
            at = seam
            continue
        if not (0 < size <= LONGEST_MESSAGE and kind):
            at = content.find(SYNC, at)
            if at < 0:
                break
            continue
        body = at + MESSAGE_HEAD.size
        if kind == DATA:
            if size > 2 and NUMBER.unpack_from(content, body)[0] in numbers:
                pieces.append(content[at:end])
        elif kind == SUBSCRIPTION:
            if size > 3 and content[body + 3 : end].decode("utf-8", "replace") in topics:
                numbers.update(NUMBER.unpack_from(content, body + 1))
                pieces.append(content[at:end])
        elif kind == FLAGS:
            pieces.append(content[at : end - OFFSETS.size] + bytes(OFFSETS.size))
        elif kind == FORMAT:
            pieces.append(content[at:end])
        at = end
    return b"".join(pieces)


def _seams(content: bytes) -> list[int]:
    """Where data were appended to a log, by its first message."""
    flags = MESSAGE_HEAD.pack(40, FLAGS)
    if content[HEADER_BYTES : HEADER_BYTES + len(flags)] != flags or len(content) < HEADER_BYTES + 43:
        return []
    return [seam for seam in OFFSETS.unpack_from(content, HEADER_BYTES + 19) if seam > 0]


def _topics(wanted: Wanted) -> list[str]:
    """Names of the messages that are read, with and without the number of an instance."""
    fields = [field for fields in CHANNELS.values() for field in fields]
    fields += [source.title for source in wanted.declared.columns.values()]
    names = [ATTITUDE, *(field.partition(".")[0] for field in fields)]
    return [*dict.fromkeys(name for full in names for name in (full, full.rpartition("_")[0]) if name)]


def _read(log: Any, wanted: Wanted) -> FlightColumns:
    attitude = [_stream(log, f"{ATTITUDE}.q[{number}]") for number in range(4)]
    if None in attitude:
        raise FileFault(
            "missing",
            f"the log has no {ATTITUDE} with a quaternion",
            "log the estimated attitude; morphing flights need it at 50 Hz or more",
        )
    declared = {name: _required(log, source.title, name) for name, source in wanted.declared.columns.items()}
    if wanted.optional and not declared:
        raise FileFault(
            "missing", "no field of the log is declared to be a drive", f"{_example()}{_candidates(log)}"
        )
    times_us = _within(attitude[0].times_us, declared, wanted)  # type: ignore[union-attr]
    table = dict(zip(QUATERNION, (_at(times_us, each) for each in attitude if each), strict=True))
    table |= {name: _at(times_us, each) for name, each in declared.items()}
    for name, fields in CHANNELS.items():
        found = next((each for field in fields if (each := _stream(log, field)) is not None), None)
        if found is not None and wanted.declared.called(name):
            table[name] = _at(times_us, found, gaps=True)
    table["t"] = MICROSECOND * (times_us - attitude[0].times_us[0]).astype(np.float64)  # type: ignore[union-attr]
    return vectors({name: values[None, :] for name, values in table.items()}, wanted)


def _example() -> str:
    return "declare one: --column sweep_left=TOPIC.FIELD*SCALE+OFFSET"


def _candidates(log: Any) -> str:
    """Messages of the log that may hold angles of drives, for people."""
    names = [name for name in log.message_formats if any(word in name for word in OF_MOTORS)]
    return f"; the log knows {', '.join(map(shown, names[:MAX_LISTED]))}" if names else ""


def _required(log: Any, field: str, name: str) -> _Stream:
    found = _stream(log, field)
    if found is None:
        raise FileFault(
            "missing",
            f"the log has no {shown(field)!r}, which was declared to be {name}",
            "write TOPIC.FIELD (actuator_outputs.output[0]), TOPIC_1.FIELD for the second instance"
            + _candidates(log),
        )
    return found


def _stream(log: Any, field: str) -> _Stream | None:
    """A field of a message, ``topic.field`` or ``topic_1.field`` of its second instance; None without one."""
    topic, _, name = field.partition(".")
    stem, _, number = topic.rpartition("_")
    known = [(topic, 0), *([(stem, int(number))] if number.isdecimal() else [])]
    data = next((each.data for each in log.data_list if (each.name, each.multi_id) in known), None)
    if data is None or name not in data or "timestamp" not in data:
        return None
    times = _times_us(data)
    rising = np.flatnonzero(np.diff(np.maximum.accumulate(times), prepend=times[:1] - 1) > 0)
    return _Stream(times[rising], data[name][rising].astype(np.float64))


def _times_us(data: Mapping[str, NDArray[np.uint64]]) -> NDArray[np.int64]:
    """When values were measured, or, where the message does not say it, when it was sent."""
    sent = data["timestamp"].astype(np.int64)
    if "timestamp_sample" not in data:
        return sent
    measured = data["timestamp_sample"].astype(np.int64)
    delay = sent - measured
    return measured if np.all((delay >= 0) & (delay < LONGEST_DELAY_US)) else sent


def _within(times_us: NDArray[np.int64], drives: Mapping[str, _Stream], wanted: Wanted) -> NDArray[np.int64]:
    """The times of attitude at which all declared columns are known, in the window that was declared."""
    first = max([times_us[0], *(each.times_us[0] for each in drives.values())])
    last = min([times_us[-1], *(each.times_us[-1] for each in drives.values())])
    if wanted.declared.between is not None:
        begin_s, end_s = wanted.declared.between
        first = max(first, times_us[0] + round(begin_s / MICROSECOND))
        last = min(last, times_us[0] + round(end_s / MICROSECOND))
    kept: NDArray[np.int64] = times_us[(times_us >= first) & (times_us <= last)]
    if not len(kept):
        raise FileFault(
            "no_rows", "attitude and declared columns have no time in common", "check the log and the window"
        )
    if len(kept) > wanted.max_rows:
        raise wanted.too_many_rows()
    return kept


def _at(times_us: NDArray[np.int64], stream: _Stream, *, gaps: bool = False) -> Array:
    """A stream at some times, interpolated linearly; with gaps NaN where it was not measured thereabouts."""
    origin = times_us[0]
    times, own = (times_us - origin).astype(np.float64), (stream.times_us - origin).astype(np.float64)
    values: Array = np.interp(times, own, stream.values)
    if gaps:
        steps = np.diff(own, append=own[-1])
        longest = max(SHORTEST_GAP_S / MICROSECOND, GAP_STEPS * float(np.median(steps)))
        before = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 1)
        missing = (steps[before] > longest) & (times > own[before])
        values[missing | (times < own[0]) | (times > own[-1])] = np.nan
    return values
