"""Settings in, the app out."""

from fastapi import FastAPI

from service_kit.settings import revealed
from services.depth_assist.app import build_app
from services.depth_assist.settings import DepthAssistSettings


def bootstrap(settings: DepthAssistSettings) -> FastAPI:
    """The app as the settings want it."""
    return build_app(token=revealed(settings.depth_assist_token), max_body_bytes=settings.depth_assist_max_body_bytes)
