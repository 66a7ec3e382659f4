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
Codes (aero_codes) import_code      export_sitl,    none
                                    export_gazebo
Motors of Gazebo   read_motors      export_motors   none
JSBSim propellers  read_propellers  export_propellers none

Every reader takes the content of a file and returns an `aerodb.tables.AeroDatabase`; every writer
takes an AeroDatabase and returns the content of a file. No function here opens a file.

`check_file` tells whether an imported XML file gives the numbers of its own check cases.

`is_daveml` tells DAVE-ML from JSBSim XML. `database_document_sha256` identifies a database with its
expressions and texts; `database_content_sha256` covers its numbers only.

Formats without increments or state models receive plain terms: `increment_terms` writes increments
as terms, `without_states` (`state_terms`) and `states_for_jsbsim` (`jsbsim`) replace state models;
`settled_states` says which. `increment_notes` decodes the notes of documents that earlier releases
stored; `native_schema` declares the keys of the TOML file and of the stored document.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .aero_codes import (
        KnownVehicle,
        MotorModel,
        PropellerModel,
        code_of,
        differences,
        export_gazebo,
        export_motors,
        export_propellers,
        export_sitl,
        has_rotors,
        import_code,
        motor_database,
        project_gazebo,
        project_motors,
        project_propellers,
        project_sitl,
        propeller_database,
        read_motors,
        read_propellers,
    )
    from .arrays import (
        CSV_HEAD,
        csv_text,
        export_csv,
        export_csv_table,
        export_mat,
        export_netcdf,
        import_csv,
        import_mat,
        import_netcdf,
        is_own_mat,
    )
    from .daveml import export_daveml, import_daveml, is_daveml
    from .file_checks import FileChecks, check_file
    from .input_names import propose_bindings, written_name
    from .joined import in_wake, joined, on_legs, read_alone, vortex_pair_of, wake_database
    from .jsbsim import (
        JsbsimAgreement,
        MassBalance,
        check_in_jsbsim,
        export_jsbsim,
        import_jsbsim,
        input_properties,
        jsbsim_check_cases,
        mass_balance_of,
        merge_jsbsim,
        property_expression,
        states_for_jsbsim,
    )
    from .native import (
        database_content_sha256,
        database_document_sha256,
        from_document,
        read_native,
        to_document,
    )
    from .reference_pressure import over_dynamic_pressure
    from .state_terms import settled_states, without_states

__getattr__, __dir__, __all__ = attach(__name__, __file__)
