"""Which folders are which packages: `flows`, `tasks` and `storage` stand beside `aerodb` and are
imported as parts of it.

On top level they would meet a user's own `tasks` folder or `storage.py`, and the `flows` of other
distributions.
"""

from setuptools import find_packages, setup

PARTS = ("flows", "tasks", "storage")

setup(
    packages=[
        *find_packages(include=["aerodb", "aerodb.*"]),
        *(
            f"aerodb.{name}"
            for part in PARTS
            for name in find_packages(include=[part, f"{part}.*"])
        ),
    ],
    package_dir={"aerodb": "aerodb", **{f"aerodb.{part}": part for part in PARTS}},
    package_data={
        "": ["*.pyi", "py.typed", "*.toml", "*.mako", "templates/*", "static/*", "deploy/*"]
    },
)
