"""The vision models that ship with the project: pixels and text in, one CPU core, no network."""
