"""The one place that reads the orchestrator's settings and hands everything else what it needs."""

from pathlib import Path

from fastapi import FastAPI

from mission.clients import Services
from orchestrator.app import build_app
from orchestrator.desk import Desk
from service_kit.addresses import Addresses
from service_kit.settings import BadSetting, Settings

PORT = 8100


def addresses(settings: Settings) -> Addresses:
    """`LLM_PARSER_URL`, `VLM_GATEWAY_URL`, `DEPTH_ASSIST_URL`, `SIM_URL`. Raises BadSetting."""
    usual = Addresses()
    found = Addresses(
        llm_parser=settings.text("LLM_PARSER_URL", usual.llm_parser) or "",
        vlm_gateway=settings.text("VLM_GATEWAY_URL", usual.vlm_gateway) or "",
        depth_assist=settings.text("DEPTH_ASSIST_URL", usual.depth_assist) or "",
        sim=settings.text("SIM_URL", usual.sim) or "",
    )
    for name, url in vars(found).items():
        if not url.startswith(("http://", "https://")):
            raise BadSetting(f"{name.upper()}_URL={url}: give an http:// or https:// address")
    return found


def bootstrap(settings: Settings) -> FastAPI:
    """The app. Reads `RUNS_DIR`, `MAX_LIVE_DELIVERIES`, `ORCHESTRATOR_TOKEN`, `GATEWAY_TOKEN`. Raises BadSetting."""
    services = Services(addresses(settings), gateway_token=settings.text("GATEWAY_TOKEN"))
    desk = Desk(
        services.ports(),
        Path(settings.text("RUNS_DIR", "runs") or "runs"),
        max_live=settings.integer("MAX_LIVE_DELIVERIES", 2, 1, 64),
    )
    checks = {client.service: client.ready for client in services.all}
    return build_app(desk, checks=checks, token=settings.text("ORCHESTRATOR_TOKEN"), on_close=services.close)
