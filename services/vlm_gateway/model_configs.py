"""The models of the gateway's configuration: what each kind of back end may set."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from contracts.base import ModelName, Unit, Wire
from services.vlm_gateway.backends.extension import BUILT_IN, ExtensionModelConfig
from services.vlm_gateway.errors import FallbackReason
from services.vlm_gateway.presets import BoxOrder, BoxStyle, Structured

FALLBACK_AFTER: tuple[FallbackReason, ...] = (
    "unreachable",
    "timeout",
    "overloaded",
    "rate_limited",
    "server_key",
    "not_found",
)

HeaderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{1,64}$")]
HeaderValue = Annotated[str, Field(pattern=r"^[\x20-\x7e]{0,1000}$")]


class _Limits(Wire):
    """What every model may set: `timeout_s` is for a whole question; at most `queue` questions wait for one of
    `concurrency` places."""

    timeout_s: float = Field(default=60.0, ge=0.05, le=3600.0)
    concurrency: int = Field(default=4, ge=1, le=1024)
    queue: int = Field(default=64, ge=0, le=100_000)


class EmbeddedModelConfig(_Limits):
    """The model that ships with the gateway: every place keeps one core busy."""

    backend: Literal["embedded"]
    concurrency: int = Field(default=1, ge=1, le=64)


class ScriptedModelConfig(_Limits):
    """`script` is a JSON file with a list of answers per question; see backends/scripted.py."""

    backend: Literal["scripted"]
    script: str = Field(min_length=1)
    repeat: bool = False


class OracleNoise(Wire):
    """How wrong the oracle is, on purpose; shares and probabilities in 0..1. What happens at a stop follows from
    `seed`, the scene's name and the number of the move, so that two policies meet the same faults in the same place.

    `miss_rate`: a view that shows the object says nothing. `false_claim_rate`: a look claims another thing as well.
    `floor_miscount_rate`: a count is one too high or too low. `box_jitter`: sigma by which each edge of a box is off,
    as a share of the box. `refusal_rate`: a question is declined."""

    miss_rate: Unit = 0.0
    false_claim_rate: Unit = 0.0
    floor_miscount_rate: Unit = 0.0
    box_jitter: Unit = 0.0
    refusal_rate: Unit = 0.0
    seed: int = Field(default=0, ge=0, le=2**31 - 1)


NO_NOISE = OracleNoise()


class OracleModelConfig(_Limits):
    """An object counts as seen when at least `min_share` of its outline and `min_pixels` pixels of a picture
    with a focal length of about 400 pixels show it, no farther away than `max_distance_m`."""

    backend: Literal["oracle"]
    timeout_s: float = Field(default=30.0, ge=0.05, le=3600.0)
    min_share: float = Field(default=0.4, ge=0.0, le=1.0)
    min_pixels: int = Field(default=80, ge=1, le=1_000_000)
    max_distance_m: float = Field(default=25.0, gt=0.0, le=1000.0)
    noise: OracleNoise = NO_NOISE


class ServerConfig(Wire):
    """One of several servers behind an alias. It gets calls by its `weight`; 0 drains it. A `canary` gets that share of
    them and no others."""

    url: str = Field(min_length=1, max_length=2000)
    weight: float = Field(default=1.0, ge=0.0, le=1000.0)
    canary: float = Field(default=0.0, ge=0.0, le=0.5)


class ChatModelConfig(_Limits):
    """One model of an OpenAI-compatible server. What is not given is taken from the preset (`max_images`,
    `min_pixels`, `max_pixels`, `temperature`, `max_tokens`, `boxes`, `box_order`, `image_factor`) or the server
    (`structured`). `context_tokens` is the context that Ollama is asked to give the model. `revision` tells answers of
    differently quantised or re-trained models apart in the cache. `extra` is sent with every request as it is.
    `pass` names fields of a chat that are passed to the server besides the preset's, `message_fields`, `part_fields`
    and `part_types` those of messages and parts (`["*"]` passes all); what else is in messages is dropped.

    Several servers are `base_urls`, addresses or tables with `url`, `weight` and `canary`: the least busy and quickest
    is asked, with `affinity` the one that has seen most of a request; each is looked at every `health_check_s` (0:
    never), and one that comes back gets its share over `slow_start_s`. The server's key goes into `key_header` (as a
    bearer token in `authorization`), `headers` and `query` are sent with every request: Azure wants `api-key` and
    `api-version`.

    For chats that are passed on: `retries` is how often a request is made again where its failure may pass, `fallbacks`
    the aliases that are asked in turn after what `fallback_after` lists, `counts_streams` whether its server is asked
    what a stream cost, and the prices (US dollars a million tokens) make what is spent. `resend_unanswered`: a request
    that the server may have read, and to which it gave no reply, may be sent again too."""

    backend: Literal["chat"]
    base_url: str = ""
    base_urls: tuple[str | ServerConfig, ...] = Field(default=(), max_length=64)
    affinity: bool = True
    health_check_s: float = Field(default=5.0, ge=0.0, le=3600.0)
    slow_start_s: float = Field(default=10.0, ge=0.0, le=3600.0)
    key_header: str = Field(default="authorization", pattern=r"^[A-Za-z0-9-]{1,64}$")
    headers: dict[HeaderName, HeaderValue] = {}
    query: dict[str, str] = {}
    model: str = Field(min_length=1, max_length=200)
    preset: str
    server: str = "openai-compatible"
    api_key_env: str | None = None
    api_key_file: str | None = None
    connect_timeout_s: float = Field(default=3.0, ge=0.05, le=60.0)
    revision: str = ""
    structured: Structured | None = None
    temperature: float | None = Field(default=None, ge=0.0, le=2.0)
    max_tokens: int | None = Field(default=None, ge=16, le=32_768)
    max_images: int | None = Field(default=None, ge=1, le=16)
    min_pixels: int | None = Field(default=None, ge=1)
    max_pixels: int | None = Field(default=None, ge=1)
    boxes: BoxStyle | None = None
    box_order: BoxOrder | None = None
    image_factor: int | None = Field(default=None, ge=1, le=512)
    context_tokens: int | None = Field(default=None, ge=512, le=1_048_576)
    extra: dict[str, Any] = {}
    passes: tuple[str, ...] = Field(default=(), alias="pass", max_length=100)
    message_fields: tuple[str, ...] = Field(default=(), max_length=100)
    part_fields: tuple[str, ...] = Field(default=(), max_length=100)
    part_types: tuple[str, ...] = Field(default=(), max_length=20)
    retries: int = Field(default=1, ge=0, le=5)
    resend_unanswered: bool = False
    fallbacks: tuple[ModelName, ...] = Field(default=(), max_length=8)
    fallback_after: tuple[FallbackReason, ...] = FALLBACK_AFTER
    counts_streams: bool | None = None
    usd_per_million_prompt: float = Field(default=0.0, ge=0.0, le=100_000.0)
    usd_per_million_completion: float = Field(default=0.0, ge=0.0, le=100_000.0)


def _variant(model: Any) -> str | None:
    backend = model.get("backend") if isinstance(model, Mapping) else getattr(model, "backend", None)
    return backend if backend in BUILT_IN else "extension" if isinstance(backend, str) else None


ModelConfig = Annotated[
    Annotated[EmbeddedModelConfig, Tag("embedded")]
    | Annotated[ScriptedModelConfig, Tag("scripted")]
    | Annotated[OracleModelConfig, Tag("oracle")]
    | Annotated[ChatModelConfig, Tag("chat")]
    | Annotated[ExtensionModelConfig, Tag("extension")],
    Discriminator(_variant),
]
