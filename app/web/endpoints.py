"""The web page and the API documentation, both from files of this installation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from html import escape
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse, HTMLResponse
from starlette.applications import Starlette
from starlette.staticfiles import StaticFiles

from morphdata.channels import CHANNELS
from morphdata.formats import FORMATS
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
    """Build the page: names and help of operations, channels and export formats come from their lists."""
    units = {item.name: "" if item.unit == "1" else f", {item.unit}" for item in CHANNELS}
    text = PAGE.read_text(encoding="utf-8")
    for place, found in {
        "{operation_names}": escape(" ".join(item.name for item in OPERATIONS)),
        "{format_names}": escape(" ".join(item.name for item in FORMATS)),
        "{operations_help}": _definitions((item.name, item.help) for item in OPERATIONS),
        "{channels_help}": _definitions(
            (item.name + units[item.name], item.description) for item in CHANNELS
        ),
        "{formats_help}": _definitions((item.name, item.title) for item in FORMATS),
    }.items():
        text = text.replace(place, found)
    return text


def _definitions(items: Iterable[tuple[str, str]]) -> str:
    """Lines of a list of terms and what they mean."""
    return "\n        ".join(f"<dt>{escape(name)}</dt><dd>{escape(what)}</dd>" for name, what in items)


@router.get("/docs")
async def docs() -> FileResponse:
    """Return the documentation page: Swagger UI from an installed package, nothing from other hosts."""
    return FileResponse(STATIC / "docs.html", headers={"Content-Security-Policy": DOCS_POLICY})


def mount_static(app: Starlette) -> None:
    """Serve the page's files and Swagger UI's."""
    app.mount("/static/swagger", StaticFiles(packages=[("fastapi_offline", "static")]), name="swagger")
    app.mount("/static", StaticFiles(directory=STATIC), name="static")
