"""Databases of aerodynamic codes and models of simulators, for those who have no tunnel.

`code_of` tells who wrote a file, `import_code` reads it. `avl`, `vspaero`, `datcom`, `xflr5` and
`xflr5_stability` read what these codes write, `sweep` tables of points (`sweep_tables`). `sitl` and
`gazebo` read and write models of simulators (`parametric`). `motors` makes Gazebo's motors of the
rotors of a database, and `motor_model` writes them. `propellers` makes those of JSBSim.

`runs` makes a database of totals and derivatives about points, `points` one of a grid. `controls`
finds the channel and the sign of a control surface. `answers` collects what a file leaves open, and
`lines` knows where a text is wrong.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .answers import KnownVehicle
    from .gazebo import export_gazebo, project_gazebo
    from .motor_model import export_motors, motor_database, read_motors
    from .motors import MotorModel, has_rotors, project_motors
    from .parametric import differences
    from .propellers import (
        PropellerModel,
        export_propellers,
        project_propellers,
        propeller_database,
        read_propellers,
    )
    from .recognise import code_of, import_code
    from .sitl import export_sitl, project_sitl

__getattr__, __dir__, __all__ = attach(__name__, __file__)
