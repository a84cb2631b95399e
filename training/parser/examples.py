"""Rows to tensors: tokens, mentions and readings, and which readings, spans and tags are right."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from tokenizers import Tokenizer
from torch import Tensor

from services.llm_parser.reader.decode import SIDES, content
from services.llm_parser.reader.floors import readings
from services.llm_parser.reader.mentions import find_mentions
from training.parser.net import MOST_COUNT, SPAN_TOKENS
from training.parser.rows import Forms, Row, Span

MOST_TOKENS = 192


@dataclass(frozen=True)
class Example:
    """One row, encoded. `spans`: right object spans as (token, further tokens); `gold`: the labelled ones among them.
    `ones`, `pairs`: right readings."""

    ids: list[int]
    averaging: np.ndarray
    reading_index: np.ndarray
    reading_right: np.ndarray
    no_floor: bool
    spans: list[tuple[int, int]]
    gold: list[tuple[int, int]]
    tags: np.ndarray
    tagged: bool
    anchors: list[tuple[int, int]]
    side: int
    count: int


def encode(row: Row, tokenizer: Tokenizer) -> Example:
    encoding = tokenizer.encode(row.text)
    ids = encoding.ids[:MOST_TOKENS]
    offsets = encoding.offsets[:MOST_TOKENS]
    if len(encoding.ids) > MOST_TOKENS:
        ids[-1] = encoding.ids[-1]
        offsets[-1] = (0, 0)
    tokens = len(ids)
    mentions = list(find_mentions(row.text))
    averaging = np.zeros((len(mentions), tokens), np.float32)
    for at, mention in enumerate(mentions):
        covered = [i for i, (s, e) in enumerate(offsets) if s < mention.end and mention.start < e]
        if covered:
            averaging[at, covered] = 1.0 / len(covered)
    found = [
        r for r in readings(mentions) if averaging[r.first].any() and (r.second is None or averaging[r.second].any())
    ]
    index = np.array([(r.operation, r.first, -1 if r.second is None else r.second) for r in found], np.int64).reshape(
        -1, 3
    )
    right = np.zeros(len(found), bool)
    if row.floor is not None:
        value = np.array([r.floor == row.floor for r in found], bool)

        def inside(at: int | None) -> bool:
            return at is None or any(s.start < mentions[at].end and mentions[at].start < s.end for s in row.floor_spans)

        told = np.array([inside(r.first) and inside(r.second) for r in found], bool)
        right = value & told if (value & told).any() else value
    spans, gold = _object_spans(row, offsets, tokens)
    tags = np.array(
        [any(s.start < e and a < s.end for s in row.object_spans) and e > a for a, e in offsets], np.float32
    )
    anchors, side, count = [], -1, -1
    if row.relation is not None:
        anchors = [t for t in (_tokens_of(s, offsets) for s in row.relation.anchor) if t is not None]
        side, count = SIDES.index(row.relation.side), min(row.relation.count, MOST_COUNT) - 1
    return Example(
        ids,
        averaging,
        index,
        right,
        row.floor is None,
        spans,
        gold,
        tags,
        row.object is None or bool(row.object_spans),
        anchors,
        side,
        count,
    )


def _tokens_of(span: Span, offsets: Sequence[tuple[int, int]]) -> tuple[int, int] | None:
    covered = [i for i, (s, e) in enumerate(offsets) if e > s and s < span.end and span.start < e]
    if not covered or covered[-1] - covered[0] >= SPAN_TOKENS:
        return None
    return covered[0], covered[-1] - covered[0]


def _object_spans(
    row: Row, offsets: Sequence[tuple[int, int]], tokens: int
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    if row.object is None:
        return [], []
    forms = Forms(row)
    gold: list[tuple[int, int]] = []
    best: tuple[float, tuple[int, int]] | None = None
    for span in row.object_spans:
        at = _tokens_of(span, offsets)
        if at is None:
            continue
        words = content(row.text[span.start : span.end])
        head = max((len(words & f) / max(1, len(f)) for f in forms.forms), default=0.0)
        if best is None or head > best[0] + 1e-9:
            best = (head, at)
    if best is not None:
        gold.append(best[1])
    right = list(gold)
    # spans around the labelled ones that are right as well
    for span in row.object_spans:
        for first in range(tokens):
            start, end0 = offsets[first]
            if end0 <= start or end0 <= span.start - 30 or start >= span.end:
                continue
            if start > 0 and row.text[start - 1].isalnum() and row.text[start].isalnum():
                continue
            for more in range(min(SPAN_TOKENS, tokens - first)):
                end = offsets[first + more][1]
                if end <= offsets[first + more][0]:
                    break
                if end > span.end + 40:
                    break
                if end < len(row.text) and row.text[end].isalnum() and row.text[end - 1].isalnum():
                    continue
                if end <= span.start:
                    continue
                if (first, more) not in right and forms.right(content(row.text[start:end])):
                    right.append((first, more))
    return right, gold


@dataclass(frozen=True)
class Batch:
    """Examples padded to the longest; `reading_index` is (N, 4): example, operation, first, second (-1: none)."""

    ids: Tensor
    mask: Tensor
    averaging: Tensor
    examples: Sequence[Example]
    span_right: Tensor
    span_gold: Tensor
    anchor_right: Tensor
    tags: Tensor
    tag_mask: Tensor


def batch_of(examples: Sequence[Example]) -> Batch:
    longest = max(len(e.ids) for e in examples)
    most = max(1, max(len(e.averaging) for e in examples))
    b = len(examples)
    ids, mask = torch.zeros(b, longest, dtype=torch.long), torch.zeros(b, longest)
    averaging = torch.zeros(b, most, longest)
    right, gold, anchor = (torch.zeros(b, longest, SPAN_TOKENS, dtype=torch.bool) for _ in range(3))
    tags, tag_mask = torch.zeros(b, longest), torch.zeros(b, longest)
    for i, e in enumerate(examples):
        n = len(e.ids)
        ids[i, :n] = torch.tensor(e.ids)
        mask[i, :n] = 1
        averaging[i, : len(e.averaging), :n] = torch.from_numpy(e.averaging)
        for where, spans in ((right, e.spans), (gold, e.gold), (anchor, e.anchors)):
            for first, more in spans:
                where[i, first, more] = True
        tags[i, :n] = torch.from_numpy(e.tags)
        if e.tagged:
            tag_mask[i, :n] = 1
    return Batch(ids, mask, averaging, examples, right, gold, anchor, tags, tag_mask)


def _floor_loss(none: Tensor, ones: Tensor, pairs: Tensor, batch: Batch) -> Tensor:
    """none: (B,), ones: (B, M, operations), pairs: (B, M, M, operations) -> the mean over those whose floor can be
    read; every example's readings, padded, beside its "none"."""
    most = max(1, max(len(e.reading_index) for e in batch.examples))
    index = torch.zeros(len(batch.examples), most, 3, dtype=torch.long)
    there, right = (torch.zeros(len(batch.examples), most, dtype=torch.bool) for _ in range(2))
    for i, e in enumerate(batch.examples):
        n = len(e.reading_index)
        index[i, :n] = torch.from_numpy(e.reading_index)
        there[i, :n], right[i, :n] = True, torch.from_numpy(e.reading_right)
    operation, first, second = index.unbind(-1)
    row = torch.arange(len(index))[:, None]
    single = ones[row, first, operation.clamp(max=ones.shape[-1] - 1)]
    double = pairs[row, first, second.clamp(min=0), operation.clamp(max=pairs.shape[-1] - 1)]
    scores = torch.where(second < 0, single, double).masked_fill(~there, -1e9)
    scores = torch.cat([none[:, None], scores], 1)
    right = torch.cat([torch.tensor([[e.no_floor] for e in batch.examples]), right], 1)
    loss = torch.logsumexp(scores, 1) - torch.logsumexp(scores.masked_fill(~right, -1e9), 1)
    return loss[right.any(1)].mean() if right.any() else torch.zeros(())


def losses(net: Any, batch: Batch) -> dict[str, Tensor]:
    """Mean losses by head."""
    x = net.encoder(batch.ids, batch.mask).float()
    whole = net.whole(x, batch.mask)
    mentions = net.mentions(x, batch.averaging)
    ones, pairs = net.one_scores(mentions, x[:, 0]), net.pair_scores(mentions, x[:, 0])
    floor = _floor_loss(whole[:, 0], ones, pairs, batch)
    padding = (batch.mask == 0)[..., None]
    spans = net.object(x).masked_fill(padding, -1e4)
    flat = torch.cat([whole[:, 1:2], spans.flatten(1)], 1)
    right = torch.cat([torch.tensor([[not e.spans] for e in batch.examples]), batch.span_right.flatten(1)], 1)
    gold = torch.cat([torch.tensor([[not e.gold] for e in batch.examples]), batch.span_gold.flatten(1)], 1)
    usable = torch.tensor([bool(e.spans) or e.tagged for e in batch.examples])
    total = torch.logsumexp(flat, 1)
    object_loss = total - torch.logsumexp(flat.masked_fill(~right, -1e9), 1)
    gold_loss = total - torch.logsumexp(flat.masked_fill(~gold, -1e9), 1)
    thing = (object_loss + 0.4 * gold_loss)[usable].mean()
    tagging = torch.nn.functional.binary_cross_entropy_with_logits(
        net.tagger(x)[..., 0], batch.tags, weight=batch.tag_mask, reduction="sum"
    ) / batch.tag_mask.sum().clamp(min=1)
    anchors = net.anchor(x).masked_fill(padding, -1e4)
    flat = torch.cat([whole[:, 2:3], anchors.flatten(1)], 1)
    told = torch.cat([torch.tensor([[not e.anchors] for e in batch.examples]), batch.anchor_right.flatten(1)], 1)
    relation = (torch.logsumexp(flat, 1) - torch.logsumexp(flat.masked_fill(~told, -1e9), 1)).mean()
    has = torch.tensor([e.side >= 0 for e in batch.examples])
    side = torch.zeros(())
    if has.any():
        sides = torch.tensor([e.side for e in batch.examples])[has]
        counts = torch.tensor([e.count for e in batch.examples])[has]
        logits = whole[has][:, 3:]
        side = torch.nn.functional.cross_entropy(logits[:, : len(SIDES)], sides) + torch.nn.functional.cross_entropy(
            logits[:, len(SIDES) :], counts
        )
        side = side * has.float().mean()
    return {
        "floor": floor,
        "object": thing,
        "tags": tagging,
        "relation": relation,
        "side": side,
    }
