"""The package `aerodb` with `flows`, `tasks` and `storage`, which are links in its folder: they lie
beside it on top level, where no user's own `tasks` or `flows` could take their place.
"""

from setuptools import find_packages, setup

setup(
    packages=find_packages(include=["aerodb", "aerodb.*"]),
    package_data={
        "": ["*.pyi", "py.typed", "*.toml", "*.mako", "templates/*", "static/*", "deploy/*"]
    },
)
