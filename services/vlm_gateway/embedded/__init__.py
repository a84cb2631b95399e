"""The vision model that ships with the project: it sees pixels and text, runs on one CPU core and needs no network."""

from services.vlm_gateway.embedded.model import BoxSeen, EmbeddedModel, FloorsSeen, OutOfVocabulary, Sighting

__all__ = ["BoxSeen", "EmbeddedModel", "FloorsSeen", "OutOfVocabulary", "Sighting"]
