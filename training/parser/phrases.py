"""Phrases that requests are put together from: other people's windows, European counting, chains of floors, doubt,
relations."""

PEOPLE = ("my neighbour", "the old lady", "my brother", "the dentist", "the people", "Mrs. Kaur", "my landlord", "Tom",
           "the students", "the couple", "my ex", "the family")  # fmt: skip
NEIGHBOURS = (
    "{Who} on {nth} has a {thing}, that's not me.",
    "Not the {thing}, that is {who}'s.",
    "The {thing} belongs to {who}.",
    "{Who} lives on the {word}.",
    "Last time you went to the {word} floor by mistake.",
    "Don't go to the window with the {thing}.",
    "We used to live on {nth}.",
    "ignore the {thing} next door",
    "The {thing} is gone since last week.",
    "There was a {thing} before.",
    "Flat {floor}2, if anybody asks.",
    "The building has {floor} storeys.",
    "{Who} upstairs has a {thing}.",
)
EUROPEAN = (
    ("{nth} floor as we count in Europe, ground is zero", 1),
    ("{word} floor, not counting the ground floor", 1),
    ("{nth} floor (UK style, so ground floor first)", 1),
    ("floor {n}, where the ground floor is 0", 1),
    ("{word} floor above the ground floor", 1),
    ("{n} flights up", 1),
    ("{n} flights of stairs above the street", 1),
    ("the {nth} floor, counted the German way", 1),
    ("{nth} floor European, one higher for Americans", 1),
    ("{n} storeys above the lobby", 1),
    ("{nth} floor, American counting, ground is first", 0),
    ("{word} floor counting the ground floor as one", 0),
    ("level {n}, and yes the street level is 1", 0),
    ("{nth} étage", 1),
    ("im {n}. Stock, ground floor does not count", 1),
)
CHAINS = (
    ("{b} floor{s} above {who}, who lives on {a}", 1),
    ("{b} floor{s} below {who}, and that's floor {a}", -1),
    ("{b} storey{s} over the office on the {nth} floor", 1),
    ("{b} level{s} under the {nth} floor", -1),
    ("the {nth} floor is {who}'s, I am {b} higher", 1),
    ("{who} has floor {a}; we are {b} down from there", -1),
    ("go to floor {a}, then {b} more up", 1),
)
DOUBTS = (
    "{a} or {b} floor, I don't remember",
    "either {n} or {m}",
    "floor {n}-{m}",
    "{a}, maybe {b} floor",
    "flat {n}/{m}",
    "apartment {n}0{m}",
    "house number {n}, door {m}",
    "somewhere between floor {n} and {m}",
    "parcel {n} of {m}",
    "{a} from the top, no idea how many there are",
    "between the {a} and the {b}",
    "High Street {n}{m}, unit {n}",
    "floor minus {n}",
    "not the {a}",
)
RELATIONS = {
    "left": ("Mine is the window left of the one with the {thing}.", "to the left of the {thing}, nothing in ours",
             "{count} windows left of the {thing}"),
    "right": ("Our window is just right of the {thing}.", "the window right next to the {thing}, on its right",
              "{count} to the right of the {thing}, ours has nothing"),
    "above": ("I live directly above the {thing}.", "the one over the window with the {thing}",
              "{count} windows above the {thing}"),
    "below": ("I'm under the window with the {thing}.", "one below the {thing}, my window is bare",
              "{count} windows below the {thing}"),
}  # fmt: skip
ON = ("floor {n}", "{nth} floor", "on the {nth}", "we're on {n}", "{nth} fl")
JOINS = (
    "{floor}, {thing}",
    "{thing}. {Floor}.",
    "{Floor}. There's a {thing} in the window.",
    "It's {floor}, look for the {thing}",
    "the window with the {thing}, {floor}",
    "{Floor}. A {thing} on the sill.",
    "{floor}\n{thing}",
)
