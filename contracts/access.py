"""orchestrator: who may do what, for people in a browser.

    GET    /v1/session                     Session: as whom the caller is known
    POST   /v1/session                     Session; SessionQuestion; sets the session's cookie
    DELETE /v1/session                     204; takes the cookie back
    POST   /v1/deliveries/{id}/link        CustomerLink

Programs send a token in every request. A browser can't (pictures and event streams carry no header), so it gets a
cookie for one: HttpOnly, SameSite=Strict, signed, and good for a change only in a request of the viewer's own pages.
"""

from typing import Literal

from pydantic import Field, SecretStr

from contracts.base import Wire

Role = Literal["operator", "read_only", "customer"]
"""An operator may do everything, `read_only` looks on, a customer sees and answers one delivery."""


class SessionQuestion(Wire):
    token: SecretStr = Field(min_length=1, max_length=1000)


class Session(Wire):
    """`asked`: whether this orchestrator asks for tokens at all; where it does not, everybody is an operator."""

    role: Role
    asked: bool


class CustomerLink(Wire):
    """`path`: of the page that shows this delivery and takes its customer's answers, nothing else. Whoever has the link
    is the customer."""

    path: str
