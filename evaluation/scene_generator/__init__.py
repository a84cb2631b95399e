"""Streets and buildings at random: what a scene is asked to be, and the scene document it becomes."""
