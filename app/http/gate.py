"""The gate before every route: checks the origin of a request and its key.

It runs before bodies are read and paths are resolved, and is closed by default: every path outside the short
public list needs a valid key. Each route declares the scopes it requires (`app.http.context.demands`).
"""

from __future__ import annotations

import logging
from functools import partial

from fastapi.concurrency import run_in_threadpool
from sqlalchemy.exc import SQLAlchemyError
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.audit import repository as audit
from app.audit.records import Action
from app.errors import DatabaseAway, ServiceError, TooManyRefusals, Unauthorized
from app.http.context import CALLER, Caller, Service
from app.http.middleware import HttpMiddleware
from app.http.origins import Boundary, refusal
from app.http.problems import answer_early
from app.keys.keyring import Refusal
from app.keys.records import EVERY_SCOPE, NO_QUOTA, ApiKey
from app.keys.refusal_limit import RefusalLimit
from app.keys.secret import KeyText
from app.keys.watch import KeyInUse
from app.observability.context import current_request_id
from app.settings import Settings

PUBLIC_PATHS = frozenset({"/", "/docs", "/openapi.json", "/livez", "/readyz"})
PUBLIC_FOLDER = "/static/"
LOCAL_OWNER = "local"  # the caller if no keys are required
ADDRESS_LENGTH = 64  # a proxy may pass on any value

logger = logging.getLogger(__name__)


class Gate(HttpMiddleware):
    """ASGI middleware that identifies the caller before anything else."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        super().__init__(app)
        self._boundary = Boundary.of(settings)
        self._demands_keys = settings.demands_keys
        self._limit = RefusalLimit()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or refuse it."""
        path: str = scope["path"]
        address = scope["client"][0][:ADDRESS_LENGTH] if scope.get("client") else ""
        try:
            if error := refusal(scope, self._boundary):
                raise error
            public = path in PUBLIC_PATHS or path.startswith(PUBLIC_FOLDER)
            key = await self._key(scope, address) if self._demands_keys and not public else None
        except ServiceError as error:
            await answer_early(error, scope, receive, send)
            return
        about = (current_request_id(), address)
        if key is not None:
            service: Service = scope["app"].state.service
            with service.key_watch.use(key) as in_use:
                scope[CALLER] = Caller(key.owner, key.id, key.scopes, *about, key.quota, in_use)
                await self.app(scope, receive, send)
            return
        if not public:
            scope[CALLER] = Caller(LOCAL_OWNER, None, EVERY_SCOPE, *about, NO_QUOTA, KeyInUse())
        await self.app(scope, receive, send)

    async def _key(self, scope: Scope, address: str) -> ApiKey:
        """Find the key of the request.

        Raises
        ------
        Unauthorized
            It has no key, or an invalid one.
        TooManyRefusals
            The address has sent too many invalid keys.
        """
        given = Headers(scope=scope).getlist("authorization")
        if not given:
            raise Unauthorized  # not a guess: the page tries once without, to learn whether keys are required
        scheme, _, credentials = given[0].partition(" ")
        well_formed = len(given) == 1 and scheme.lower() == "bearer"
        text = KeyText.parsed(credentials.strip()) if well_formed else None
        prefix = "" if text is None else text.prefix
        service: Service = scope["app"].state.service
        wait_s = self._limit.wait_s(address, prefix)
        if wait_s > 0:
            raise TooManyRefusals(wait_s)
        found = Refusal.MALFORMED if text is None else await _checked(service, text)
        if isinstance(found, ApiKey):
            self._limit.note_valid(address, prefix)
            return found
        if found in (Refusal.EXPIRED, Refusal.REVOKED):
            self._limit.forget(address, prefix)
        if self._limit.note_refused(address):
            _note_refused(service, address, prefix, found)
        raise Unauthorized


def _note_refused(service: Service, address: str, prefix: str, refused: Refusal) -> None:
    logger.warning("an API key was refused: %s, prefix %r, from %s", refused.value, prefix, address)
    service.background.put(
        partial(
            audit.insert_entry,
            action=Action.AUTH_REFUSED,
            owner=None,
            target=prefix or None,
            outcome=refused.value,
            request_id=current_request_id(),
            address=address,
        )
    )


async def _checked(service: Service, text: KeyText) -> ApiKey | Refusal:
    if service.keys.is_fresh(text):
        return service.keys.check(text)  # a digest: not worth a thread
    try:
        return await run_in_threadpool(service.keys.check, text)
    except SQLAlchemyError as error:
        logger.warning("API keys cannot be looked up: %s", error)
        raise DatabaseAway from None
