"""Words for people: `tests.support.prose` finds what is too long and what only we understand."""

from collections import Counter
from pathlib import Path

from tests.support import prose

LONG = " ".join(["word"] * (prose.LONGEST + 1))


def kinds(path: str, texts) -> list[tuple[int, str]]:
    """Line and kind of each fault."""
    return [(fault.line, fault.kind) for fault in prose.faults(path, texts)]


def test_a_long_sentence_is_found_in_each_kind_of_file() -> None:
    python = f'"""{LONG}"""\nraise InputError(\n    f"{LONG[:60]} {{x}}, "\n    "{LONG[60:]}"\n)\n'
    assert kinds("a.py", prose.of_python(python)) == [(3, prose.LONG)]
    assert not kinds(
        "a.py", prose.of_python(python.replace("word, ", "word. ").replace("{x},", "{x}."))
    )
    template = f"<p>Short.</p>\n<p>{LONG[:50]}<b>{{{{ one }}}}</b>{LONG[50:]}</p>"
    assert kinds("a.html", prose.of_template(template)) == [(2, prose.LONG)]
    assert not kinds("a.html", prose.of_template(template.replace("<b>", "{% else %}")))
    document = f"# Title\n\n```\n{LONG}\n```\n\n- Short.\n- {LONG[:60]}\n  {LONG[60:]}\n"
    assert kinds("a.md", prose.of_document(document)) == [(8, prose.LONG)]


def test_the_help_of_a_command_is_read_and_a_docstring_is_not() -> None:
    function = f'def inputs():\n    """{LONG}"""\n'
    assert not kinds("a.py", prose.of_python(function))
    assert kinds("a.py", prose.of_python(f'@app.command("inputs")\n{function}')) == [
        (3, prose.LONG)
    ]


def test_private_words_are_found_in_what_people_read() -> None:
    (fault,) = prose.faults("a.py", prose.of_python('note = f"{n} manoeuvres voted, too few"\n'))
    assert str(fault) == ("a.py:1: say the estimate of a flight: {} manoeuvres voted, too few")
    assert not kinds("a.py", prose.of_python('names = ["votes", "gram"]\n'))
    assert not kinds("a.md", prose.of_document("The JSON has `votes` of each flight.\n"))
    assert not kinds("docs/method/a.md", prose.of_document("Every flight has one vote here.\n"))


def test_code_and_quantities_are_one_word_each() -> None:
    assert prose.words("Run `aerodb flight list --json` at 12.5 +- 0.3 m/s.") == 4
    assert [each for _, each in prose.sentences("It is 2.5 m, e.g. here. Next one.")] == [
        "It is 2.5 m, e.g. here. ",
        "Next one.",
    ]


def test_every_kind_of_file_is_read() -> None:
    texts = {path: list(found) for path, found in prose.read()}
    kinds = Counter(Path(path).suffix for path in texts)
    assert min(kinds[".py"], kinds[".html"], kinds[".md"]) > 20
    for path in ("flows/cli/databases.py", "flows/web/templates/promote.html", "README.md"):
        assert texts[path], path
