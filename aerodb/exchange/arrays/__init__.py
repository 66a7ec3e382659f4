"""Databases as arrays and texts: CSV, MAT and NetCDF.

Format   Read             Write            Module
-------  ---------------  ---------------  ------------------------------------------
CSV      `import_csv`     `export_csv`     comma_separated (a ZIP of CSV files)
         the same         `export_csv_table`  one_table (one CSV file, for pandas)
MAT      `import_mat`     `export_mat`     mat (written: version 5, read: 5-7)
NetCDF   `import_netcdf`  `export_netcdf`  netcdf (classic, 64-bit offset)

All write the same content, which `contents` makes of a database: a JSON manifest, texts,
arrays, and check cases. On import, `contents` rebuilds the database and evaluates the check cases.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .comma_separated import export_csv, import_csv
    from .csv_texts import csv_text
    from .mat import export_mat, import_mat, is_own_mat, mat_variables
    from .netcdf import export_netcdf, import_netcdf
    from .one_table import CSV_HEAD, export_csv_table

__getattr__, __dir__, __all__ = attach(__name__, __file__)
