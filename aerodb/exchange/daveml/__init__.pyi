from .export import export_daveml
from .reader import import_daveml
from .xml_elements import is_daveml

__all__ = ["export_daveml", "import_daveml", "is_daveml"]
