"""Small writes that no request waits for, such as the note of a key's last use."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

from sqlalchemy.exc import SQLAlchemyError

from app.database import Database, Session

MAX_WAITING = 1000  # further ones are dropped: these writes are worth less than memory
STOP_S = 2.0

Write = Callable[[Session], object]

logger = logging.getLogger(__name__)


class BackgroundWriter:
    """One thread that writes in the order of requests; a write that fails is logged and forgotten."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._waiting: queue.Queue[Write | None] = queue.Queue(MAX_WAITING)
        self._thread = threading.Thread(target=self._run, name="background-writer", daemon=True)

    def start(self) -> None:
        """Start writing."""
        self._thread.start()

    def stop(self) -> None:
        """Write what is waiting, for `STOP_S` at most, and stop."""
        try:
            self._waiting.put(None, timeout=STOP_S)
        except queue.Full:
            return
        self._thread.join(STOP_S)

    def put(self, write: Write) -> None:
        """Schedule `write` to be called soon with its own session; never blocks."""
        try:
            self._waiting.put_nowait(write)
        except queue.Full:
            logger.warning("dropped a deferred write: %d are waiting for the database", MAX_WAITING)

    def _run(self) -> None:
        while (write := self._waiting.get()) is not None:
            try:
                with self._database.write() as session:
                    write(session)
            except SQLAlchemyError as error:
                logger.warning("a note was not written: %s", error)
