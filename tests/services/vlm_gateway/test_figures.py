"""What the gateway counts, as Prometheus reads it."""

from prometheus_client import CollectorRegistry, Histogram

from services.vlm_gateway.keys import ANYBODY
from services.vlm_gateway.metrics import GatewayMetrics
from services.vlm_gateway.upstream.replies import Spent
from services.vlm_gateway.usage.accounts import Accounts, Price
from services.vlm_gateway.usage.ledger import Ledger
from services.vlm_gateway.usage.sqlite import SqliteUsage

DURATION = "gen_ai_client_operation_duration_seconds"
BOUNDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0)
SECONDS = (0.0, 0.001, 0.0010001, 0.3, 0.5, 119.9, 120.0, 121.0)
LABELS = {
    "gen_ai_operation_name": "chat",
    "gen_ai_provider_name": "vllm",
    "gen_ai_request_model": "m",
    "error_type": "",
}


def samples(registry: CollectorRegistry, name: str) -> dict[str, float]:
    """A histogram's own samples by name and bucket; when it was made is left out."""
    return {
        sample.name + sample.labels.get("le", ""): sample.value
        for family in registry.collect()
        for sample in family.samples
        if sample.name.startswith(name) and not sample.name.endswith("_created")
    }


def test_a_histogram_reads_as_the_client_library_would_have_written_it() -> None:
    ours, theirs = CollectorRegistry(), CollectorRegistry()
    figures = GatewayMetrics(ours)
    histogram = Histogram(DURATION, "The same.", list(LABELS), buckets=BOUNDS, registry=theirs).labels(**LABELS)
    for seconds in SECONDS:
        figures.model_called("vllm", "m", seconds)
        histogram.observe(seconds)
    assert samples(ours, DURATION) == samples(theirs, DURATION)
    assert ours.get_sample_value(DURATION + "_count", LABELS) == len(SECONDS)


async def test_tokens_and_what_they_cost_add_up() -> None:
    registry = CollectorRegistry()
    figures = GatewayMetrics(registry)
    ledger = Ledger(SqliteUsage(None, "one"), figures.usage_failed)
    accounts = Accounts(ledger, {"dear": Price(prompt=2.0, completion=10.0)}, figures)
    for model in ("dear", "free"):
        for _ in range(3):
            bill = await accounts.reserve(ANYBODY, model, Spent(1, 1))
            bill.settle(Spent(1000, 200))
            bill.settle(Spent(7, 7))  # a bill is settled once
    await ledger.close()
    tokens = {"model": "dear", "key": "", "kind": "completion"}
    assert registry.get_sample_value("vlm_gateway_tokens_total", tokens) == 600
    dollars = registry.get_sample_value("vlm_gateway_cost_usd_total", {"model": "dear", "key": ""})
    assert dollars is not None
    assert abs(dollars - 0.012) < 1e-12
    assert registry.get_sample_value("vlm_gateway_cost_usd_total", {"model": "free", "key": ""}) is None
