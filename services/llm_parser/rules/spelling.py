"""Typos in the words that carry the grammar. Words of objects are never touched.

A token is repaired when it is no known word and lies close to exactly the kind of word that the grammar needs:
a function word, a place or a floor noun. The first letter has to be right, or swapped with the second.
"""

import re
from functools import lru_cache

from rapidfuzz import process
from rapidfuzz.distance import OSA, Indel

from services.llm_parser.rules.lexicon import (
    ADVERBS,
    ATTRIBUTES,
    CLOSED,
    FLOOR_NOUNS,
    ING_NOUNS,
    KIN,
    LY_WORDS,
    MEASURE_NOUNS,
    NON_OBJECTS,
    NOUN_OR_VERB,
    OBJECT_NOUNS,
    words,
)
from services.llm_parser.rules.numbers import CARDINALS, ORDINALS

_SHORT = {
    "teh": "the",
    "hte": "the",
    "th": "the",
    "tha": "the",
    "eth": "the",
    "adn": "and",
    "nad": "and",
    "annd": "and",
    "si": "is",
    "iss": "is",
    "fo": "of",
    "ofr": "for",
    "fro": "for",
    "ot": "to",
    "ta": "to",
    "iwth": "with",
    "wit": "with",
    "wih": "with",
    "wtih": "with",
    "wiht": "with",
    "whit": "with",
    "wth": "with",
    "yuo": "you",
    "yu": "you",
    "oen": "one",
    "ym": "my",
    "mi": "my",
    "hsa": "has",
    "ahs": "has",
    "haz": "has",
    "ther": "there",
    "tehre": "there",
    "thier": "their",
    "taht": "that",
    "nto": "not",
    "ont": "not",
    "bi": "by",
    "ona": "on a",
    "ina": "in a",
    "na": "an",
    "seh": "she",
    "heer": "here",
    "lok": "look",
    "loook": "look",
    "fnd": "find",
    "fidn": "find",
    "flr": "floor",
    "foor": "floor",
    "floo": "floor",
    "flor": "floor",
    "flloor": "floor",
    "wndow": "window",
    "windo": "window",
    "int": "in",
    "sil": "sill",
    "nxet": "next",
    "nex": "next",
    "nxt": "next",
    "ner": "near",
    "nea": "near",
    "netx": "next",
    "alot": "lot",
    "becuase": "because",
    "leav": "leave",
    "se": "see",
}

_LONG_TARGETS = sorted(
    word
    for word in (
        FLOOR_NOUNS
        | words(
            "window windows windowsill balcony sill ledge outside inside beside behind between near next with there "
            "their where which that this these from the look looking find spot have having please because should "
            "would could leave deliver delivery bring parcel package building elevator morning neighbour neighbours "
            "neighbor neighbors again apartment hanging standing sitting thanks thank and your under above below "
            "opposite against instead wrong before after already something someone number about don't through right "
            "front door doors waiting knock mine careful always still just only also want need what when will help "
            "visible really very terrace railing glass marked placed though"
        )
        | CARDINALS.keys()
        | ORDINALS.keys()
    )
    if len(word) >= 4
)

_PROTECTED = words(
    "bedside brolly file warning handling setting logging stored starting masked loading become slot slots abort held "
    "vary alter mapped haven raising strides stride package gain signing walking severity forth outline locking "
    "sibling "
    "hashing replay intend mocking verb staging wild strips rating losing nicely mike realty planned stacking hell "
    "boring wasting spit spill skill skills racing ranging flop bundling passage readily flavors stalling mins stormy "
    "insane outlive outsize stress cold outsider played market viable staying hacking sizing steven halting mounting "
    "waking fist fink thaw ledger fend striding pascal sever moaning mourning mornings wanton wading wailing whiting "
    "baiting hauling packing parking barking marching matching banking ranking thief theft sleet street sweet swing "
    "stifle stile stilts still silt silo silver slid sofa florist floret afloat ghost toast roast forty party pastry "
    "heading feeding reading weeding wedding spreading cloth clothes closet cloves north month mouth worth broth "
    "shovel shore shawl shelter shuttle stein stern steel steam stew stump stripes striped strap string winding "
    "banding lending mending bending sunning running ringing bringing singing stinging tingling hinging canning "
    "tanning fanning panning landing blending bonding ponding pending "
    "donut donuts placard placards shield shields tank tanks bench wreath bread thread whisk tile tiles hood "
    "lantern lanterns lattice knight height apron inlet flair throne thorn liver linen novel bevel waffle rooster "
    "boaster coaster toaster stereo stork cornet bonnet behave lilac lotus loom floss flask flake flock finch "
    "hearth sleigh sloth lasso hanger wander window willow wallow walnut widget pantry cello celery grass brass "
    "brief spike spine spire snipe sting sling flour flood flow flows flowed flower lever width wish fish form "
    "forms widow winnow story tree trees bridal doll dolls moor poor wind wine wing wings mind mint mill hill bill "
    "ball bell belt boot boots book books boat goat coat moth cloth lamb limp lemon level weather leather feather "
    "heather father thing think thin tin ten stall still shelf self seal seat heat meat neat nest vest text tent "
    "teapot stripe string strong spring pine pint line wire wide side bride slide glide fir fur four five fire hire "
    "tire mice nine vine lime hare hair heir chair stair lair where there these those three theme then them than "
    "that hat what chat plaster poster pasta paste tower shower power flowers floral float block clock cloak crock "
    "rack back sack jack wick stick brick trick sock rock lock dock duck luck truck track lion iron sign sigh light "
    "night might tights lights stand sand band hand land wand blind bland gnome genome dome comb tomb lamp lamps "
    "clamp stamp camp ramp damp dump lump pump spool stool spoon moon noon boom broom room root roof hoof loop hoop "
    "pool tool globe glove gloves clover cover lover oven over river silver sliver slate plate plane planet plant "
    "plants ivy jug mug rug bug bag tag flag flags frog fog dog log bog leg egg peg pig wig fig robin ribbon rabbit "
    "rubber ladder leader header heater letter lettuce litter glitter magnet mango orange range carrot parrot "
    "pirate panda pan pansy candy candle handle violin viola violet villa vanilla bundle saddle paddle puddle "
    "pebble marble table cable wheat wheel whale while white watch witch which wicker winter winner water waiter "
    "barrow arrow sparrow marrow mirror minor money honey monkey donkey key keys turkey statue status stable staple "
    "stack sticker stocking store storm stone stove bike bikes hike like lake cake cape cap cup cut cat car card "
    "cart care cane crane frame flame farm firm film fern ferns herb herbs hero heron bead beads break bear bears "
    "beard bean beans pear pears pearl peach beach branch bunch lunch punch sail snail nail nails tail pail mail "
    "hail rail trail tray pray gray spray shell shed shoe shoes show shop ship chip chips sheep sleep blow glow "
    "slow snow crow crown brown drown drum drums plum plums witches widows windmill pillow pillows cotton button "
    "butter batter hanging hunting bunting painting printing pointing needle noodle poodle nettle kettle cattle "
    "bottle battle rattle sill silk milk mask desk disk dish dishes brush bush tractor doctor factor actor rocket "
    "racket jacket basket bracket bucket pocket packet locket ticket thistle whistle thimble tassel vessel easel "
    "weasel fridge bridge fringe hinge sponge lounge pattern western eastern northern southern external internal "
    "place plaice palace police peace piece price prize pride under sunder thunder number lumber timber amber ember "
    "member fort font foot food good wood mood fool wool horn corn torn born acorn popcorn unicorn mouse house "
    "horse nurse purse rose nose hose pose knot know knife kite kit kitten mitten mittens written thick though "
    "through trough rough tough dough bought brought behold begin begun bonsai onside decide reside residence soap "
    "soup swan swans swam spot pots port sport shirt skirt short shorts sweets sweater netting fitting sitting "
    "knitting fleece fox box ox six sax wax fax nets news newt note nuts hot hut hit hats huts net met mat mats jet "
    "wet wed web bed beds bud buds bad lad led lid lip lap map mop top tap tip zip rip sun gun bun run fun nun pun "
    "son ton won bus bow row tow cow owl bowl towel trowel vowel"
)

_KNOWN = (
    CLOSED
    | NON_OBJECTS
    | ATTRIBUTES
    | OBJECT_NOUNS
    | MEASURE_NOUNS
    | NOUN_OR_VERB
    | ING_NOUNS
    | LY_WORDS
    | KIN
    | ADVERBS
    | FLOOR_NOUNS
    | CARDINALS.keys()
    | ORDINALS.keys()
    | _PROTECTED
)


_ONE_SPELLING = {"neighbor": "neighbour", "neighbors": "neighbours"}
_LONG_DRAWN = re.compile(r"(.)\1{2,}")


@lru_cache(maxsize=8192)
def repair(word: str) -> tuple[str, bool]:
    """The word that `word` stands for (sometimes two), and whether it was changed. Lower case in, lower case out."""
    word, squeezed = _squeeze(word)
    if squeezed and word in _KNOWN:
        return word, True
    short = _SHORT.get(word)
    if short is not None and (word not in _KNOWN or word in FLOOR_NOUNS):
        return short, True
    if len(word) < 4 or len(word) > 14 or "-" in word or word in _KNOWN:
        return word, False
    if word.endswith("s") and word[:-1] in _KNOWN:
        return word, False
    cutoff = 1 if len(word) < 6 else 2
    found = process.extract(word, _LONG_TARGETS, scorer=OSA.distance, score_cutoff=cutoff, limit=4)
    close = [
        (distance, Indel.distance(word, target), target) for target, distance, _ in found if _same_start(word, target)
    ]
    if not close:
        return word, False
    distance, _, target = min(close)
    if distance == 2 and (len(target) < 6 or not _same_ends(word, target)):
        return word, False
    return _ONE_SPELLING.get(target, target), True


def _squeeze(word: str) -> tuple[str, bool]:
    """ "plsss" is "pls" and "sooo" is "so": three letters in a row are one, or two where that makes a word."""
    if not _LONG_DRAWN.search(word):
        return word, False
    double = _LONG_DRAWN.sub(r"\1\1", word)
    return (double if double in _KNOWN else _LONG_DRAWN.sub(r"\1", word)), True


def _same_start(word: str, target: str) -> bool:
    return word[0] == target[0] or (word[0] == target[1] and word[1] == target[0])


def _same_ends(word: str, target: str) -> bool:
    """Two slips are believed only where the letters are the same but for doubling and order, or the ends agree."""
    return set(word) == set(target) or (word[:2] == target[:2] and word[-1] == target[-1])
