"""The evaluation: many episodes over several processes, each result written as it comes."""
