"""The web page and the API documentation, both from files of this installation."""

from __future__ import annotations

from functools import cache
from html import escape
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse, HTMLResponse
from starlette.applications import Starlette
from starlette.staticfiles import StaticFiles

from morphdata.operations import OPERATIONS

STATIC = Path(__file__).parent / "static"
PAGE = Path(__file__).parent / "page.html"
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Swagger UI sets styles on its elements; scripts come from here alone as on the page
DOCS_POLICY = PAGE_POLICY.replace("style-src 'self'", "style-src 'self' 'unsafe-inline'")

router = APIRouter(include_in_schema=False)


@router.get("/")
async def page() -> HTMLResponse:
    """Return the page."""
    return HTMLResponse(_page_text(), headers={"Content-Security-Policy": PAGE_POLICY})


@cache
def _page_text() -> str:
    """Build the page: the operations' names and what they do come from their descriptors."""
    names = " ".join(operation.name for operation in OPERATIONS)
    lines = (f"<dt>{escape(item.name)}</dt><dd>{escape(item.help)}</dd>" for item in OPERATIONS)
    text = PAGE.read_text(encoding="utf-8").replace("{operation_names}", escape(names))
    return text.replace("{operations_help}", "\n        ".join(lines))


@router.get("/docs")
async def docs() -> FileResponse:
    """Return the documentation page: Swagger UI from an installed package, nothing from other hosts."""
    return FileResponse(STATIC / "docs.html", headers={"Content-Security-Policy": DOCS_POLICY})


def mount_static(app: Starlette) -> None:
    """Serve the page's files and Swagger UI's."""
    app.mount("/static/swagger", StaticFiles(packages=[("fastapi_offline", "static")]), name="swagger")
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
