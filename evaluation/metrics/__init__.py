"""The evaluation's figures, one a module; each states what it gives for no tasks at all."""
