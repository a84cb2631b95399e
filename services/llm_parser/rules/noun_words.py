"""Which words may belong to a thing's name at their place: the closed words that do so here and there, and the rest."""

from collections.abc import Set

from services.llm_parser.rules import lexicon as lex
from services.llm_parser.rules.lexicon import words
from services.llm_parser.rules.tokens import Token

_MAINLY_VERBS = words(
    "saw watch drop hold play break skip catch pass love lift press guard rest guide hand stop lead fall figure tap "
    "suit throw cover display climb travel speed"
)
_HOLDERS = lex.ANCHORS | words("flat apartment facade façade unit house")
_PERSONAL = words("i we you he she it they")
_AFTER_THINGS = words("there here outside outdoors upright please thanks thx ty cheers bye okay ok now")
_PAST_FORMS = words("hung stood sat left put set kept found gave stuck")
_SIGN_TEXT = words("no for open closed keep stop do beware exit go not off out enter sale rent parking")
_NOT_CANNED = lex.NON_OBJECTS - lex.PARCEL_NOUNS
_OF_VERBS = lex.ADVERBS - _AFTER_THINGS
_SIGN_WORDS = _SIGN_TEXT | lex.COLOURS


class NounWords:
    """The tokens of a request, of which those in `taken` belong to no thing."""

    def __init__(self, tokens: list[Token], taken: Set[int]) -> None:
        self._tokens = tokens
        self._taken = taken
        self._size = len(tokens)

    def _norm(self, at: int) -> str:
        return self._tokens[at].norm if 0 <= at < self._size and at not in self._taken else ""

    def _belongs(self, at: int, in_phrase: bool, has_noun: bool) -> bool:
        """May token `at` be an attribute or noun here?"""
        if at >= self._size or at in self._taken or not self._tokens[at].is_word:
            return False
        word = self._norm(at)
        if word == "'s":
            return False
        if word.endswith("s") and self._norm(at - 1) in _HOLDERS and self._norm(at + 1) in ("a", "an"):
            return False  # "the window bears a ..."
        if word in lex.NOUN_OR_VERB:
            return in_phrase and self._ambiguous_is_noun(at, word, has_noun)
        if word in lex.CLOSED:
            if word in lex.ADJECTIVE_OR_VERB or (word in _SIGN_TEXT and self._is_sign_text(at)):
                opens = in_phrase and not has_noun and word in lex.ADJECTIVE_OR_VERB and self._is_plain(at + 1)
                return opens or self._is_sign_text(at)
            announced = in_phrase or self._norm(at - 1) in ("with", "near", "beside", "has", "have", "of")
            modifies = word.endswith(("ing", "ed")) and announced and not has_noun
            return modifies and self._is_plain(at + 1)
        if word.endswith("ly") and word not in lex.LY_WORDS:
            before = self._norm(at - 1)
            return before in lex.ARTICLES or before in lex.COLOURS or before in ("of", "my", "our")
        if has_noun and word.endswith("ing") and word not in lex.ING_NOUNS:
            return self._is_plain(at + 1) or self._norm(at + 1) == "can"
        if has_noun and word.endswith("ed") and word not in lex.ED_WORDS:
            return self._is_plain(at + 1)
        return True

    def _is_sign_text(self, at: int) -> bool:
        """What a sign says is part of its name: "a no parking sign", "a neon open sign"."""
        if self._norm(at) not in _SIGN_TEXT:
            return False
        end = at
        while end < at + 3 and self._norm(end) in _SIGN_TEXT:
            end += 1
        start = at
        while start > at - 3 and self._norm(start - 1) in _SIGN_WORDS:
            start -= 1
        return end > at and self._norm(end) in ("sign", "placard") and self._norm(start - 1) in lex.ARTICLES

    def _ambiguous_is_noun(self, at: int, word: str, has_noun: bool) -> bool:
        following = self._norm(at + 1)
        before = self._norm(at - 1)
        if word == "can":
            return self._is_container_can(at)
        if word in ("past", "second", "like", "well", "still"):
            return word == "well" and before == "wishing"
        if word not in _MAINLY_VERBS:
            return True
        if not has_noun:
            return following not in ("the", "a", "my", "me", "you", "it")
        return following not in lex.ARTICLES and following not in ("my", "our", "me", "you", "it")

    def _is_container_can(self, at: int) -> bool:
        """ "a fuel can stands there", not "the drone can stand there": an auxiliary goes on with a bare verb."""
        before, following = self._norm(at - 1), self._norm(at + 1)
        if not (before.endswith("ing") or before in lex.ATTRIBUTES or self._is_plain(at - 1)):
            return False
        if before in _NOT_CANNED:
            return False
        if following in _OF_VERBS or following in _PERSONAL:
            return following == "you" and self._norm(at + 2) in lex.AUXILIARIES
        bare = following in lex.VERBS and not following.endswith(("s", "ing", "ed")) and following not in _PAST_FORMS
        return not bare and following not in ("be", "do", "have", "not")

    def _is_plain(self, at: int) -> bool:
        """An open-class word: surely no verb, preposition or the like."""
        if at >= self._size or at in self._taken or not self._tokens[at].is_word:
            return False
        word = self._norm(at)
        if word in lex.NOUN_OR_VERB:
            return word != "can" and word not in ("past", "second", "like", "well", "still")
        return word not in lex.CLOSED and word != "'s" and not (word.endswith("ly") and word not in lex.LY_WORDS)
