"""Messages that no sender of ours writes, as they lie in the broker's list."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

from app.jobs.queue import QUEUE, RUN_JOB
from worker.hints import Hint


def envelope(**changes: Any) -> dict[str, Any]:
    """A good message, then changed: `body`, `headers` and `properties` are merged, None takes a part out."""
    message: dict[str, Any] = json.loads(Hint(RUN_JOB, ["job"]).packed())
    for name, value in changes.items():
        key = name.replace("_", "-") if name.startswith("content") else name
        if value is None:
            message.pop(key)
        elif isinstance(value, dict) and isinstance(message.get(key), dict):
            message[key] = {each: item for each, item in (message[key] | value).items() if item is not ...}
        else:
            message[key] = value
    return message


def packed(body: Any) -> str:
    """A body as it stands in an envelope."""
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    return base64.b64encode(text).decode()


ENVELOPES: dict[str, dict[str, Any]] = {
    "body @@@": envelope(body="@@@"),
    "body that is @@@ within": envelope(body=packed(b"@@@")),
    "body null": envelope(body=packed(None)),
    "body a number": envelope(body=packed(5)),
    "body a text": envelope(body=packed("text")),
    "body of broken bytes": envelope(body=packed(b"\xff\xfe\x00")),
    "body of nothing": envelope(body=""),
    "body no text at all": envelope(body=7),
    "body too deep": envelope(body=packed(b"[" * 8000)),
    "no body": envelope(body=None),
    "no arguments": envelope(body=packed([[], {}, {}])),
    "two arguments": envelope(body=packed([["a", "b"], {}, {}])),
    "an argument of another type": envelope(body=packed([[{"a": 1}], {}, {}])),
    "an argument without end": envelope(body=packed([["a" * 5000], {}, {}])),
    "arguments that are no list": envelope(body=packed([{}, {}, {}])),
    "body without its third part": envelope(body=packed([["a"], {}])),
    "content type pickle": envelope(content_type="application/x-python-serialize"),
    "content type of yaml": envelope(content_type="application/x-yaml"),
    "content type null": envelope(content_type={}),
    "no content type": envelope(content_type=None),
    "no headers": envelope(headers=None),
    "headers that are a list": envelope(headers=[1]),
    "no task": envelope(headers={"task": ...}),
    "task null": envelope(headers={"task": None}),
    "task a list": envelope(headers={"task": []}),
    "unknown task": envelope(headers={"task": "celery.chord"}),
    "expires nonsense": envelope(headers={"expires": "soon"}),
    "expires without a zone": envelope(headers={"expires": "9999-12-31T23:59:59"}),
    "no properties": envelope(properties=None),
    "properties a number": envelope(properties=3),
    "no encoding of the body": envelope(properties={"body_encoding": ...}),
    "unknown encoding of the body": envelope(properties={"body_encoding": "rot13"}),
    "reaping with nonsense": envelope(headers={"task": "morphid.reap"}, body=packed([[], {"x": 1}, {}])),
    "reaping in a year of minutes": envelope(
        headers={"task": "morphid.reap"}, body=packed([[], {"republish_after_s": -1}, {}])
    ),
}

MALFORMED: dict[str, bytes] = {
    **{name: json.dumps(each).encode() for name, each in ENVELOPES.items()},
    "plain text": b"hello",
    "@@@": b"@@@",
    "null": b"null",
    "true": b"true",
    "a number": b"17",
    "a list": b"[]",
    "an empty object": b"{}",
    "half a message": json.dumps(envelope()).encode()[:200],
    "broken bytes": b"\xff\xfe\xfd\x00\x80",
    "compressed": zlib.compress(b"x" * 100),
    "brackets": b"[" * 10_000,
    "huge": json.dumps(envelope(headers={"lang": "x" * 1_000_000})).encode(),
    "a type for kombu": b'{"__type__": "datetime", "__value__": "x"}',
}

# well-formed for Celery, and harmful to it; for us they are wake-ups like any other
HARMFUL: dict[str, bytes] = {
    name: json.dumps(each).encode()
    for name, each in {
        "a time limit": envelope(headers={"timelimit": [0.001, 0.001]}),
        "a nonsense time limit": envelope(headers={"timelimit": "abc"}),
        "not before the end of time": envelope(headers={"eta": "9999-12-31T23:59:59+00:00"}),
        "no id": envelope(headers={"id": ...}),
        "an id that is no text": envelope(headers={"id": {"a": 1}}),
        "compression": envelope(headers={"compression": "application/x-gzip"}),
        "no delivery tag": envelope(properties={"delivery_tag": ..., "delivery_info": ...}),
        "errors to be called back": envelope(
            body=packed([["job"], {}, {"errbacks": [{"task": "x"}], "chord": 5}])
        ),
    }.items()
}

LIST = QUEUE  # kombu's name for the list of messages of no priority
