"""Scenes that people write themselves: what is wrong with one, where a drone may start in it, a picture of it."""
