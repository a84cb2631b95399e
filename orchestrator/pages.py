"""The pages for people, as files of this package: HTML, plain ES modules, one style sheet. There is no build step."""

import hashlib
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

from fastapi.responses import HTMLResponse, Response

from service_kit.errors import NotFound

FOLDER = Path(__file__).parent / "viewer"
PAGE_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
    )
)
"""No script, style or picture from elsewhere, none inside the page, and no text that becomes markup."""
PAGE_HEADERS = {
    "content-security-policy": PAGE_POLICY,
    "referrer-policy": "same-origin",
    "cache-control": "no-store",
    "x-content-type-options": "nosniff",
}
KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
PageName = Literal["viewer", "customer", "login", "no-such-link"]


class Asset(NamedTuple):
    data: bytes
    kind: str
    tag: str


def page(name: PageName, status: int = 200) -> HTMLResponse:
    return HTMLResponse((FOLDER / f"{name}.html").read_text(encoding="utf-8"), status, headers=PAGE_HEADERS)


def asset(file: str, known: str | None) -> Response:
    """Without its content where the browser has this very one (`known`: its ETag). Raises NotFound."""
    found = assets().get(file)
    if found is None:
        raise NotFound("the pages have no such file")
    headers = {"etag": found.tag, "cache-control": "no-cache", "x-content-type-options": "nosniff"}
    if known == found.tag:
        return Response(status_code=304, headers=headers)
    return Response(found.data, media_type=found.kind, headers=headers)


@cache
def assets() -> dict[str, Asset]:
    """The files of the pages by name."""
    found = {}
    for path in sorted(FOLDER.iterdir()):
        if path.suffix in KINDS:
            data = path.read_bytes()
            found[path.name] = Asset(data, KINDS[path.suffix], f'"{hashlib.sha256(data).hexdigest()[:20]}"')
    return found
