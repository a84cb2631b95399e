"""The contour explorer: a map of what depth has shown, and the next stop that shows more of the building's facade.

scan -> map -> facade -> frontier -> path -> explore; each module is pure, and `explore` is one step of all of them.
"""
