"""A run's folder as a submission: what it claims, and whether its answers give it."""
