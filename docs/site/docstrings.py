"""Docstrings as Markdown: sections of fields become lists, examples become code.

A field is ``name : what it is`` with indented lines behind it, where other styles have a type; what
follows a section after a blank line is text again.
"""

import re
from collections.abc import Iterator
from typing import Any

import griffe

_FIELD = re.compile(r"(\*{0,2}[A-Za-z_][\w, ]*?) :(?: (.*))?$")


class HouseStyle(griffe.Extension):
    """Turns every docstring into Markdown before it is rendered."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Change the docstring of one object."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)


def as_markdown(text: str) -> str:
    """Return a docstring as Markdown.

    >>> section = "Parameters\\n---\\nx : (n,)\\n    values."
    >>> print(as_markdown(f"Do it.\\n\\n{section}\\n\\nRaises E."))
    Do it.
    <BLANKLINE>
    **Parameters**
    <BLANKLINE>
    - **x**: (n,) values.
    <BLANKLINE>
    Raises E.
    """
    return "\n".join(_lines(text.splitlines())).strip()


def _lines(lines: list[str]) -> Iterator[str]:
    section, k = False, 0
    while k < len(lines):
        line, after = lines[k], lines[k + 1] if k + 1 < len(lines) else ""
        if line.strip() and set(after.strip()) == {"-"}:
            yield from (f"**{line.strip()}**", "")
            section, k = True, k + 2
            continue
        if line.startswith(">>> "):
            end = next((n for n in range(k, len(lines)) if not lines[n].strip()), len(lines))
            yield from ("```python", *lines[k:end], "```")
            k = end
            continue
        if not section or not line.strip():
            ends = section and not line.strip() and _FIELD.match(after) is None
            section = section and not ends
            yield line
            k += 1
            continue
        end = k + 1
        while end < len(lines) and lines[end].startswith(" "):
            end += 1
        yield _item(line, [each.strip() for each in lines[k + 1 : end]])
        k = end


def _item(line: str, further: list[str]) -> str:
    found = _FIELD.match(line)
    name, said = (found[1], found[2] or "") if found else (line.strip(), "")
    text = " ".join(each for each in (said, *further) if each)
    return f"- **{name}**: {text}" if text else f"- **{name}**"
