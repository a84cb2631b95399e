"""The grammar put together: text to answer."""

from contracts.llm_parser import Evidence, ParseAnswer
from services.llm_parser.rules.floors import find_floors
from services.llm_parser.rules.objects import choose_object
from services.llm_parser.rules.phrases import find_phrases
from services.llm_parser.rules.tokens import tokenize

MODEL = "rules"
LONGEST_OBJECT = 200


def parse(request: str) -> ParseAnswer:
    """The floor and the object that `request` names; what it does not name is listed in `missing`."""
    tokens = tokenize(request)
    floors = find_floors(tokens)
    floor = floors.best()
    thing = choose_object(tokens, find_phrases(tokens, floors.taken), floors.taken)
    name = thing.text[:LONGEST_OBJECT] if thing else None
    return ParseAnswer(
        floor=floor.floor if floor else None,
        object=name,
        missing=tuple(field for field, value in (("floor", floor), ("object", thing)) if value is None),
        evidence=Evidence(
            floor=request[tokens[floor.first].start : tokens[floor.last - 1].end] if floor else None,
            object=request[tokens[thing.lead].start : tokens[thing.last - 1].end] if thing else None,
        ),
        model=MODEL,
    )
