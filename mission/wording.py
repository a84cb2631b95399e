"""Small words of messages: numbers with their nouns, things with their articles."""

_SOUND_LIKE_CONSONANTS = ("uni", "use", "eu", "one")
_ARTICLES = ("a ", "an ", "the ")


def counted(n: int, one: str, many: str | None = None) -> str:
    """`1 sighting`, `2 sightings`; `many` where the plural is not the noun and an s."""
    return f"{n} {one if n == 1 else many or one + 's'}"


def spoken_duration(seconds: float) -> str:
    """`10 minutes`, `45 seconds`."""
    return counted(round(seconds / 60), "minute") if seconds >= 60.0 else counted(round(seconds), "second")


def with_article(thing: str) -> str:
    """`a cake`, `an orange stool`; by the first letters, which is right for all but a few words. A thing that comes
    with its article keeps it."""
    first = thing.casefold()
    if first.startswith(_ARTICLES):
        return thing
    return f"{'an' if first[:1] in tuple('aeiou') and not first.startswith(_SOUND_LIKE_CONSONANTS) else 'a'} {thing}"
