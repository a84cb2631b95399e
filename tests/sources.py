"""Python's own sources, read as trees."""

import ast
import gc


def tree_of_source(source: str, name: str = "<source>") -> ast.Module:
    """CPython 3.11 counts the depth of all trees under construction in one place: where the garbage collector ends a
    task whose exception nobody took, its traceback is built of a second tree, and the first fails as too deep
    (https://github.com/python/cpython/issues/106905, mended in 3.11.8). So nothing is collected meanwhile."""
    collected = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(source, name)
    finally:
        if collected:
            gc.enable()
