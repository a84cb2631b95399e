"""A hook of MkDocs: links that leave docs/ lead to files of the repository, which the site has not got; names stay.

https://www.mkdocs.org/user-guide/configuration/#hooks
"""

import re
from typing import Any

_OUTSIDE = re.compile(r"\[([^\]]+)\]\((?:\.\./)+([^)#]*)(?:#[^)]*)?\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page with its links to files outside docs/ as plain names."""
    return _OUTSIDE.sub(lambda link: f"{link.group(1)} (`{link.group(2)}`)", markdown)
