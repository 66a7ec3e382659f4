from .arrays import (
    CSV_HEAD,
    export_csv,
    export_csv_table,
    export_mat,
    export_netcdf,
    import_csv,
    import_mat,
    import_netcdf,
)
from .daveml import export_daveml, import_daveml, is_daveml
from .file_checks import FileChecks, check_file
from .input_names import propose_bindings, written_name
from .jsbsim import (
    Agreement,
    MassBalance,
    check_in_jsbsim,
    export_jsbsim,
    import_jsbsim,
    input_properties,
    jsbsim_check_cases,
    mass_balance_of,
    merge_jsbsim,
    property_expression,
)
from .native import (
    database_content_sha256,
    database_document_sha256,
    from_document,
    read_native,
    to_document,
)
from .state_terms import states_for_jsbsim, without_states

__all__ = [
    "CSV_HEAD",
    "Agreement",
    "FileChecks",
    "MassBalance",
    "check_file",
    "check_in_jsbsim",
    "database_content_sha256",
    "database_document_sha256",
    "export_csv",
    "export_csv_table",
    "export_daveml",
    "export_jsbsim",
    "export_mat",
    "export_netcdf",
    "from_document",
    "import_csv",
    "import_daveml",
    "import_jsbsim",
    "import_mat",
    "import_netcdf",
    "input_properties",
    "is_daveml",
    "jsbsim_check_cases",
    "mass_balance_of",
    "merge_jsbsim",
    "property_expression",
    "propose_bindings",
    "read_native",
    "states_for_jsbsim",
    "to_document",
    "without_states",
    "written_name",
]
