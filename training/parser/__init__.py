"""Trains the learned reader of requests: `python -m training.parser`."""
