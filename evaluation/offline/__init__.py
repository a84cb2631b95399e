"""Recorded looks asked again, of any number of models and of people, without flying."""
