"""The closed form of an answer as a GBNF grammar, for llama.cpp and its relatives.

Only what our own schemas use is known here: objects whose properties are all required, lists, whole numbers within
bounds, numbers, truth values, choices of words, and "this or null". A whole number's bounds limit its digits; the exact
bounds are checked when the answer is read, as everything is.
"""

import json
from collections.abc import Mapping
from typing import Any


def gbnf(schema: Mapping[str, Any]) -> str:
    """The grammar of all JSON texts of `schema`, with a space at most between two parts. Raises ValueError for a schema
    of another kind."""
    return (
        f"root ::= {_rule(schema)}\n"
        'ws ::= " "?\n'
        'number ::= "-"? ("0" | [1-9] [0-9]{0,5}) ("." [0-9]{1,6})?\n'
        'boolean ::= "true" | "false"\n'
    )


def _rule(schema: Mapping[str, Any]) -> str:
    if "anyOf" in schema:
        return "(" + " | ".join(_rule(one) for one in schema["anyOf"]) + ")"
    if "enum" in schema:
        return "(" + " | ".join(_literal(json.dumps(word)) for word in schema["enum"]) + ")"
    kind = schema.get("type")
    if kind == "object":
        pairs = [f"{_literal(json.dumps(name) + ':')} ws {_rule(one)}" for name, one in schema["properties"].items()]
        inside = ' "," ws '.join(pairs)
        return f'"{{" ws {inside} ws "}}"'
    if kind == "array":
        return _array(schema)
    if kind == "integer":
        digits = len(str(schema.get("maximum", 999_999)))
        return f'("0" | [1-9] [0-9]{{0,{digits - 1}}})'
    if kind in ("number", "boolean"):
        return str(kind)
    if kind == "null":
        return '"null"'
    raise ValueError(f"no grammar for {dict(schema)}")


def _array(schema: Mapping[str, Any]) -> str:
    item = _rule(schema["items"])
    low, high = schema.get("minItems", 0), schema.get("maxItems", 25)
    more = f'("," ws {item}){{{max(0, low - 1)},{high - 1}}}'
    inside = f"{item} {more}"
    return f'"[" ws {inside} ws "]"' if low else f'"[" ws ({inside})? ws "]"'


def _literal(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
