"""The part that both trainings share: steps, a rate that falls at the end, checkpoints, a smoothed copy, a log."""

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor, nn

from training.progress import progress

_SMOOTH = 0.998


class Plan(NamedTuple):
    """`steps` in all; the rate rises over `warm` steps, stays, and falls to nothing over the last `fall` of them."""

    steps: int
    rate: float
    warm: int = 50
    fall: float = 0.5
    decay: float = 0.02
    save_every: int = 100
    log_every: int = 25


class Trainer:
    """One network in training. `loss(net, number)` gives the loss of batch `number` and figures worth plotting.

    A checkpoint holds everything, so that an interrupted run ends in the same state as an uninterrupted one.
    """

    def __init__(
        self,
        name: str,
        folder: Path,
        net: nn.Module,
        loss: Callable[[nn.Module, int], tuple[Tensor, dict[str, float]]],
        plan: Plan,
    ) -> None:
        self.net, self.plan, self._loss, self._name = net, plan, loss, name
        self.smooth = {k: v.detach().clone() for k, v in net.state_dict().items()}
        self._best = torch.optim.AdamW(net.parameters(), lr=plan.rate, weight_decay=plan.decay, fused=True)
        self._checkpoint, self._log = folder / f"{name}.pt", folder / f"{name}-log.jsonl"
        self.step = 0
        folder.mkdir(parents=True, exist_ok=True)
        if self._checkpoint.exists():
            self._restore()

    def run(self, until: int | None = None) -> None:
        """Trains until step `until` (else the plan's end), saving on the way and when interrupted."""
        end = min(self.plan.steps, until or self.plan.steps)
        with progress() as bar:
            task = bar.add_task(f"training the {self._name}", total=self.plan.steps, completed=self.step)
            try:
                while self.step < end:
                    figures = self._one()
                    if self.step % self.plan.log_every == 0:
                        bar.update(task, completed=self.step, description=f"{self._name} {_short(figures)}")
                        self._write(figures)
                    if self.step % self.plan.save_every == 0:
                        self.save()
            finally:
                self.save()

    def _one(self) -> dict[str, float]:
        rate = self.plan.rate * self._share()
        for group in self._best.param_groups:
            group["lr"] = rate
        self.net.train()
        loss, figures = self._loss(self.net, self.step)
        self._best.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.net.parameters(), 5.0)
        self._best.step()
        self.step += 1
        keep = min(_SMOOTH, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for key, value in self.net.state_dict().items():
                if value.is_floating_point():
                    self.smooth[key].lerp_(value, 1 - keep)
                else:
                    self.smooth[key].copy_(value)
        return {"loss": float(loss.detach()), "rate": rate, **figures}

    def _share(self) -> float:
        left = (self.plan.steps - self.step) / max(1, self.plan.steps * self.plan.fall)
        falling = 0.5 - 0.5 * math.cos(math.pi * min(1.0, left))
        return min(1.0, (self.step + 1) / self.plan.warm) * max(0.01, falling)

    def smoothed(self) -> nn.Module:
        """The network with the mean of its last weights, ready to answer."""
        import copy

        net = copy.deepcopy(self.net)
        net.load_state_dict(self.smooth)
        return net.eval()

    def save(self) -> None:
        state = {
            "net": self.net.state_dict(),
            "smooth": self.smooth,
            "best": self._best.state_dict(),
            "step": self.step,
            "chance": torch.get_rng_state(),
        }
        part = self._checkpoint.with_suffix(".part")
        torch.save(state, part)
        part.rename(self._checkpoint)

    def _restore(self) -> None:
        where = next(self.net.parameters()).device
        state = torch.load(self._checkpoint, weights_only=True, map_location=where)
        self.net.load_state_dict(state["net"])
        self.smooth = state["smooth"]
        self._best.load_state_dict(state["best"])
        self.step = int(state["step"])
        torch.set_rng_state(state["chance"].cpu())

    def _write(self, figures: dict[str, float]) -> None:
        line = {
            "step": self.step,
            "cpu_s": round(time.process_time(), 1),
            **{k: round(v, 5) for k, v in figures.items()},
        }
        with self._log.open("a", encoding="utf-8") as log:
            log.write(json.dumps(line) + "\n")


def _short(figures: dict[str, float]) -> str:
    return " ".join(f"{k} {v:.3f}" for k, v in figures.items() if k != "rate")
