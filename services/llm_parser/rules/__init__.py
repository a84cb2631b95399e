"""The embedded parser: a grammar of floors and noun phrases in English requests, without any model."""
