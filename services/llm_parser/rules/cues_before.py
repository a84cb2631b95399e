"""What stands in front of a phrase and speaks for its being the mark: sought, had, placed, there, to be delivered."""

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.phrases import Phrase
from services.llm_parser.rules.tokens import Kind, Token

_SEEK = words("look looking search searching watch watching lookout eye eyes")
"""These look for something only together with "for", "out", "at"."""
_LOOK = words(
    "see spot find recognise recognize identify notice notices sees identifiable identified marked marks marker "
    "mark landmark reference seek spotting finding recognisable recognizable marking flagged distinguished beacon "
    "mentioned sign spots clue hint cue seeing locate locating follow visual identifier id indicator "
    "distinguishable guarded visible decorated adorned"
)
_STAND = words("is are hangs stands sits hang stand sit lies hanging standing sitting lives stays")
_STANDING = words("hangs stands sits hanging standing sitting hang stand stays dangles dangling")
_NEAR = words(
    "near beside by behind under underneath below above opposite adjacent alongside next close besides against "
    "facing around"
)
_DELIVER = words(
    "deliver bring send leave drop put take hand carry fly get need want ordered order expecting sending bringing "
    "expect leaving dropping delivering place set await awaiting handing requested give buy bought receive brought "
    "wait wants purchased dispatched dispatch transport shipment lower pick collect return ship pass waiting lost "
    "missing"
)
_BOTH_WAYS = words("put puts placed place set left")
"""What the drone is told to do with the parcel, and what the customer did with the mark."""
_ADDRESSES = words("address destination location side door")
_WANTING = words("want wanting need needing after")
_COMMANDING = words("please and you to kindly just or then , be it")
PUT_OUT = words("put placed place hung set stuck tied left installed mounted taped parked propped hooked fixed")
_FASTENED = words("hung stuck tied installed mounted taped propped hooked fixed fastened attached nailed pinned glued")
_LOST = words("carried blew took ripped threw swept tore gave")
_HAVE = words(
    "has have having got own owns owning keep keeps kept with 's shows displays displaying features featuring "
    "bearing sports bears "
    "carries boasts showing holds wearing holding"
)
_HOUSEHOLD = words("she he they dad mum mom mummy daddy wife husband son daughter sister brother grandma grandpa")
_SELF = words("i we")
PLACES = lex.ANCHORS | lex.DWELLINGS
_LABELS = words("item items parcel order contents package goods delivery ordered deliver product")


def before(tokens: list[Token], phrase: Phrase, limit: int) -> float:
    """The words in front of the phrase, back to token `limit` or the sentence's start."""
    back: list[str] = []
    for at in range(phrase.lead - 1, max(limit, phrase.lead - 9) - 1, -1):
        if tokens[at].kind is Kind.STOP:
            break
        back.append(tokens[at].norm)
    if not back:
        return 0.0
    back += ["", ""]
    score = _sought(back) + _had(back) + _placed(back) + _stands(back)
    sentence = tokens[phrase.lead].sentence
    farther = [t.norm for t in tokens[max(0, phrase.lead - 24) : phrase.lead] if t.sentence == sentence]
    if back[0] in _HAVE and "it" in back[1:4] and set(farther) & lex.ANCHORS:
        score += 2.5
    if _delivered(back, bool(set(farther[-16:]) & (_SELF | lex.KIN))):
        score -= 2.0 if set(back[:3]) & {"bought", "brought"} else 5.0
    return score


def _sought(back: list[str]) -> float:
    """ "look for a ...", "marked by the ...", "Marker: ..."."""
    first, second, near = back[0], back[1], set(back[:4])
    score = 0.0
    looks = near & _SEEK and (first in _SEEK or first in ("for", "out", "at") or "for" in back[:3])
    looks = looks or (first in ("on", "for") and back[1] in ("eye", "eyes"))
    looks = looks or (first in _WANTING and bool(set(back[1:4]) & {"you"}) and "do" not in back[1:4])
    if looks or near & _LOOK:
        score += 4.0
    if first in (":", "=", "-") and any(w in _LOOK | PLACES - _ADDRESSES for w in back[1:3]):
        score += 4.0
    if near & {"outside"} and first not in ("at", "on", "in"):
        score += 1.0
    if first in ("still", "mentioned"):
        score += 1.5
    beside = first == "to" and second in ("next", "close", "adjacent", "closest", "nearest")
    if (
        first in ("on", "in", "to", "for", "into", "from", "about", "until")
        and not beside
        and not looks
        and not near & _LOOK
    ):
        score -= 1.5
    return score


_BY_THE_WAY = words("there here also even still now always proudly currently only just")


def _had(back: list[str]) -> float:
    """ "my window has a ...", "the one with a ...", "we've got a ..."."""
    while len(back) > 3 and back[0] in _BY_THE_WAY:
        back = back[1:]
    first, second = back[0], back[1]
    if first == "of" and second in lex.ANCHORS:
        return 4.0
    if first == "with" and _of_building(back):
        return -6.0
    if first not in _HAVE and not (first in ("up", "out") and second in _HAVE):
        apart = set(back[1:5]) & words("have has got") and set(back[:4]) & lex.ANCHORS
        return 3.0 if apart else 0.0
    hosts = set(back[1:5])
    if first in ("keep", "keeps", "kept", "holding") and not hosts & (_SELF | PLACES):
        return 0.0
    if hosts & lex.ANCHORS:
        return 5.0
    if hosts & PLACES:
        return 4.5
    return 3.0 if hosts & _SELF else 2.0


def _of_building(back: list[str]) -> bool:
    """ "the tower with the ...": the nearest place in front is a whole building."""
    for word in back[1:5]:
        if word in lex.ANCHORS or word in _SELF or word in ("flat", "one", "apartment"):
            return False
        if word in lex.BUILDINGS:
            return True
    return False


def _placed(back: list[str]) -> float:
    """ "next to the ...", "I put a ...", "at the window she put a ..."."""
    first, second = back[0], back[1]
    score = 0.0
    beside = first in ("to", "of", "from") and second in ("next", "close", "adjacent", "front", "left", "right", "side")
    if (first in _NEAR or beside) and second in lex.BUILDINGS:
        return -2.0
    if first in _NEAR or beside:
        score += 4.0 if set(back[1:6]) & lex.ANCHORS else 3.0
    if set(back[:3]) & PUT_OUT and set(back[1:5]) & _SELF:
        score += 3.0
    elif first in PUT_OUT | {"puts", "hangs"} and set(back[1:4]) & _HOUSEHOLD:
        score += 2.0
    elif first in ("out", "up") and second in PUT_OUT | words("brought hang"):
        score += 3.0
    elif first in _FASTENED or (first == "down" and second in _FASTENED):
        score += 2.0
    if first in ("off", "away") and second in _LOST:
        score -= 5.0
    if first not in _HAVE and set(back[1:7]) & lex.ANCHORS and set(back[2:8]) & {"at", "on", "by", "in"}:
        score += 1.0
    return score


def _stands(back: list[str]) -> float:
    """ "there is a ...", "where hangs a ...", "ours is the ..."."""
    first, second = back[0], back[1]
    if first in _STAND and second in ("mine", "ours"):
        return 4.0
    if first in _STAND and second in ("there", "here", "hangs", "where"):
        return 3.0
    if first in _STANDING or (first == "is" and set(back[1:3]) & (_LOOK | lex.ANCHORS)):
        return 3.0
    if first in ("are", "am") and second in ("you", "i", "we"):
        return -4.0
    if first in ("is", "was") and second in lex.PARCEL_NOUNS:
        return -4.0
    if first == "is" and (set(back[1:6]) & {"thing", "something", "my", "our"}):
        return 1.0
    if first in ("is", "be", "are", "'s"):
        return -0.25 if second in ("it", "that", "this") else -0.5
    return 2.5 if first == "where" and second != "is" else 0.0


def _delivered(back: list[str], told: bool) -> bool:
    """Is the phrase what is to be brought: the direct object of "bring", "leave", "waiting for" and the like?

    `told`: the sentence says what the customer did ("we moved and put ...").
    """
    if back[0] in (":", "=", "-") and back[1] in _LABELS:
        return True
    if back[0] in ("for", "on") and back[1] in ("waiting", "wait"):
        return True
    if back[0] in ("of", "with") and (
        back[1] in ("shipment", "delivery") or set(back[1:4]) & {"care", "careful", "gentle"}
    ):
        return True
    for depth, word in enumerate(back[:5]):
        if word in _WANTING and depth == 0 and "you" in back[1:4]:
            return False
        if word in _DELIVER:
            subject = back[depth + 1]
            ours = (subject == "and" and told) or (subject == "," and bool(set(back[depth + 1 :]) & lex.KIN))
            return not (word in _BOTH_WAYS and subject and (ours or subject not in _COMMANDING))
        if word not in _BETWEEN or (word in ("for", "to", "out") and depth == 0):
            return False
    return False


_BETWEEN = words("me us up off over to for please just you kindly out the my")
