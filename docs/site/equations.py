"""Displayed equations of the site: ```math blocks (LaTeX, as GitHub shows them) become MathML,
which browsers draw without a script."""

import re
from typing import Any

_BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, **_given: Any) -> str:
    """Return a page with its equations as MathML; a hook of mkdocs.

    Raises what latex2mathml raises for LaTeX that it does not know.
    """
    return _BLOCK.sub(lambda found: _displayed(found[1]), markdown)


def _displayed(latex: str) -> str:
    from latex2mathml.converter import convert  # a tool of the site alone

    equation = convert(" ".join(latex.split()), display="block")
    return f'<div class="equation" style="overflow: auto hidden; padding: .3em 0">{equation}</div>'
