"""The figures of the paper's five tables, as printed; percent where a name says so. Facts to stand beside ours."""

from typing import NamedTuple


class Scored(NamedTuple):
    """A row of the paper's tables 1, 4 and 5."""

    name: str
    success_pct: float
    spl_pct: float
    steps: float


class FloorRow(NamedTuple):
    """A row of the paper's table 2."""

    id: str
    model: str
    method: str
    fail_pct: float


class RecognitionRow(NamedTuple):
    """A row of the paper's table 3."""

    model: str
    fail_pct: float


MODELS = (
    Scored("Qwen2-VL-7B", 54.7, 50.8, 12.15),
    Scored("Llama-3.1-11B", 38.4, 36.4, 11.69),
    Scored("Yi-VL-6B", 13.2, 12.0, 12.22),
)
FLOORS = (
    FloorRow("a", "Qwen2-VL-7B", "Ours", 24.9),
    FloorRow("b", "Llama-3.1-11B", "Ours", 27.1),
    FloorRow("c", "Qwen2-VL-7B", "Direct Count", 61.6),
)
RECOGNITION = (
    RecognitionRow("Qwen2-VL-7B", 15.9),
    RecognitionRow("Llama-3.1-11B", 40.4),
    RecognitionRow("Yi-VL-6B", 53.3),
)
VIEWPOINT = (
    Scored("Ours", 54.0, 52.4, 12.84),
    Scored("Random", 24.0, 24.0, 8.42),
    Scored("Default", 20.0, 20.0, 8.80),
)
CHOICE = (
    Scored("✓", 52.9, 50.4, 11.68),
    Scored("✗", 53.8, 52.3, 12.29),
)
"""With and without the Choice VLM."""
