"""What the words around a phrase, and its own words, say about its being the mark at the customer's window.

All figures are points on one scale: about 5 for a plain statement ("my window has a ..."), 3 for a hint ("next to the
..."), 1 or less for what only breaks ties (a colour).
"""

from collections.abc import Set

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
_PUT_OUT = words("put placed place hung set stuck tied left installed mounted taped parked propped hooked fixed")
_FASTENED = words("hung stuck tied installed mounted taped propped hooked fixed fastened attached nailed pinned glued")
_LOST = words("carried blew took ripped threw swept tore gave")
_HAVE = words(
    "has have having got own owns owning keep keeps kept with 's shows displays displaying features featuring bearing sports bears "
    "carries boasts showing holds wearing holding"
)
_HOUSEHOLD = words("she he they dad mum mom mummy daddy wife husband son daughter sister brother grandma grandpa")
_SELF = words("i we")
_AT = words("at by on in outside near beside behind next inside from below under above against across over")
_SET_UP = words(
    "hanging standing sitting right displayed placed just there leaning fixed mounted painted taped tied still"
)
_PERSONS_DO = words(
    "put puts painted says said told tells thinks lives likes loves bought ordered wants keeps works has"
)
_PLACES = lex.ANCHORS | lex.DWELLINGS
_BREAKS = (Kind.STOP, Kind.SYMBOL)
_LABELS = words("item items parcel order contents package goods delivery ordered deliver product")


def own_worth(tokens: list[Token], phrase: Phrase) -> float:
    """What the phrase's own words say: what cameras see counts, goods and abstractions count against it."""
    own = {tokens[i].norm for i in range(phrase.first, phrase.last)}
    head = tokens[phrase.head].norm
    known = head in lex.OBJECT_NOUNS or head.rstrip("s") in lex.OBJECT_NOUNS
    worth = 0.75 * known
    if own & lex.COLOURS:
        worth += 1.0
    elif own & lex.ATTRIBUTES:
        worth += 0.5
    if own <= lex.ATTRIBUTES - lex.OBJECT_NOUNS - _NOUNS_TOO:
        worth -= 3.0
    if head in lex.PARCEL_NOUNS:
        worth -= 4.0 if len(own) == 1 else 0.5
    if head in lex.SOFT_NOUNS and phrase.last == phrase.head + 1:
        worth -= 0.25
    proper = tokens[phrase.head].raw[:1].isupper() and not tokens[phrase.head].raw.isupper()
    inside = bool(phrase.lead) and tokens[phrase.lead - 1].is_word
    if len(own) == 1 and not phrase.determiner and inside and not known:
        worth -= 1.5 if proper else 0.75
    if _addressed(tokens, phrase):
        worth -= 4.0
    if phrase.determiner in ("no", "any", "every", "each"):
        worth -= 2.0
    if head.endswith(("ness", "tion", "ment", "ity", "ism")) and head not in _SOLID_IN_SPITE:
        worth -= 2.0
    return worth


_NOUNS_TOO = words("toy antique glass miniature plush square gold silver light marble paper leather straw bamboo")
_SOLID_IN_SPITE = words("ornament instrument monument carnation harness")


def _addressed(tokens: list[Token], phrase: Phrase) -> bool:
    """ "Dear flying toaster, ...", "... you glorious machine." """
    said = tokens[phrase.lead].norm if phrase.determiner == "-" else ""
    called = said == "dear" or (phrase.lead > 0 and tokens[phrase.lead - 1].norm in ("dear", "you", "hello", "fellow"))
    ends = phrase.last >= len(tokens) or tokens[phrase.last].kind in _BREAKS
    return called and ends and phrase.determiner in ("", "-")


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
    if first in (":", "=", "-") and any(w in _LOOK | _PLACES - _ADDRESSES for w in back[1:3]):
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
    if first in ("keep", "keeps", "kept", "holding") and not hosts & (_SELF | _PLACES):
        return 0.0
    if hosts & lex.ANCHORS:
        return 5.0
    if hosts & _PLACES:
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
    if set(back[:3]) & _PUT_OUT and set(back[1:5]) & _SELF:
        score += 3.0
    elif first in _PUT_OUT | {"puts", "hangs"} and set(back[1:4]) & _HOUSEHOLD:
        score += 2.0
    elif first in ("out", "up") and second in _PUT_OUT | words("brought hang"):
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


def alone(tokens: list[Token], phrase: Phrase, taken: Set[int]) -> float:
    """A phrase that is a clause by itself: "The bicycle wheel." or "5th floor, bicycle wheel, thanks"."""
    front = phrase.lead - 1
    if front > 0 and tokens[front].norm in ("and", "so", "then", "plus"):
        front -= 1
    opens = front < 0 or tokens[front].kind in _BREAKS or front in taken
    substance = phrase.determiner or phrase.last - phrase.first > 1 or own_worth(tokens, phrase) > 0
    if substance and is_clause(tokens, phrase, taken):
        return 1.25
    return 0.75 if opens and phrase.determiner in ("a", "an") else 0.0


def is_clause(tokens: list[Token], phrase: Phrase, taken: Set[int]) -> bool:
    """Do breaks or floors stand on both sides of the phrase? A joining "and" in front is passed over."""
    front, end = phrase.lead - 1, phrase.last
    if front > 0 and tokens[front].norm in ("and", "so", "then", "plus"):
        front -= 1
    opens = front < 0 or tokens[front].kind in _BREAKS or front in taken
    if end < len(tokens) and tokens[end].norm in ("at", "on", "in"):
        end += 1 + (tokens[end + 1].norm == "the" if end + 1 < len(tokens) else 0)
        return opens and end in taken
    return opens and (end >= len(tokens) or tokens[end].kind in _BREAKS or end in taken)


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
        score += 3.5 if at_window else 2.5 if first == "outside" else 1.0 if near & _PLACES else 0.0
        score += 1.0 if first in ("hanging", "standing") else 0.0
    elif (first == "to" and at_window and near & lex.MY) or (
        first == "that" and second in ("you", "i", "we") and near & _WANTED
    ):
        score += 2.5
    elif first in ("that", "which") and second not in ("i", "you", "he", "she", "they"):
        score += 3.0 if at_window else 2.0 if near & {"outside", "hangs", "stands", "sits"} else 0.0
    elif first in ("has", "have", "was", "were", "is") and at_window and near & (_SET_UP | _PUT_OUT):
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
    if set(ahead[:2]) & _AMOUNTS:
        score -= 3.0
    if "instead" in ahead[:2]:
        score += 2.0
    if first == "do":
        score += 1.5
    if first == "is" and second == "for":
        score -= 3.0
    return score


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
