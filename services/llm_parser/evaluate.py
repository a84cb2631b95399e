"""How often the grammar is right: `python -m services.llm_parser.evaluate FILE.jsonl [--seed N --fills K] [--json]`."""

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from services.llm_parser.rules.parser import parse
from services.llm_parser.templates import BadSamples, Sample, normalised, read_samples


@dataclass(frozen=True)
class Failure:
    id: str
    style: str
    request: str
    floor: int | None
    got_floor: int | None
    object: str | None
    got_object: str | None


@dataclass
class Score:
    """Exact matches over `samples` requests; an object counts after lower-casing and without its article."""

    samples: int = 0
    floors: int = 0
    objects: int = 0

    @property
    def floor_share(self) -> float:
        """Between 0 and 1; 0 of 0 counts as 0."""
        return self.floors / self.samples if self.samples else 0.0

    @property
    def object_share(self) -> float:
        """Between 0 and 1; 0 of 0 counts as 0."""
        return self.objects / self.samples if self.samples else 0.0

    def add(self, floor: bool, thing: bool) -> None:
        self.samples += 1
        self.floors += floor
        self.objects += thing

    def as_record(self) -> dict[str, float]:
        return {
            "samples": self.samples,
            "floors": self.floors,
            "objects": self.objects,
            "floor_exact": round(self.floor_share, 4),
            "object_exact": round(self.object_share, 4),
        }


@dataclass(frozen=True)
class Evaluation:
    overall: Score
    by_style: dict[str, Score]
    failures: tuple[Failure, ...]

    def as_json(self) -> str:
        record = {
            "overall": self.overall.as_record(),
            "by_style": {style: score.as_record() for style, score in sorted(self.by_style.items())},
            "failures": [asdict(failure) for failure in self.failures],
        }
        return json.dumps(record, ensure_ascii=False)

    def lines(self) -> Iterable[str]:
        """For people: overall, by style, then every failure with what was expected."""
        for failure in self.failures:
            wrong = []
            if failure.floor != failure.got_floor:
                wrong.append(f"floor {failure.floor} read as {failure.got_floor}")
            if normalised(failure.object) != normalised(failure.got_object):
                wrong.append(f"object {failure.object!r} read as {failure.got_object!r}")
            yield f"{failure.id} {failure.style}: {'; '.join(wrong)}\n    {failure.request}"
        yield f"{'style':<18}{'samples':>8}{'floor':>9}{'object':>9}"
        for style, score in [*sorted(self.by_style.items()), ("all", self.overall)]:
            yield f"{style:<18}{score.samples:>8}{score.floor_share:>9.1%}{score.object_share:>9.1%}"


def evaluate(samples: Iterable[Sample]) -> Evaluation:
    """Parse every sample and compare."""
    overall = Score()
    by_style: defaultdict[str, Score] = defaultdict(Score)
    failures = []
    for sample in samples:
        answer = parse(sample.request)
        floor = answer.floor == sample.floor
        thing = normalised(answer.object) == normalised(sample.object)
        overall.add(floor, thing)
        by_style[sample.style].add(floor, thing)
        if not (floor and thing):
            failures.append(
                Failure(
                    sample.id, sample.style, sample.request, sample.floor, answer.floor, sample.object, answer.object
                )
            )
    return Evaluation(overall, dict(by_style), tuple(failures))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the evaluation of a file; exit status 2 where the file can't be used."""
    parser = argparse.ArgumentParser(prog="python -m services.llm_parser.evaluate", description=__doc__)
    parser.add_argument("file", type=Path, help="JSON lines: templates with slots, or sentences with expected answers")
    parser.add_argument("--seed", type=int, default=0, help="seed of the slots' values")
    parser.add_argument("--fills", type=int, default=3, help="how often each template is filled")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of text")
    asked = parser.parse_args(arguments)
    try:
        found = evaluate(read_samples(asked.file, seed=asked.seed, fills=asked.fills))
    except (OSError, BadSamples) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.write(found.as_json() + "\n" if asked.json else "\n".join(found.lines()) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
