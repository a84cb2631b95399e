"""The mission: from a sentence to a stop in front of a window, as a state machine over four ports."""
