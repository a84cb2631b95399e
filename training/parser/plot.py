"""The curves of the card: losses over the epochs, and what asking buys on left-out authors."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np

from services.llm_parser.reader.model import Thresholds
from training.parser.measure import Calibrated, Examined, outcomes

mpl.use("Agg")
from matplotlib import pyplot as plt

GRAY, INK = "0.6", "#1f4e79"
LOSSES = {"floor": INK, "object": "#c8553d", "tags": GRAY, "relation": "#5b8c5a"}
"""Those that are drawn; the relation's side and count follow its anchor."""


def draw(history: Sequence[Mapping[str, float]], examined: Sequence[Examined], found: Calibrated, path: Path) -> None:
    """`history`: mean losses by head, one mapping an epoch."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), constrained_layout=True)
    for name, colour in LOSSES.items():
        left.plot(range(1, len(history) + 1), [losses[name] for losses in history], color=colour, label=name)
    left.set(xlabel="epoch", ylabel="mean loss (nats)", yscale="log", title="training; every epoch edits the rows anew")
    left.legend(frameon=False)
    authors = sorted({e.author for e in examined})
    for author in [*authors, None]:
        mine = [e for e in examined if author in (None, e.author)]
        curve = [outcomes(mine, found._replace(thresholds=_asking(share))) for share in np.linspace(0.0, 1.0, 41)]
        style = {"color": GRAY, "linewidth": 0.8} if author else {"color": INK, "linewidth": 2.0, "label": "all"}
        right.plot([100 * c.wrong for c in curve], [100 * c.right for c in curve], **style)
        if author:
            right.annotate(author, (100 * curve[0].wrong, 100 * curve[0].right), color="0.4")
    chosen = outcomes(examined, found)
    right.plot(100 * chosen.wrong, 100 * chosen.right, "o", color=INK)
    title = f"{len(authors)} left-out authors, from asking nothing (letter) to asking much"
    right.set(xlabel="silently wrong (%)", ylabel="right (%)", title=title)
    right.legend(frameon=False, loc="lower right")
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.title.set_fontsize(9)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _asking(share: float) -> Thresholds:
    """Both thresholds from 0, where nothing is asked, to nearly 1."""
    at = 1.0 - 0.001 ** (2.0 * share) if share else 0.0
    return Thresholds(floor=at, object=at)
