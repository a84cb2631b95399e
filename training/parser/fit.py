"""Fits the reader and measures it on rows that it was not fitted on."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from training.parser.augment import Augmenter
from training.parser.bases import MINILM, MPNET, Base, encoder_of, tokenizer_of
from training.parser.examples import Example, batch_of, encode, losses
from training.parser.net import Encoder, Reader
from training.parser.rows import Row
from training.parser.shipped import WORDS

BATCH_TOKENS = 1400


class Plan(NamedTuple):
    """`epochs` over all rows; `seed` of everything that chance decides; so many of the lowest layers are `frozen`, and
    with them the embeddings and the table of relative positions. `average`: of the weights over steps."""

    epochs: float
    encoder_rate: float
    head_rate: float
    average: float
    frozen: int
    seed: int = 0


PLANS = {
    MPNET: Plan(epochs=8, encoder_rate=7e-5, head_rate=6e-4, average=0.995, frozen=1),
    MINILM: Plan(epochs=12, encoder_rate=1.2e-4, head_rate=8e-4, average=0.998, frozen=0),
}


class Epoch(NamedTuple):
    """Steps taken of how many, seconds since the start, and the epoch's mean losses by head."""

    step: int
    steps: int
    seconds: float
    losses: dict[str, float]

    def __str__(self) -> str:
        said = ", ".join(f"{name} {loss:.3f}" for name, loss in self.losses.items())
        return f"{self.step}/{self.steps} steps, {self.seconds:.0f} s: {said}"


def freeze(encoder: Encoder, layers: int) -> None:
    """Keeps the lowest layers as they are, and what lies under them."""
    if layers:
        for part in (encoder.position, encoder.relative, encoder.norm, *encoder.layers[:layers]):
            if part is not None:
                part.requires_grad_(False)


def take_up(net: Reader, weights: Mapping[str, Tensor]) -> None:
    """Begins with the weights of an earlier training; WORDS may be left out. Raises ValueError where they are of
    another network."""
    try:
        net.load_state_dict({WORDS: net.encoder.word.weight, **weights})
    except RuntimeError as error:
        raise ValueError(f"these are the weights of another network: {error}") from error


def fit(
    rows: Sequence[Row],
    base: Base,
    home: Path,
    plan: Plan,
    report: Callable[[Epoch], None],
    begin: Mapping[str, Tensor] | None = None,
) -> Reader:
    """The averaged weights of one training run, from the base on or from the weights `begin`."""
    torch.manual_seed(plan.seed)
    generator = np.random.default_rng(plan.seed)
    tokenizer = tokenizer_of(home)
    net = Reader(encoder_of(base, home))
    if begin is not None:
        take_up(net, begin)
    freeze(net.encoder, plan.frozen)
    averaged = deepcopy(net).eval()
    augmenter = Augmenter(rows, generator)
    encoder = [p for n, p in net.named_parameters() if n.startswith("encoder") and p.requires_grad]
    heads = [p for n, p in net.named_parameters() if not n.startswith("encoder")]
    optimiser = torch.optim.AdamW(
        [{"params": encoder, "lr": plan.encoder_rate}, {"params": heads, "lr": plan.head_rate}],
        weight_decay=0.01,
        fused=True,
    )
    steps_an_epoch = max(1, round(len(rows) * 38 / BATCH_TOKENS))
    total = round(plan.epochs * steps_an_epoch)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimiser, lambda s: min(1.0, (s + 1) / (0.06 * total)) * max(0.02, 1.0 - s / total)
    )
    step, started = 0, time.perf_counter()
    while step < total:
        made = [encode(augmenter(rows[i]), tokenizer) for i in generator.permutation(len(rows))]
        summed: Counter[str] = Counter()
        batches = _batches(made, generator)
        for examples in batches:
            net.train()
            with torch.autocast("cpu", dtype=torch.bfloat16):
                parts = losses(net, batch_of(examples))
            loss = (
                parts["floor"] + parts["object"] + 0.5 * parts["tags"] + 0.7 * parts["relation"] + 2.0 * parts["side"]
            )
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_([*encoder, *heads], 1.0)
            optimiser.step()
            schedule.step()
            step += 1
            keep = min(plan.average, (1 + step) / (10 + step))
            with torch.no_grad():
                for a, b in zip(averaged.parameters(), net.parameters(), strict=True):
                    if b.requires_grad:
                        a.lerp_(b, 1 - keep)
            summed.update({k: float(v.detach()) for k, v in parts.items()})
            if step >= total:
                break
        report(Epoch(step, total, time.perf_counter() - started, {k: v / len(batches) for k, v in summed.items()}))
    return averaged


def _batches(examples: Sequence[Example], generator: np.random.Generator) -> list[list[Example]]:
    """Alike in length, in a chance order."""
    order = sorted(examples, key=lambda e: len(e.ids) + generator.random() * 6)
    batches: list[list[Example]] = [[]]
    for e in order:
        if batches[-1] and (len(batches[-1]) + 1) * len(e.ids) > BATCH_TOKENS:
            batches.append([])
        batches[-1].append(e)
    generator.shuffle(batches)  # type: ignore[arg-type]
    return batches
