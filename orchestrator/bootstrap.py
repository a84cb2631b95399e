"""The one place that hands everything else of the orchestrator what it needs."""

from fastapi import FastAPI

from mission.clients import Services
from orchestrator.app import build_app
from orchestrator.deliveries import Deliveries
from orchestrator.settings import OrchestratorSettings
from service_kit.settings import revealed


def bootstrap(settings: OrchestratorSettings) -> FastAPI:
    """The app as the settings want it."""
    services = Services(settings.addresses, settings.tokens, settings.service_patience_s)
    deliveries = Deliveries(
        services.simulated,
        settings.runs_dir,
        max_live=settings.max_live_deliveries,
        max_waiting=settings.max_waiting_deliveries,
        patience_s=settings.answer_within_s,
    )
    checks = {client.service: client.usable for client in services.all}
    return build_app(deliveries, checks=checks, token=revealed(settings.orchestrator_token), on_close=services.close)
