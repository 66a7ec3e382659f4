"""Read and write aerodynamic databases in exchange formats.

Format (package)   Read             Write           Check cases written to the file
-----------------  ---------------  --------------  -------------------------------
TOML (native)      read_native      none            none
stored document    from_document    to_document     none
DAVE-ML (daveml)   import_daveml    export_daveml   yes, checked before it is returned
JSBSim (jsbsim)    import_jsbsim    export_jsbsim   jsbsim_check_cases, check_in_jsbsim
CSV (arrays)       import_csv       export_csv      yes, checked on import
MAT (arrays)       import_mat       export_mat      yes, checked on import
NetCDF (arrays)    import_netcdf    export_netcdf   yes, checked on import

Every reader takes the content of a file and returns an `aerodb.tables.AeroDatabase`; every writer
takes an AeroDatabase and returns the content of a file. No function here opens a file.

`check_file` tells whether an imported XML file gives the numbers of its own check cases.

`is_daveml` tells DAVE-ML from JSBSim XML. `database_document_sha256` identifies a database with its
expressions and texts; `database_content_sha256` covers its numbers only.

Formats without increments or state models receive plain terms: `increment_terms` writes increments
as terms, `without_states` and `states_for_jsbsim` (in `state_terms`) replace state models.
`increment_notes` decodes the notes of documents that earlier releases stored; `native_schema`
declares the keys of the TOML file and of the stored document.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
