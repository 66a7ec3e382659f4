from .comma_separated import export_csv, import_csv
from .mat import export_mat, import_mat
from .netcdf import export_netcdf, import_netcdf

__all__ = ["export_csv", "export_mat", "export_netcdf", "import_csv", "import_mat", "import_netcdf"]
