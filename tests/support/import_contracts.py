"""What `lint-imports` checks beside its own kinds of contracts."""

from typing import Any

from importlinter import Contract, ContractCheck, fields, output


class Faces(Contract):
    """Modules of a package are imported from within it; all others import what its face hands on.

    floors : packages that only hold packages; each of these has a face of its own. open_packages :
    packages without a face, whose modules anybody may import.
    """

    floors = fields.SetField(subfield=fields.StringField())
    open_packages = fields.SetField(subfield=fields.StringField())

    def check(self, graph: Any, verbose: bool) -> ContractCheck:
        """Whether no import passes a face by."""
        own = {m for m in graph.modules if not graph.is_module_squashed(m)}
        packages = {module for module in own if graph.find_children(module)}
        closed = packages - set(self.floors)
        closed = {p for p in closed if not any(_holds(o, p) for o in self.open_packages)}
        passed = [
            (importer, imported)
            for imported in sorted(own)
            for importer in sorted(graph.find_modules_that_directly_import(imported))
            if any(
                _holds(package, imported)
                and not _holds(package, importer)
                and not _holds(importer, package)  # a face hands on what its packages have
                and not _by_face(graph, importer, imported, package)
                for package in closed
            )
        ]
        return ContractCheck(kept=not passed, metadata={"passed": passed})

    def render_broken_contract(self, check: ContractCheck) -> None:
        """Says which import passes which face by."""
        for importer, imported in check.metadata["passed"]:
            output.print_error(f"{importer} imports {imported}: import from its package's face")


def _holds(package: str, module: str) -> bool:
    return module == package or module.startswith(f"{package}.")


def _by_face(graph: Any, importer: str, imported: str, package: str) -> bool:
    """Whether every import names the package itself: what it takes then may be a module of it."""
    if imported == package:
        return True
    lines = [
        each["line_contents"]
        for each in graph.get_import_details(importer=importer, imported=imported)
    ]
    return all(line.lstrip().startswith(f"from {package} import ") for line in lines)
