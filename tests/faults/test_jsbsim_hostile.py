"""Malicious files are refused quickly with an InputError (exit code 3).

Nothing else is opened or fetched.
"""

from pathlib import Path

import pytest

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.reader import import_jsbsim
from tests.aerodb.exchange.test_jsbsim_import import METRICS, function
from tests.support.command import aerodb
from tests.support.small_glider import write_files

BOMB = "".join(f'<!ENTITY b{k} "{f"&b{k - 1};" * 10}">' for k in range(1, 10))


def aircraft(aerodynamics: str, before: str = "") -> bytes:
    return f"{before}<fdm_config>{METRICS}<aerodynamics>{aerodynamics}</aerodynamics></fdm_config>".encode()


def nested(tag: str, levels: int) -> str:
    return function(f"<{tag}>" * levels + "<v>1</v>" + f"</{tag}>" * levels)


def many(count: int, text: str) -> str:
    return "".join(text.format(k) for k in range(count))


HOSTILE = {
    "entity bomb": aircraft(function("<v>&b9;</v>"), f'<!DOCTYPE a [<!ENTITY b0 "1">{BOMB}]>'),
    "entity bomb in an attribute": aircraft(
        '<axis name="&b9;"/>', f'<!DOCTYPE a [<!ENTITY b0 "1">{BOMB}]>'
    ),
    "external entity": aircraft(
        function("<v>&x;</v>"), '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    ),
    "parameter entity": aircraft(
        "", '<!DOCTYPE a [<!ENTITY % x SYSTEM "http://localhost:1/x.dtd"> %x;]>'
    ),
    "document type in UTF-16": (
        ('<!DOCTYPE a [<!ENTITY b "1">]>' + aircraft(function("<v>&b;</v>")).decode()).encode(
            "utf-16"
        )
    ),
    "document type in UTF-32": (
        ('<!DOCTYPE a [<!ENTITY b "1">]>' + aircraft(function("<v>&b;</v>")).decode()).encode(
            "utf-32"
        )
    ),
    "attribute of 9 MB": aircraft(f'<axis name="{"A" * 9_000_000}"/>'),
    "attribute of 11 MB": aircraft(f'<axis name="{"A" * 11_000_000}"/>'),
    "attribute's name of 9 MB": aircraft(f'<axis {"A" * 9_000_000}="1"/>'),
    "element's name of 9 MB": aircraft(f"<{'A' * 9_000_000}/>"),
    "property of 9 MB": aircraft(function(f"<property>{'a' * 9_000_000}</property>")),
    "number of 9 MB": aircraft(function(f"<v>{'1' * 9_000_000}x</v>")),
    "table of one word of 9 MB": aircraft(
        function(
            f"<table><independentVar>aero/alpha-rad</independentVar><tableData>{'a' * 9_000_000}</tableData></table>"
        )
    ),
    "100,000 levels": aircraft(nested("abs", 100_000)),
    "240 levels": aircraft(nested("abs", 240)),
    "sum of 100,000": aircraft(function(f"<sum>{many(100_000, '<v>1</v>')}</sum>")),
    "sum of 100,000 in an interpolation": aircraft(
        function(
            f"<interpolate1d><sum>{many(100_000, '<v>1</v>')}</sum>{'<v>1</v>' * 4}</interpolate1d>"
        )
    ),
    "100,000 terms": aircraft(
        '<axis name="Z">' + many(100_000, '<function name="f{}"><v>1</v></function>') + "</axis>"
    ),
    "5,000 terms that shift": aircraft(
        '<aero_ref_pt_shift_x><function name="s"><v>1</v></function></aero_ref_pt_shift_x><axis'
        ' name="Z">' + many(5_000, '<function name="f{}"><v>1</v></function>') + "</axis>"
    ),
    "functions that need each other": aircraft(
        '<function name="a"><p>b</p></function><function name="b"><p>a</p></function>'
        + function("<p>a</p>")
    ),
    "2,000 functions in a chain": aircraft(
        "".join(f'<function name="d{k}"><p>d{k + 1}</p></function>' for k in range(2_000))
        + function("<p>d0</p>")
    ),
    "infinite number": aircraft(function("<v>1e999</v>")),
    "code for a number": aircraft(function("<v>__import__('os').system('true')</v>")),
    "code as an operation": aircraft(function("<exec>import os</exec>")),
    "20 MB and one": b" " * 20_000_001,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_file_is_refused(name: str) -> None:
    with pytest.raises(InputError) as refused:
        import_jsbsim(HOSTILE[name], name="hostile.xml")
    assert "hostile.xml" in str(refused.value)
    assert len(str(refused.value)) < 1500


def test_slices_that_grow_on_their_union_are_refused() -> None:
    """Planes of a table on breakpoints of their own: a file of 1 MB would hold 10^9 numbers."""
    planes = "".join(
        f'<tableData breakPoint="{k}">\n {" ".join(f"{k + j / 50}" for j in range(40))}\n'
        + "\n".join(f"{k + i / 50} {'1 ' * 40}" for i in range(40))
        + "\n</tableData>"
        for k in range(300)
    )
    lookups = "".join(
        f'<independentVar lookup="{each}">aero/{name}</independentVar>'
        for each, name in (("row", "alpha-rad"), ("column", "beta-rad"), ("table", "alpha-deg"))
    )
    with pytest.raises(InputError, match="slices of a table on different breakpoints"):
        import_jsbsim(aircraft(function(f"<table>{lookups}{planes}</table>")), name="hostile.xml")


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "alpha.__class__",
        "lambda: 0",
        "alpha if beta else 1",
        "a;b",
    ],
)
def test_code_in_a_binding_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="binding of fcs/flap-pos-norm"):
        import_jsbsim(
            aircraft(function("<p>fcs/flap-pos-norm</p>")),
            name="a.xml",
            bindings={"fcs/flap-pos-norm": text},
        )


def test_a_property_that_looks_like_code_is_a_name() -> None:
    database = import_jsbsim(aircraft(function("<p>__import__('os')/system</p>")), name="a.xml")
    assert list(database.free_inputs) == ["__import____os___system"]


def test_the_command_refuses_with_exit_code_3(tmp_path: Path) -> None:
    write_files(tmp_path)
    workspace, file = tmp_path / "workspace", tmp_path / "bomb.xml"
    file.write_bytes(HOSTILE["entity bomb"])
    assert aerodb(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml")).returncode == 0
    result = aerodb(workspace, "database", "import", str(file), "--vehicle", "small-glider")
    assert (result.returncode, "document type" in result.stderr) == (3, True), result.stderr
    assert "Traceback" not in result.stderr
