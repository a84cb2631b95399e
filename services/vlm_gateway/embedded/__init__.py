"""The vision model that ships with the project: it sees pixels and text, runs on one CPU core and needs no network."""

from pathlib import Path

from services.vlm_gateway.embedded.exported import FOLDER, MODEL_FILE
from services.vlm_gateway.embedded.words import OutOfVocabulary

__all__ = ["OutOfVocabulary", "trained"]


def trained(folder: Path = FOLDER) -> bool:
    """Are the trained files there?"""
    return (folder / MODEL_FILE).is_file()
