"""Settings of depth_assist: `DEPTH_ASSIST_TOKEN` and `MAX_BODY_BYTES`, both optional."""

from fastapi import FastAPI

from service_kit.settings import Settings
from services.depth_assist.app import MAX_BODY_BYTES, build_app

DEFAULT_PORT = 8103


def bootstrap(settings: Settings) -> FastAPI:
    """The app as the settings want it. Raises BadSetting."""
    return build_app(
        token=settings.text("DEPTH_ASSIST_TOKEN"),
        max_body_bytes=settings.integer("MAX_BODY_BYTES", MAX_BODY_BYTES, 1024, 1 << 30),
    )
