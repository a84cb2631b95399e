"""The one place that hands everything else of the orchestrator what it needs."""

from fastapi import FastAPI

from contracts.fleet import FleetMember
from mission.clients import Services
from orchestrator.access import Access, signing_key
from orchestrator.app import build_app
from orchestrator.assembly import Orchestrator
from orchestrator.bucket_files import Bucket, opened
from orchestrator.deliveries import Bounds
from orchestrator.fleet import Fleet, read_fleet
from orchestrator.record_files import FolderFiles, RecordFiles
from orchestrator.records import Records
from orchestrator.retention import Keep
from orchestrator.settings import OrchestratorSettings
from orchestrator.store.database import Database
from orchestrator.turns import Policy
from orchestrator.webhooks import Webhook
from service_kit.app import Check
from service_kit.settings import BadSetting, revealed


def bootstrap(settings: OrchestratorSettings) -> FastAPI:
    """The app as the settings want it. Raises BadSetting."""
    services = Services(settings.addresses, settings.tokens)
    members = read_fleet(settings.fleet) if settings.fleet is not None else _one_simulator(settings)
    fleet = Fleet(services, members, settings.tokens.sim)
    database = Database(revealed(settings.database_url) or f"sqlite:///{settings.runs_dir / 'deliveries.sqlite'}")
    orchestrator = Orchestrator(
        database,
        fleet,
        Records(_record_files(settings)),
        Policy(settings.answer_within_s, settings.service_within_s, settings.max_flights, settings.flight_limits),
        Bounds(waiting=settings.max_waiting_deliveries),
        lost_after_s=settings.lost_after_s,
        webhook=_webhook(settings),
        keep=Keep(settings.runs_keep_days or None, int(settings.runs_max_gb * 1e9) or None),
    )
    access = Access(
        revealed(settings.orchestrator_token),
        revealed(settings.orchestrator_read_token),
        lambda: signing_key(revealed(settings.orchestrator_key), settings.runs_dir),
        settings.session_hours * 3600,
    )
    checks: dict[str, Check] = {client.service: client.usable for client in services.all}
    checks |= {"database": orchestrator.usable, "records": orchestrator.keeps_records}
    return build_app(orchestrator, checks=checks, access=access, on_close=fleet.close)


def _record_files(settings: OrchestratorSettings) -> RecordFiles:
    if settings.records_url is None:
        return FolderFiles(settings.runs_dir)
    keys = revealed(settings.aws_access_key_id), revealed(settings.aws_secret_access_key)
    return opened(Bucket(settings.records_url, settings.aws_endpoint_url, settings.aws_region, *keys))


def _webhook(settings: OrchestratorSettings) -> Webhook | None:
    if settings.webhook_url is None:
        return None
    secret = revealed(settings.webhook_secret)
    if secret is None:
        raise BadSetting("WEBHOOK_SECRET is not set; set it or WEBHOOK_SECRET_FILE, so that the receiver can tell us")
    return Webhook(settings.webhook_url, secret.encode())


def _one_simulator(settings: OrchestratorSettings) -> tuple[FleetMember, ...]:
    room = settings.max_live_deliveries
    return (FleetMember(name="simulator", kind="simulator", address=settings.sim_url, room=room),)
