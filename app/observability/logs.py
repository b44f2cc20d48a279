"""Log lines of the API and the workers: one line per event, as readable text or as JSON.

``MORPHID_LOG_FORMAT=text|json`` and ``MORPHID_LOG_LEVEL`` select the format. Facts beyond the message are
passed as ``extra={"facts": {...}}``; those shared by a whole piece of work come from
`app.observability.context`. Secrets in messages are masked.
"""

from __future__ import annotations

import json
import logging
import re
import sys
from datetime import UTC, datetime
from typing import IO, Any

from app.documents import finite
from app.observability.context import current_facts
from app.observability.tracing import current_trace_id

# loggers with their own handlers: they use ours instead
GATHERED = (
    *("uvicorn", "uvicorn.error", "uvicorn.access"),
    *("celery", "celery.task", "celery.redirected", "alembic"),
)
NOISY = {
    "uvicorn.access": logging.WARNING,  # ours has route, owner and duration, and no query strings
    "celery.worker.strategy": logging.WARNING,  # "received": a message is only a hint
    "celery.app.trace": logging.WARNING,  # "succeeded": the runner logs the outcome of the job
    "kombu": logging.WARNING,
    "httpx": logging.WARNING,
    "opentelemetry": logging.WARNING,
}
MAX_MESSAGE = 8_000  # characters; a client's field name of a megabyte must not make a line that long
SECRETS = (
    (re.compile(r"\b(mid_[0-9A-Za-z]+_)[0-9A-Za-z_-]+"), r"\1***"),  # API keys
    (re.compile(r"\b(whsec_)[0-9A-Za-z+/=_-]+"), r"\1***"),  # webhook secrets
    (re.compile(r"(?i)\b(bearer\s+)[^\s\"']+"), r"\1***"),
    (re.compile(r"(://[^:/@\s]*:)[^@/\s]+@"), r"\1***@"),  # passwords in addresses
)


def masked(text: str) -> str:
    """Return `text` without secrets."""
    for pattern, replacement in SECRETS:
        text = pattern.sub(replacement, text)
    return text


def printable(text: str) -> str:
    """Return `text` with control characters and line breaks escaped."""
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def _add_facts(record: logging.LogRecord) -> bool:
    """Complete a record with the facts of the moment: it may be formatted in another thread."""
    facts = {**current_facts(), **getattr(record, "facts", {})}
    if trace_id := current_trace_id():
        facts["trace_id"] = trace_id
    record.facts = facts
    return True


def _time(record: logging.LogRecord) -> str:
    moment = datetime.fromtimestamp(record.created, UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _message(record: logging.LogRecord) -> str:
    try:
        message = record.getMessage()
    except (TypeError, ValueError):
        message = f"{record.msg} {record.args}"  # a faulty line is better than none
    return masked(message)[:MAX_MESSAGE]


class JsonFormatter(logging.Formatter):
    """One JSON object per line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record."""
        line: dict[str, Any] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": _message(record),
            **getattr(record, "facts", {}),
        }
        if record.exc_info and record.exc_info[0] is not None:
            line["exception"] = masked(self.formatException(record.exc_info))
        if record.stack_info:
            line["stack"] = record.stack_info
        return json.dumps(finite(line), ensure_ascii=True, default=str)


class TextFormatter(logging.Formatter):
    """``time level logger: message [facts]``; only an exception takes more than one line."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record."""
        found = getattr(record, "facts", {})
        facts = " ".join(f"{name}={printable(str(value))}" for name, value in found.items())
        message = "\n  ".join(printable(line) for line in _message(record).splitlines())
        line = f"{_time(record)} {record.levelname.lower():8}{record.name}: {message}"
        if facts:
            line += f" [{facts}]"
        if record.exc_info and record.exc_info[0] is not None:
            line += "\n" + masked(self.formatException(record.exc_info))
        return line


def make_handler(kind: str, stream: IO[str] | None = None) -> logging.Handler:
    """Return a handler that writes lines of `kind` to `stream` (standard error)."""
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.addFilter(_add_facts)
    handler.setFormatter(JsonFormatter() if kind == "json" else TextFormatter())
    return handler


def configure_logging(kind: str, level: str) -> None:
    """Log as `kind` ("text" or "json") from `level` up in this process, for all libraries."""
    root = logging.getLogger()
    for handler in root.handlers[:]:
        root.removeHandler(handler)
    root.addHandler(make_handler(kind))
    root.setLevel(level.upper())
    for name in GATHERED:
        logger = logging.getLogger(name)
        logger.handlers.clear()
        logger.propagate = True
        logger.setLevel(logging.NOTSET)
    for name, minimum in NOISY.items():
        logging.getLogger(name).setLevel(max(minimum, root.level))
    logging.captureWarnings(capture=True)
