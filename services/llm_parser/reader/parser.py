"""The learned reader as a parser: what is sure enough is answered, the rest is asked for."""

import asyncio
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from contracts.llm_parser import Confidence, Evidence, ParseAnswer, ParseQuestion, Reason, Reasons, Relation
from services.llm_parser.asking import Known, composed
from services.llm_parser.languages import SAID, other_language
from services.llm_parser.reader import decode
from services.llm_parser.reader.decode import FloorGuess, ObjectGuess, RelationGuess
from services.llm_parser.reader.floors import readings
from services.llm_parser.reader.mentions import Mention, find_mentions
from services.llm_parser.reader.model import ReaderModel, encode
from services.llm_parser.reader.spelling import Mended

MODEL = "reader"
QUICK_CHARACTERS = 600
"""Longer requests are read in a thread, so that health checks go on being answered."""
WEIGHTS = Path(__file__).with_name("weights")
WAVERS_FROM = 0.08
"""A guess with at least this probability is named as a candidate."""
_YES = re.compile(
    r"^\W*(?:yes|yeah|yep|yup|correct|right|exactly|sure|ok(?:ay)?|true|it is|that'?s (?:it|right))\b", re.I
)


class Guesses(NamedTuple):
    """All guesses of one text, the likeliest first, by its characters once it was `mended`."""

    mended: Mended
    floors: list[FloorGuess]
    objects: list[ObjectGuess]
    relation: RelationGuess | None
    cut: bool


class ReaderParser:
    """Needs nothing but its weights: always ready. `ground_floor`: how a plain "first floor" counts where the question
    does not say."""

    def __init__(self, model: ReaderModel, *, ground_floor: int = 1) -> None:
        self._model = model
        self._ground_floor = ground_floor
        self._calibration, self._thresholds = model.about.calibration, model.about.thresholds

    async def parse(self, question: ParseQuestion) -> ParseAnswer:
        if len(question.request) <= QUICK_CHARACTERS:
            return self.read(question)
        return await asyncio.to_thread(self.read, question)

    async def problem(self) -> str | None:
        return None

    def read(self, question: ParseQuestion) -> ParseAnswer:
        """The answer to a request and what was said about it since."""
        language = other_language(question.request)
        if language is not None and not question.exchanges:
            unread: Reason = "other_language"
            return ParseAnswer(
                missing=("floor", "object"),
                reasons=Reasons(floor=unread, object=unread),
                question=SAID[language.code],
                language=language.code,
                model=MODEL,
            )
        answer = self._answer(question.request, question.ground_floor)
        said = question.request
        for exchange in question.exchanges:
            said = f"{said.rstrip(' .')}. {exchange.answer}"
            answer = self._completed(answer, exchange.answer, said, question.ground_floor)
        return answer

    def _answer(self, text: str, ground_floor: Literal[0, 1] | None) -> ParseAnswer:
        read = self._guesses(text, self._ground_floor if ground_floor is None else ground_floor)
        floor, thing = read.floors[0], read.objects[0]
        confidence = Confidence(
            floor=round(self._calibration.floor.probability(floor.probability), 4),
            object=round(self._calibration.object.probability(thing.probability), 4),
        )
        written = read.mended.written
        sure_floor = (confidence.floor or 0.0) >= self._thresholds.floor
        sure_object = (confidence.object or 0.0) >= self._thresholds.object
        floors = tuple(g.floor for g in read.floors if g.floor is not None and g.probability >= WAVERS_FROM)[:3]
        things = tuple(g.phrase for g in read.objects if g.phrase is not None and g.probability >= WAVERS_FROM)[:3]
        relation = None
        if read.relation is not None and read.relation.anchor:
            relation = Relation(to=read.relation.anchor[:200], side=read.relation.side, count=read.relation.windows)
        return composed(
            Known(
                floor.floor if sure_floor else None,
                _reason(floor.floor, bool(floors) or bool(find_mentions(read.mended.text)), read.cut),
                floors,
            ),
            Known(thing.phrase if sure_object else None, _reason(thing.phrase, bool(things), read.cut), things),
            relation,
            confidence=confidence,
            evidence=Evidence(
                floor=written(text, floor.start, floor.end) if sure_floor and floor.floor is not None else None,
                object=written(text, thing.start, thing.end) if sure_object and thing.phrase is not None else None,
            ),
            language="en",
            model=MODEL,
        )

    def _completed(
        self, before: ParseAnswer, said: str, together: str, ground_floor: Literal[0, 1] | None
    ) -> ParseAnswer:
        """The answer once the customer has said something to its question: what was missing is looked for in these
        words first, then in all words together."""
        anew = self._answer(together, ground_floor)
        floor, thing = before.floor, before.object
        if floor is None:
            floor = _floor_said(said, before.candidates.floors) or anew.floor
        if thing is None:
            thing = _object_said(said, before.candidates.objects) or anew.object
            if thing is None and before.reasons.object in ("not_said", "relation_only") and before.floor is not None:
                thing = self._answer(f"{said.strip(' .')} on floor {before.floor}", ground_floor).object
        return composed(
            Known(floor, anew.reasons.floor or before.reasons.floor or "not_said", anew.candidates.floors),
            Known(thing, anew.reasons.object or before.reasons.object or "not_said", anew.candidates.objects),
            anew.relation,
            confidence=anew.confidence,
            evidence=anew.evidence,
            language=anew.language,
            model=MODEL,
        )

    def _guesses(self, text: str, ground_floor: int) -> Guesses:
        read = guesses(self._model, text)
        if ground_floor == 1:
            return read
        text, mentions = read.mended.text, find_mentions(read.mended.text)
        return read._replace(floors=[_counted_from_zero(g, text, mentions) for g in read.floors])


def guesses(model: ReaderModel, text: str) -> Guesses:
    """All guesses of a text by a network."""
    mended = model.spelling.mended(text)
    mentions = find_mentions(mended.text)
    encoded = encode(model.tokenizer, mended.text, mentions)
    scores = model.scores(encoded)
    read = [bool(row.any()) for row in encoded.averaging]
    seen = [r for r in readings(mentions) if read[r.first] and (r.second is None or read[r.second])]
    floors = decode.floors(scores, seen, mentions)
    objects = decode.objects(scores, encoded.tokens, floors[0])
    return Guesses(mended, floors, objects, decode.relation(scores, encoded.tokens), encoded.cut)


def _counted_from_zero(guess: FloorGuess, text: str, mentions: Sequence[Mention]) -> FloorGuess:
    """A plain "first floor" where the ground floor is 0: one more, unless the request itself says how it counts."""
    if guess.floor is None:
        return guess
    plain = [m for m in mentions if m.start >= guess.start and m.end <= guess.end]
    itself = len(plain) == 1 and plain[0].kind == "count" and plain[0].value == guess.floor
    counts_itself = any(m.kind == "ground" for m in mentions) or re.search(r"street|lobby|american|flight", text, re.I)
    return guess._replace(floor=guess.floor + 1) if itself and not counts_itself else guess


def _reason(value: object, wavers: bool, cut: bool) -> Reason:
    """Why a field is null whose likeliest value is this one."""
    if cut:
        return "too_long"
    return "unsure" if value is not None else "open" if wavers else "not_said"


def _floor_said(said: str, candidates: Sequence[int]) -> int | None:
    """The floor in a short answer: one number, a choice among the candidates, or a yes to the only one."""
    counts = {m.value for m in find_mentions(said) if m.kind in ("count", "ground")}
    if len(counts) == 1 and len(said.split()) <= 6:
        value = counts.pop()
        return value if 1 <= value <= 200 else None
    if not counts and len(candidates) == 1 and _YES.match(said):
        return candidates[0]
    return None


def _object_said(said: str, candidates: Sequence[str]) -> str | None:
    """The candidate that a short answer chooses: by a word that only it has, or a yes to the only one."""
    if len(candidates) == 1 and _YES.match(said):
        return candidates[0]
    words = decode.content(said)
    fitting = [c for c in candidates if words and decode.content(c) & words]
    if len(fitting) > 1:
        most = max(len(decode.content(c) & words) for c in fitting)
        fitting = [c for c in fitting if len(decode.content(c) & words) == most]
    return fitting[0] if len(fitting) == 1 else None
