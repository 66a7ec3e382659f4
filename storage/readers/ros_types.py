"""Fields of the common message types of ROS 2, for bags that hold no definitions.

Bags in SQLite name the types of their messages; definitions are in them since the release Iron.
Fields and their order are those of the packages std_msgs, geometry_msgs, sensor_msgs and nav_msgs
(REP 103, REP 145; docs.ros.org), which have not changed since the first release.
"""

from typing import Final

_SEPARATOR: Final = "\n" + "=" * 80 + "\nMSG: "
_HEADER: Final = "std_msgs/Header header"
_PLAIN: Final = {
    "Bool": "bool", "Byte": "byte", "Float32": "float32", "Float64": "float64",
    "Int8": "int8", "Int16": "int16", "Int32": "int32", "Int64": "int64",
    "UInt8": "uint8", "UInt16": "uint16", "UInt32": "uint32", "UInt64": "uint64",
}  # fmt: skip
_THREE: Final = "float64 x\nfloat64 y\nfloat64 z"
_GEOMETRY: Final = {
    "Vector3": _THREE,
    "Point": _THREE,
    "Quaternion": f"{_THREE}\nfloat64 w",
    "Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "Accel": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    **{
        f"{name}WithCovariance": f"geometry_msgs/{name} {name.lower()}\nfloat64[36] covariance"
        for name in ("Pose", "Twist", "Accel")
    },
}
#: Name of the field of a type with a header, where it is not that of the type in lower case.
_FIELDS: Final = {"Vector3": "vector"}
_SENSORS: Final = {
    "Imu": "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    "NavSatFix": "sensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
    "float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type",
    "FluidPressure": "float64 fluid_pressure\nfloat64 variance",
    "Temperature": "float64 temperature\nfloat64 variance",
    "RelativeHumidity": "float64 relative_humidity\nfloat64 variance",
    "MagneticField": "geometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance",
    "JointState": "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
}
_TYPES: Final[dict[str, str]] = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    **{f"std_msgs/{name}": f"{kind} data" for name, kind in _PLAIN.items()},
    **{f"geometry_msgs/{name}": text for name, text in _GEOMETRY.items()},
    **{
        f"geometry_msgs/{name}Stamped": f"{_HEADER}\ngeometry_msgs/{name}"
        f" {_FIELDS.get(name, name.removesuffix('WithCovariance').lower())}"
        for name in _GEOMETRY
    },
    **{f"sensor_msgs/{name}": f"{_HEADER}\n{text}" for name, text in _SENSORS.items()},
    "sensor_msgs/NavSatStatus": "int8 status\nuint16 service",
    "nav_msgs/Odometry": f"{_HEADER}\nstring child_frame_id\n"
    "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist",
}


def definition_of(kind: str) -> str | None:
    """Return the definition of a message type with those of all types in it; None for a type that
    is not among them.

    >>> definition_of("std_msgs/msg/Float64"), definition_of("px4_msgs/msg/VehicleStatus")
    ('float64 data', None)
    """
    name = kind.replace("/msg/", "/")
    if name not in _TYPES:
        return None
    texts, queue = {name: _TYPES[name]}, [name]
    while queue:
        for line in _TYPES[queue.pop()].splitlines():
            inner = line.split()[0]
            if inner in _TYPES and inner not in texts:
                texts[inner] = _TYPES[inner]
                queue.append(inner)
    first, *others = texts.items()
    return first[1] + "".join(f"{_SEPARATOR}{other}\n{text}" for other, text in others)
