from .comma_separated import export_csv, import_csv
from .mat import export_mat, import_mat
from .netcdf import export_netcdf, import_netcdf
from .one_table import CSV_HEAD, export_csv_table

__all__ = [
    "CSV_HEAD",
    "export_csv",
    "export_csv_table",
    "export_mat",
    "export_netcdf",
    "import_csv",
    "import_mat",
    "import_netcdf",
]
