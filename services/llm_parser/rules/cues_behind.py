"""What the words behind a phrase say about its being the mark: where it stands, whose it is, what it serves for."""

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.cues_before import PLACES, PUT_OUT
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.phrases import Phrase
from services.llm_parser.rules.tokens import Kind, Token

_AT = words("at by on in outside near beside behind next inside from below under above against across over")
_SET_UP = words(
    "hanging standing sitting right displayed placed just there leaning fixed mounted painted taped tied still"
)
_PERSONS_DO = words(
    "put puts painted says said told tells thinks lives likes loves bought ordered wants keeps works has"
)


def behind(tokens: list[Token], phrase: Phrase, limit: int) -> float:
    """The words that follow the phrase, up to token `limit` or the sentence's end."""
    ahead: list[str] = []
    for at in range(phrase.last, min(limit, phrase.last + 8, len(tokens))):
        if tokens[at].kind is Kind.STOP:
            break
        ahead.append(tokens[at].norm)
    score = _said_of_it(tokens, phrase)
    if ahead[:1] == [","]:
        del ahead[0]
    if not ahead:
        return score
    ahead.append("")
    first, second, near = ahead[0], ahead[1], set(ahead[:7])
    at_window = bool(near & lex.ANCHORS)
    if first in lex.ANCHORS:
        score += 3.0
    elif first in _AT or first in _SET_UP:
        score += 3.5 if at_window else 2.5 if first == "outside" else 1.0 if near & PLACES else 0.0
        score += 1.0 if first in ("hanging", "standing") else 0.0
    elif (first == "to" and at_window and near & lex.MY) or (
        first == "that" and second in ("you", "i", "we") and near & _WANTED
    ):
        score += 2.5
    elif first in ("that", "which") and second not in ("i", "you", "he", "she", "they"):
        score += 3.0 if at_window else 2.0 if near & {"outside", "hangs", "stands", "sits"} else 0.0
    elif first in ("has", "have", "was", "were", "is") and at_window and near & (_SET_UP | PUT_OUT):
        score += 3.0
    elif first in _PERSONS_DO:
        score -= 2.0
    elif at_window and first in ("is", "in", ",", "="):
        score += 1.5
    if first in ("marks", "hangs", "stands", "sits", "shows", "=", "guards", "serves"):
        score += 2.5
    if first in ("is", "are") and second in _IS_THERE:
        score += 2.0
    if first in ("is", "are") and second in ("the", "my", "our", "a", "your") and ahead[2:3] and ahead[2] in _LANDMARKS:
        score += 3.5
    if first == "you" and second in ("are", "want", "need", "will") and near & {"after", "want", "need", "looking"}:
        score += 3.5
    if first in ("should", "must", "shall") and set(ahead[1:4]) & _MOVED:
        score -= 4.0
    if set(ahead[:2]) & _AMOUNTS:
        score -= 3.0
    if "instead" in ahead[:2]:
        score += 2.0
    if first == "do":
        score += 1.5
    if first == "is" and second == "for":
        score -= 3.0
    return score


_MOVED = words("come go delivered brought left handed sent arrive")
_AMOUNTS = words("qty quantity pcs units")
_LANDMARKS = words("landmark mark marker sign signal beacon clue guide hint")
_WANTED = words("find see look spot want need keep kept put placed hung")
_IS_THERE = words("still at by outside in on hanging visible mine my right")
_SUBJECT_VERBS = words("is 's still now sits stands hangs has marks shines lives stays")


_SINCE = (["'s", "been", "at"], ["is", "been", "at"], ["has", "been", "at"], ["is", "now", "at"], ["is", "still", "at"])


def _said_of_it(tokens: list[Token], phrase: Phrase) -> float:
    """ "... a cactus! It's sitting in my window": what follows places "it" at the window."""
    stops = 0
    end = min(len(tokens), phrase.last + 18)
    for at in range(phrase.last, end - 2):
        if tokens[at].kind is Kind.STOP:
            stops += 1
            if stops > 2:
                return 0.0
        if tokens[at].norm == "it" and tokens[at + 1].norm in _SUBJECT_VERBS:
            if [t.norm for t in tokens[at + 1 : at + 4]] in _SINCE:
                return 3.0
            placed = [t.norm for t in tokens[at + 2 : at + 5]]
            if placed[:1] and placed[0] in ("by", "at", "outside", "in") and placed[-1] in lex.ANCHORS:
                return 2.0 if stops < 2 else 1.0
            rest = [t.norm for t in tokens[at + 1 : at + 10] if t.sentence == tokens[at].sentence]
            if set(rest) & lex.ANCHORS and set(rest) & lex.MY and rest[1:2] != ["the"]:
                return 3.0 if stops < 2 else 2.0
    return 0.0
