"""The reader's networks: an encoder, MPNet's or BERT's, and heads for floors, objects, attributes and relations.

Floors: each reading of the mentions (services.llm_parser.reader.floors) gets a score, and so does "none". Objects: each
span of tokens gets a score, and so does "none"; a tagger says which further tokens belong to the object. Relations: a
span as the anchor, its side, and how many windows.
"""

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from services.llm_parser.reader.decode import SIDES
from services.llm_parser.reader.floors import ONE_OPERATIONS, PAIR_OPERATIONS
from services.llm_parser.reader.model import MOST_TOKENS

HEADS = 12
LAYERS = 6
"""So many of an encoder's, from below."""
FIRST_POSITION = 2
"""Row of MPNet's position table for a request's first token; those before it are of padding."""
BUCKETS, FARTHEST = 32, 128
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
    """One transformer layer, normalised after each of its halves."""

    def __init__(self, hidden: int, inner: int, epsilon: float, dropout: float) -> None:
        super().__init__()
        self.qkv = nn.Linear(hidden, 3 * hidden)
        self.out = nn.Linear(hidden, hidden)
        self.norm1 = nn.LayerNorm(hidden, eps=epsilon)
        self.up = nn.Linear(hidden, inner)
        self.down = nn.Linear(inner, hidden)
        self.norm2 = nn.LayerNorm(hidden, eps=epsilon)
        self.drop = Dropout(dropout)

    def forward(self, x: Tensor, bias: Tensor) -> Tensor:
        """x: (B, T, H); bias: (B, HEADS or 1, T or 1, T), added to the attention's scores."""
        b, t, h = x.shape
        q, k, v = self.qkv(x).view(b, t, 3, HEADS, h // HEADS).permute(2, 0, 3, 1, 4)
        weights = torch.softmax(q @ k.transpose(-1, -2) / math.sqrt(h // HEADS) + bias, dim=-1)
        mixed = (self.drop(weights) @ v).transpose(1, 2).reshape(b, t, h)
        x = self.norm1(x + self.drop(self.out(mixed)))
        return self.norm2(x + self.drop(self.down(nn.functional.gelu(self.up(x)))))


def bucket(distance: Tensor) -> Tensor:
    """Row of the table of relative positions for a token so far to the right of another: exact up to 7, then ever
    coarser, apart for either side (Raffel et al. 2020, as MPNet numbers them)."""
    half = BUCKETS // 2
    exact = half // 2
    far = distance.abs()
    coarse = exact + torch.log(far.clamp(min=1) / exact) / math.log(FARTHEST / exact) * (half - exact)
    return (distance > 0) * half + torch.where(far < exact, far, coarse.long().clamp(max=half - 1))


class Size(NamedTuple):
    """Words, values a token, values inside a layer; has attention a `relative` bias, by the distance of two tokens?
    `epsilon` of the normalisations."""

    vocabulary: int
    hidden: int
    inner: int
    relative: bool
    epsilon: float


class Encoder(nn.Module):
    """The embeddings and lowest layers of MPNet (Song et al. 2020) or BERT; word embeddings are frozen."""

    def __init__(self, size: Size, dropout: float = 0.1) -> None:
        super().__init__()
        hidden = self.hidden = size.hidden
        self.word = nn.Embedding(size.vocabulary, hidden)
        self.word.weight.requires_grad = False
        self.position = nn.Embedding(MOST_TOKENS, hidden)
        self.relative = nn.Embedding(BUCKETS, HEADS) if size.relative else None
        self.norm = nn.LayerNorm(hidden, eps=size.epsilon)
        self.layers = nn.ModuleList(Layer(hidden, size.inner, size.epsilon, dropout) for _ in range(LAYERS))
        self.drop = Dropout(dropout)

    def forward(self, ids: Tensor, mask: Tensor) -> Tensor:
        """ids, mask: (B, T) -> (B, T, H)."""
        return self.encoded(self.word(ids), mask)

    def encoded(self, words: Tensor, mask: Tensor) -> Tensor:
        """words: (B, T, H), their embeddings; mask: (B, T), 0 on padding -> (B, T, H)."""
        places = torch.arange(words.shape[1], device=words.device)
        x = self.drop(self.norm(words + self.position(places)))
        bias = (1.0 - mask[:, None, None, :].to(x.dtype)) * -1e4
        if self.relative is not None:
            bias = bias + self.relative(bucket(places[None, :] - places[:, None])).permute(2, 0, 1)[None]
        for layer in self.layers:
            x = layer(x, bias)
        return x


class SpanHead(nn.Module):
    """Scores of all spans of at most SPAN_TOKENS tokens, and of "none"."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.start = nn.Linear(hidden, SPACE + 1)
        self.end = nn.Linear(hidden, SPACE + 1)
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
        hidden = encoder.hidden
        self.encoder = encoder
        self.object = SpanHead(hidden)
        self.anchor = SpanHead(hidden)
        self.tagger = nn.Linear(hidden, 1)
        self.pool = nn.Linear(hidden, 3)
        self.none = nn.Sequential(nn.Linear(4 * hidden, 128), nn.GELU(), nn.Linear(128, 3 + len(SIDES) + MOST_COUNT))
        self.one = nn.Sequential(nn.Linear(2 * hidden, 192), nn.GELU(), nn.Linear(192, len(ONE_OPERATIONS)))
        self.pair = nn.Sequential(nn.Linear(3 * hidden, 192), nn.GELU(), nn.Linear(192, len(PAIR_OPERATIONS)))

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
