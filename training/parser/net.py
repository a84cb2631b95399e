"""The reader's network: a small BERT encoder, and heads for floors, objects, attributes and relations.

Floors: each reading of the mentions (services.llm_parser.reader.floors) gets a score, and so does "none". Objects: each
span of tokens gets a score, and so does "none"; a tagger says which further tokens belong to the object. Relations: a
span as the anchor, its side, and how many windows.
"""

import math

import numpy as np
import torch
from torch import Tensor, nn

from services.llm_parser.reader.decode import SIDES
from services.llm_parser.reader.floors import ONE_OPERATIONS, PAIR_OPERATIONS

HIDDEN = 384
HEADS = 12
SPAN_TOKENS = 24
SPACE = 96
MOST_COUNT = 5


class Dropout(nn.Module):
    """As torch's, with a mask of chance bytes, which are three times as fast to be had."""

    def __init__(self, share: float) -> None:
        super().__init__()
        self.least = round(256 * share)
        self.chance = np.random.SFC64(torch.initial_seed())

    def forward(self, x: Tensor) -> Tensor:
        if not self.training or not self.least:
            return x
        drawn = self.chance.random_raw((x.numel() + 7) // 8).view(np.uint8)[: x.numel()]
        return (x * (torch.from_numpy(drawn).view(x.shape) >= self.least)) * (256 / (256 - self.least))


class Layer(nn.Module):
    """One BERT layer."""

    def __init__(self, hidden: int, inner: int, dropout: float) -> None:
        super().__init__()
        self.qkv = nn.Linear(hidden, 3 * hidden)
        self.out = nn.Linear(hidden, hidden)
        self.norm1 = nn.LayerNorm(hidden, eps=1e-12)
        self.up = nn.Linear(hidden, inner)
        self.down = nn.Linear(inner, hidden)
        self.norm2 = nn.LayerNorm(hidden, eps=1e-12)
        self.drop = Dropout(dropout)

    def forward(self, x: Tensor, bias: Tensor) -> Tensor:
        """x: (B, T, H); bias: (B, 1, 1, T), large and negative on padding."""
        b, t, h = x.shape
        q, k, v = self.qkv(x).view(b, t, 3, HEADS, h // HEADS).permute(2, 0, 3, 1, 4)
        weights = torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(h // HEADS) + bias, dim=-1)
        mixed = (self.drop(weights) @ v).transpose(1, 2).reshape(b, t, h)
        x = self.norm1(x + self.drop(self.out(mixed)))
        return self.norm2(x + self.drop(self.down(nn.functional.gelu(self.up(x)))))


class Encoder(nn.Module):
    """BERT without its pooler; word embeddings are frozen."""

    def __init__(self, layers: int = 6, vocabulary: int = 30522, hidden: int = HIDDEN, dropout: float = 0.1) -> None:
        super().__init__()
        self.word = nn.Embedding(vocabulary, hidden)
        self.word.weight.requires_grad = False
        self.position = nn.Embedding(512, hidden)
        self.kind = nn.Parameter(torch.zeros(hidden))
        self.norm = nn.LayerNorm(hidden, eps=1e-12)
        self.layers = nn.ModuleList(Layer(hidden, 4 * hidden, dropout) for _ in range(layers))
        self.drop = Dropout(dropout)

    def forward(self, ids: Tensor, mask: Tensor) -> Tensor:
        """ids, mask: (B, T) -> (B, T, H)."""
        x = self.word(ids) + self.position(torch.arange(ids.shape[1], device=ids.device)) + self.kind
        x = self.drop(self.norm(x))
        bias = (1.0 - mask[:, None, None, :].to(x.dtype)) * -1e4
        for layer in self.layers:
            x = layer(x, bias)
        return x

    def load_bert(self, weights: dict[str, Tensor]) -> None:
        """From a BERT checkpoint's tensors."""

        def put(module: nn.Linear | nn.LayerNorm, name: str) -> None:
            module.weight.data.copy_(weights[name + ".weight"])
            module.bias.data.copy_(weights[name + ".bias"])

        self.word.weight.data.copy_(weights["embeddings.word_embeddings.weight"])
        self.position.weight.data.copy_(weights["embeddings.position_embeddings.weight"])
        self.kind.data.copy_(weights["embeddings.token_type_embeddings.weight"][0])
        put(self.norm, "embeddings.LayerNorm")
        for number, layer in enumerate(self.layers):
            assert isinstance(layer, Layer)
            base = f"encoder.layer.{number}."
            parts = [f"{base}attention.self.{p}" for p in ("query", "key", "value")]
            layer.qkv.weight.data.copy_(torch.cat([weights[p + ".weight"] for p in parts]))
            layer.qkv.bias.data.copy_(torch.cat([weights[p + ".bias"] for p in parts]))
            put(layer.out, base + "attention.output.dense")
            put(layer.norm1, base + "attention.output.LayerNorm")
            put(layer.up, base + "intermediate.dense")
            put(layer.down, base + "output.dense")
            put(layer.norm2, base + "output.LayerNorm")


class SpanHead(nn.Module):
    """Scores of all spans of at most SPAN_TOKENS tokens, and of "none"."""

    def __init__(self) -> None:
        super().__init__()
        self.start = nn.Linear(HIDDEN, SPACE + 1)
        self.end = nn.Linear(HIDDEN, SPACE + 1)
        self.length = nn.Parameter(torch.zeros(SPAN_TOKENS))

    def forward(self, x: Tensor) -> Tensor:
        """x: (B, T, H) -> (B, T, SPAN_TOKENS): the span from token i over j further tokens; -inf past the end."""
        b, t, _ = x.shape
        start, end = self.start(x), self.end(x)
        scores = start[..., :SPACE] @ end[..., :SPACE].transpose(1, 2) / math.sqrt(SPACE)
        scores = scores + start[..., SPACE:] + end[..., SPACE:].transpose(1, 2)
        rows = torch.arange(t, device=x.device)[:, None] + torch.arange(SPAN_TOKENS, device=x.device)[None, :]
        inside = rows < t
        picked = scores.gather(2, rows.clamp(max=t - 1).expand(b, t, SPAN_TOKENS)) + self.length
        return picked.masked_fill(~inside, -1e4)


class Reader(nn.Module):
    """The encoder and all heads."""

    def __init__(self, encoder: Encoder) -> None:
        super().__init__()
        self.encoder = encoder
        self.object = SpanHead()
        self.anchor = SpanHead()
        self.tagger = nn.Linear(HIDDEN, 1)
        self.pool = nn.Linear(HIDDEN, 3)
        self.none = nn.Sequential(nn.Linear(4 * HIDDEN, 128), nn.GELU(), nn.Linear(128, 3 + len(SIDES) + MOST_COUNT))
        self.one = nn.Sequential(nn.Linear(2 * HIDDEN, 192), nn.GELU(), nn.Linear(192, len(ONE_OPERATIONS)))
        self.pair = nn.Sequential(nn.Linear(3 * HIDDEN, 192), nn.GELU(), nn.Linear(192, len(PAIR_OPERATIONS)))

    def whole(self, x: Tensor, mask: Tensor) -> Tensor:
        """(B, 3 + sides + counts): "no floor", "no object", "no relation", then the relation's side and count."""
        weights = torch.softmax(self.pool(x).masked_fill(mask[..., None] == 0, -1e4), dim=1)
        pooled = torch.einsum("bth,btp->bph", x, weights).flatten(1)
        return self.none(torch.cat([x[:, 0], pooled], dim=1))

    def mentions(self, x: Tensor, averaging: Tensor) -> Tensor:
        """averaging: (B, M, T) rows that average a mention's tokens -> (B, M, H)."""
        return averaging @ x

    def one_scores(self, mentions: Tensor, first: Tensor) -> Tensor:
        """(B, M, operations); first: (B, H), the encoder's first token."""
        spread = first[:, None].expand(-1, mentions.shape[1], -1)
        return self.one(torch.cat([mentions, spread], dim=-1))

    def pair_scores(self, mentions: Tensor, first: Tensor) -> Tensor:
        """(B, M, M, operations)."""
        b, m, h = mentions.shape
        a = mentions[:, :, None].expand(b, m, m, h)
        c = mentions[:, None].expand(b, m, m, h)
        return self.pair(torch.cat([a, c, first[:, None, None].expand(b, m, m, h)], dim=-1))
