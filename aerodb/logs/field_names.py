"""Which channel a field of a log is by its name, how sure that is, and what it leaves open."""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal

from aerodb.logs.foreign_names import CLIMBING, FOREIGN
from aerodb.nomenclature import CHANNELS, is_surface
from aerodb.units import is_spelled, spelled

#: Names of `velocity_down` that are positive upwards.
_UP: Final = (
    r"v_?sp(ee)?d|vertical_?speed|vvi|vs|climb(_?rate)?|rate_?of_?climb|roc"
    r"|(h|alt(itude)?|height)_?(dot|rate)"
)
#: Names of a velocity along an axis that the name leaves open.
_ALONG: Final = r"v(el(ocity)?)?_?{0}|{0}_?(speed|velocity)"
_BARO: Final = r"h_?baro|baro(metric)?_?alt(itude)?|alt(itude)?_?baro(metric)?"
_NORMAL: Final = r"(norm(al)?|vert(ical)?)"
_LOAD: Final = r"(load_?factor|g_?load(_?norma?l)?)"
_ACCELERATION: Final = r"a(cc(el|eleration)?)?"
#: Channel -> pattern of its names in logs, in lower case with underscores.
_NAMES: Final[dict[str, str]] = {
    "V": r"(true_?)?(air_?speed|k?tas|v_?tas|vtas|v_?true)|v|vt|tas_?air_?speed",
    "calibrated_airspeed": r"cas|ias|(calibrated|indicated)_?air_?speed|v_?cas|v_?ias|v_?ind|vc"
    r"|k[ic]as|k?eas|v_?eas|equivalent_?air_?speed",
    "alpha": r"alpha|aoa|alfa|angle_?of_?attack|alpha_?vane",
    "beta": r"beta|aoss?|ssa|(angle_?of_?)?side_?slip(_?angle)?|beta_?vane",
    "qbar": r"q_?bar|q_?dyn|dyn(amic)?_?press(ure)?|q_?inf|p_?dyn|impact_?pressure",
    "mach": r"mach(_?(number|no))?|ma",
    "rho": r"rho|(air_?)?density",
    "temperature": r"oat|sat|((static|outside|ambient|external)_?)?(air_?)?temp(erature)?"
    r"|t_?(amb(ient)?|oat|inf(inity)?|stat(ic)?|air|outside)",
    "static_pressure": r"ps|p_?(stat(ic)?|amb(ient)?)|static_?press(ure)?|baro_?press(ure)?",
    "p": r"p|p_?b|p_?rate|(b_?)?roll_?(rate|speed)|gyro?_?x|gx|omega_?x|wx|roll_?rt"
    r"|angular_velocity_x|(phi|roll|bank)_?dot",
    "q": r"q|q_?b|q_?rate|(b_?)?pitch_?(rate|speed)|gyro?_?y|gy|omega_?y|wy|pitch_?rt"
    r"|angular_velocity_y|(theta|pitch)_?dot",
    "r": r"r|r_?b|r_?rate|(b_?)?yaw_?(rate|speed)|gyro?_?z|gz|omega_?z|wz|yaw_?rt"
    r"|angular_velocity_z|(psi|yaw|heading)_?dot",
    "ax_imu": r"a_?x|nx|acc(el|eleration)?_?x|(b_?)?long?(itudinal)?_?acc?(el|eleration)?"
    r"|linear_acceleration_x|gload_?axial"
    rf"|{_ACCELERATION}_long?(itudinal)?",
    "ay_imu": r"a_?y|ny|acc(el|eleration)?_?y|(b_?)?lat(eral|rl)?_?acc?(el|eleration)?"
    r"|linear_acceleration_y|gload_?side"
    rf"|{_ACCELERATION}_lat(eral)?",
    "az_imu": rf"a_?z|nz|acc(el|eleration)?_?z|linear_acceleration_z|{_LOAD}"
    rf"|(b_?)?{_NORMAL}_?acc?(el|eleration)?|{_ACCELERATION}_{_NORMAL}",
    "phi": r"phi|roll|bank(_?angle)?|roll_?(angle|attitude)|euler_?roll",
    "theta": r"theta|pitch|ptch|pitch_?(angle|attitude)|euler_?pitch",
    "psi": r"psi(_?true)?|(true_?)?(yaw|head(ing)?|hd(in)?g)(_?(true|angle))?|euler_?yaw"
    r"|mag(netic)?_?(heading|hdg)|(heading|hdg)_?m(ag(netic)?)?",
    "altitude": r"(alt(itude)?|height)(_?a?(msl|sl))?|h_?msl"
    rf"|gps_?alt(itude)?|alt(itude)?_?gps|{_BARO}|h",
    "pressure_altitude": r"press(ure)?_?(alt(itude)?|height)|p_?alt|h_?p|alt(itude)?_?press(ure)?"
    r"|alt(itude)?_?(std|standard|qne)|h_?press(ure)?",
    "height_above_ground": r"agl|h_?agl|alt(itude)?_?agl|agl_?alt(itude)?|height_?above_?ground"
    r"|r(ad(io|ar)?)?_?(alt(itude)?|height)",
    "velocity_north": r"v_?n(orth)?|vel_?n(orth)?|velocity_?n(orth)?|north_?velocity"
    rf"|{_ALONG.format('x')}",
    "velocity_east": r"v_?e(ast)?|vel_?e(ast)?|velocity_?e(ast)?|east_?velocity"
    rf"|{_ALONG.format('y')}",
    "velocity_down": r"v_?d(own)?|vel_?d(own)?|velocity_?d(own)?|down_?velocity"
    rf"|sink_?rate|{_ALONG.format('z')}|{_UP}",
    "latitude": r"lat(itude)?|gps_?lat(itude)?",
    "longitude": r"lon(g|gitude)?|gps_?lon(g|gitude)?|lng",
    "delta_elevator": r"(delta_?)?(elevator|elev|ele)(_?(pos|position|deflection|angle))?|de|d_?e"
    r"|delta_?e|dele|d_?elev",
    "delta_aileron": r"(delta_?)?(aileron|ail|ailrn)(_?(pos|position|deflection|angle))?|da|d_?a"
    r"|delta_?a|dela|d_?ail",
    "delta_rudder": r"(delta_?)?(rudder|rud|ruddr)(_?(pos|position|deflection|angle))?|dr|d_?r"
    r"|delta_?r|delr|d_?rud",
    "delta_flap": r"(delta_?)?flaps?(_?(pos|position|deflection|angle))?|df|d_?f|delta_?f",
    "thrust": r"thrust|total_?thrust",
    "mass": r"mass|aircraft_?mass|gross_?(mass|weight)",
}
#: Words beside which a name is not that of the channel.
_OTHERS: Final = frozenset(
    {
        *("target", "tgt", "trgt", "desired", "des", "demand", "demanded", "dem", "cmd", "command"),
        *("commanded", "setpoint", "sp", "set", "ref", "reference", "goal", "wanted", "req"),
        *("requested", "selected", "sel", "bug", "nav", "home", "origin", "launch", "takeoff"),
        *("waypoint", "wp", "bat", "batt", "battery", "oil", "fuel", "wind", "wnd", "pid", "ap"),
        *("engine", "eng", "motor", "esc", "prop", "servo", "rc", "stick", "pilot", "trim", "hyd"),
        *("error", "err", "limit", "min", "max", "std", "sigma", "var", "variance", "cov", "bias"),
        *("offset", "innov", "innovation", "test", "ratio", "mag", "magnetometer", "cabin"),
        *(
            "board",
            "board_temp",
            "ground",
            "gnd",
            "gs",
            "track",
            "trk",
            "course",
            "count",
            "status",
        ),
        *(
            "valid",
            "flag",
            "health",
            "quality",
            "qnh",
            "density_altitude",
            "accuracy",
            "hacc",
            "vacc",
        ),
        *("gimbal", "camera", "mount", "autopilot", "fd", "director", "ils", "egt", "cht", "tit"),
        *("i", "ff", "gain", "cpu", "term", "soll", "sollwert", "consigne", "vent", "huile"),
        *("viento", "vento", "suelo", "suolo", "solo", "aceite", "olio", "oleo", "bateria"),
        *("batteria", "motore", "combustible", "carburante", "deseado", "deseada", "consigna"),
        *("desiderato", "desiderata", "desejado", "comandado", "comandato", "comandata"),
        *("objetivo", "obiettivo", "referencia", "riferimento", "despegue", "decollo"),
        *(
            "appgps",
            "phone",
            "app",
            "weather",
            "param",
            "controller",
        ),
        *("gust", "turbulence", "downwash", "upwash", "induced", "stall", "tail", "rotor", "blade"),
        *("tip", "hub", "throat", "nozzle", "inlet", "duct", "propeller", "collective", "cyclic"),
        *("cam", "turret", "antenna", "payload", "trailer", "deck", "ship", "carrier", "runway"),
        *("rwy", "sun", "head", "intruder", "traffic", "leader", "lead", "dest", "destination"),
        *("poi", "base", "map", "point", "center", "centre", "beacon", "vor", "adf", "ndb", "dme"),
        *("geoid", "undulation", "terrain", "terr", "decision", "dh", "mda", "obstacle", "tree"),
        *("wave", "cloud", "ceiling", "transition", "rtl", "loiter", "fence", "safe", "cruise"),
        *("flare", "eye", "stop", "tank", "gear", "wheel", "tyre", "tire", "brake", "brakes"),
        *("tunnel", "ice", "slosh", "ballast", "empty", "dry", "drag", "hinge", "tab", "pedal"),
        *("initial", "init", "start", "final", "end", "expected", "predicted"),
        *("jerk", "quat", "quaternion", "residual", "noise", "threshold", "coeff"),
        *("coef", "coefficient", "derivative", "slope", "freq", "frequency", "amplitude"),
    }
)
#: Words of coefficients, whose derivatives are named after channels: ``C_m_alpha``, ``CL_q``.
_COEFFICIENT: Final = re.compile(r"c[^g]?")
#: Words of changes: of these, only deflections of surfaces are channels.
_CHANGES: Final = frozenset({"delta", "del", "d", "diff", "change"})
#: What changes and is no surface: ``delta_angle_x`` of an IMU, ``delta_t``.
_CHANGING: Final = frozenset(
    {
        *("angle", "angles", "velocity", "vel", "speed", "time", "t", "dt", "temp", "ang"),
        *(
            "press",
            "pressure",
            "gear",
            "range",
            "distance",
            "dist",
            "pos",
            "position",
            "throttle",
            "thr",
            "th",
            "rpm",
        ),
        *("power", "energy", "momentum", "voltage", "current", "count", "x", "y", "z", "fuel"),
        *("cg", "weight", "force", "moment", "cl", "cd", "cm", "cn", "cy", "lift", "drag", "ias"),
    }
)
#: Names of changes that some use for deflections.
_COMMANDED: Final = frozenset({"roll", "pitch", "yaw", *"hpqrv"})
#: Channel -> words that may stand before its name, which is one of many things without them.
_BEFORE: Final[dict[str, frozenset[str]]] = {
    "temperature": frozenset(
        {
            *("air", "oat", "sat", "ext", "exterior", "external", "outside", "ambient", "amb"),
            *("static", "atm", "atmosphere", "atmospheric", "freestream", "free", "stream"),
            *("probe", "sensor"),
        }
    ),
    "altitude": frozenset(
        {
            *("gps", "gnss", "baro", "barometric", "mean", "sea", "level", "msl", "amsl", "true"),
            *("geometric", "geo", "aircraft", "ac", "ins", "ekf", "ahrs", "imu", "nav", "fused"),
            *("estimated", "filtered", "rel", "relative", "global", "local", "sim", "plane", "uav"),
            *("vehicle", "dgps", "rtk", "adc", "indicated", "ind", "ellipsoid", "wgs84", "pos"),
            *("position",),
        }
    ),
    "mass": frozenset({"aircraft", "ac", "total", "gross", "vehicle", "plane", "uav", "all_up"}),
    "thrust": frozenset({"total", "net", "gross", "aircraft", "estimated", "est", "installed"}),
}
#: Words that leave every quantity what it is.
_AS_RECORDED: Final = frozenset(
    {
        *("filtered", "filt", "corr", "corrected", "raw", "meas", "measured", "est", "estimated"),
        *("mean", "avg", "average", "smoothed", "value", "val", "0", "1", "2"),
    }
)
#: Words behind a name that leave it what it is.
_BEHIND: Final = frozenset(
    {
        *_AS_RECORDED,
        *("ekf", "ins", "imu", "ahrs", "adc", "boom", "vane", "body", "b", "true", "surf", "cg"),
    }
)
#: Names that leave something open -> what is to be answered.
_OPEN: Final[tuple[tuple[str, str, str], ...]] = (
    ("V", r"air_?speed|speed", "is it true or indicated airspeed?"),
    ("V", r"v", "is it airspeed, or a component of velocity, or a voltage?"),
    ("altitude", r"h|alt(itude)?|height", "above sea level, or above the ground or a take-off?"),
    (
        "altitude",
        _BARO,
        "by which setting: sea level's, the standard (pressure_altitude), or zero at take-off?",
    ),
    *((k, r"[a-z]+_?dot", "is it a rate about a body axis, or of the Euler angle?") for k in "pqr"),
    ("az_imu", r".*vert(ical)?.*", "along the body, or vertical over the earth?"),
    ("temperature", r"(air_?)?temp(erature)?", "is it that of the outside air?"),
    ("psi", r"head(ing)?|hdg|hding", "is it true or magnetic?"),
    *((k, r"g[xyz]", "is it a rate, or the bias of a gyro, or a load in g?") for k in "pqr"),
    ("velocity_down", r"vs", "is it the rate of climb?"),
    ("velocity_down", r"vario(_?met(er|ro))?", "is it the rate of climb, or that of total energy?"),
    ("pressure_altitude", r"h_?p", "is it pressure altitude?"),
    ("height_above_ground", r"r(ad(io|ar)?)?_?(alt(itude)?|height)", "is it above the ground?"),
    ("mass", r"gross_?weight|gewicht", "is it a mass?"),
    (
        "qbar",
        r"impact_?pressure",
        "dynamic pressure is less by a quarter of the Mach number squared",
    ),
    ("V", r"(flug)?geschwindigkeit|fahrt|vitesse(_air)?", "is it true or indicated airspeed?"),
    ("V", r"v_?v", "is it true airspeed, or a vertical velocity?"),
    ("altitude", r"hoe?he", "above sea level, or above the ground or a take-off?"),
    ("temperature", r"temperatur", "is it that of the outside air?"),
    ("psi", r"cap|steuerkurs|rumbo|prua|proa", "is it true or magnetic?"),
    ("V", r"velocidade?(_del?_aire?|_do_ar)?|velocita(_(dell_)?aria)?", "is it true or indicated?"),
    ("altitude", r"altitud(ine)?|altura|quota", "above sea level, or above a take-off?"),
    ("temperature", r"temperatura", "is it that of the outside air?"),
    ("velocity_north", _ALONG.format("x"), "is x north? It may be an axis of the body"),
    ("velocity_east", _ALONG.format("y"), "is y east? It may be an axis of the body"),
    ("velocity_down", _ALONG.format("z"), "is z down? It may be up"),
)
#: Ending of a name -> unit, beside those of `aerodb.units`; single letters that end other names too
#: are not among them.
_ENDINGS: Final = {
    **{u: u for u in ("deg", "rad", "m", "ft", "kg", "g", "lbf", "lb", "slug", "s", "ms", "us")},
    **{"ns": "ns", "dps": "deg/s", "degs": "deg/s", "deg_s": "deg/s", "rad_s": "rad/s"},
    **{"rads": "rad/s", "mps": "m/s", "m_s": "m/s", "kn": "knot", "kts": "knot", "kt": "knot"},
    **{"knots": "knot", "ktas": "knot", "kias": "knot", "kcas": "knot", "fps": "ft/s"},
    **{"ft_s": "ft/s", "ft_min": "ft/min", "fpm": "ft/min", "kmh": "km/h", "kph": "km/h"},
    **{"km_h": "km/h", "mph": "mile/hour", "mps2": "m/s^2", "m_s2": "m/s^2", "m_s_s": "m/s^2"},
    **{"fps2": "ft/s^2", "ft_s2": "ft/s^2", "deg_sec": "deg/s", "rad_sec": "rad/s"},
    **{"degree": "deg", "degrees": "deg", "radians": "rad", "feet": "ft", "meter": "m"},
    **{"meters": "m", "psf": "psf", "pa": "Pa", "hpa": "hPa", "kpa": "kPa", "mbar": "mbar"},
    **{"inhg": "inHg", "degc": "degC", "deg_c": "degC", "celsius": "degC", "kelvin": "K"},
    **{"sec": "s", "seconds": "s", "usec": "us", "msec": "ms", "min": "minute", "newton": "N"},
    **{"deg/s": "deg/s", "rad/s": "rad/s", "m/s": "m/s", "ft/s": "ft/s", "m/s^2": "m/s^2"},
    **{"m/s2": "m/s^2", "cdeg": "cdeg", "mrad": "mrad", "cdeg_s": "cdeg/s", "mrad_s": "mrad/s"},
    **{"cm": "cm", "mm": "mm", "cm_s": "cm/s", "km": "km", "degf": "degF", "psi": "psi"},
    **{"kg_m3": "kg/m^3", "slug_ft3": "slug/ft^3", "lbf_ft2": "psf", "grad": "deg"},
}
#: Of what minutes are; of another quantity ``_min`` is its minimum.
_TIMED: Final = re.compile(r"(^|_)(t|time|clock|elapsed|duration|zeit|temps|tiempo|tempo|utc)$")
#: A path of words without a slash before it, as X-Plane writes (``sim/flightmodel/position/P``);
#: units have no word of three letters before a slash.
_PATH: Final = re.compile(r"\w{3,}(/\w{3,})+/[\w\[\]. -]+")
#: Letters -> their names; a dot above is a derivative.
_GREEK: Final = {
    **{"α": "alpha", "β": "beta", "δ": "delta_", "θ": "theta", "ϑ": "theta", "Θ": "theta"},
    **{"ρ": "rho", "φ": "phi", "ϕ": "phi", "Φ": "phi", "ψ": "psi", "Ψ": "psi", "ß": "ss"},
}
#: Specific forces of other logs are those that an accelerometer measured.
_AT_CG: Final = {"ax", "ay", "az"}
_INDEX: Final = re.compile(r"\d+(,\d+)*|[xyzXYZ]|")


@dataclass(frozen=True)
class Named:
    """A channel that a name is of.

    how : ``exact`` (the channel's own name), ``synonym``, ``part`` (only after words before or
    behind it are left out). unit : that the name states, '' for none. open : what the name leaves
    open, '' for nothing. sign : -1 for a name that counts against the channel.
    """

    channel: str
    how: Literal["exact", "synonym", "part"]
    unit: str
    open: str = ""
    sign: float = 1.0


def plain_name(field: str) -> tuple[str, str]:
    """Return the name of a field in lower case without its unit, and that unit, '' where it states
    none. A number or an axis in brackets is an index.

    >>> plain_name("AoA [deg]"), plain_name("airspeed_kts"), plain_name("data.angleOfAttack")
    (('aoa', 'deg'), ('airspeed', 'knot'), ('angle_of_attack', ''))
    """
    words, unit = _words(field)
    if not unit:
        for end in sorted(_ENDINGS, key=len, reverse=True):
            before = words.removesuffix(f"_{end}")
            if before != words and (end != "min" or _TIMED.search(before)):
                return before, _ENDINGS[end]
    return words, unit


def _words(field: str) -> tuple[str, str]:
    """The words of a name, and the unit in its last brackets."""
    bracket = re.search(r"[\[(]([^\])]*)[\])]\s*$", field)
    is_unit = bracket is not None and not _INDEX.fullmatch(bracket[1].strip())
    short = field[: bracket.start()] if bracket and is_unit else field
    stated = bracket[1].strip() if bracket and is_unit else ""
    parts = _parts(short)
    last = parts[-1].strip() if parts else short
    if len(parts) > 1 and re.fullmatch(r"[xyzXYZ]|\d+", last):
        last = f"{parts[-2]}_{last}"
    return _lower(last), spelled(stated) if stated and is_spelled(stated) else ""


def _parts(field: str) -> list[str]:
    """The parts of a path; DatCon writes behind a name whether it is computed."""
    path = re.sub(r"(?<=.):[CD]$", "", field)
    slashes = "/" in path[:1] or _PATH.fullmatch(path)
    return [each for each in re.split(r"[.:/]" if slashes else r"[.:]", path) if each]


def _lower(name: str) -> str:
    """A name in lower case with underscores, Greek letters by their names, accents left out."""
    spelled_out = "".join(_GREEK.get(each, each) for each in name)
    plain = unicodedata.normalize("NFKD", spelled_out).replace("\u0307", "_dot")
    plain = "".join(each for each in plain if not unicodedata.combining(each))
    plain = re.sub(r"(?<=[_ ])(kPa|hPa|inHg|deg[CF])$", lambda unit: unit[0].lower(), plain)
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z][a-z]|(?:US|MS)$)", "_", plain).lower()
    return re.sub(r"[^a-z0-9/^]+", "_", plain).strip("_")


def named(field: str, stated: str = "") -> Named | None:
    """Return the channel that a name is of; None for none.

    stated : the unit that the log states beside the name, as written: ``KIAS`` and ``ft agl`` also
    tell the quantity. What stands on a path of other things, such as ``HOME.latitude``, is a part.
    """
    meant = _own_name(field, stated)
    above = {word for part in _parts(field)[:-1] for word in _lower(part).split("_")}
    if meant is not None and _OTHERS.intersection(above):
        return replace(meant, how="part")
    return meant


def _own_name(field: str, stated: str) -> Named | None:
    """The channel of a name, whatever path it stands on."""
    if field in CHANNELS and field not in _AT_CG:
        if field == "time":
            return None
        return Named(field, "exact", "", _left_open(field, field) if field != "V" else "")
    if is_surface(field) and _known(_bare(plain_name(field)[0])) in (None, field):
        return _deflection(field)
    whole, bracket = _words(field)
    short, unit = plain_name(field)
    unit = bracket or unit
    for words, own in ((whole, bracket), (short, unit)):
        if (known := _known(words)) is not None:
            return _meant(known, words, own, "synonym", f"{stated} {field}")
    celsius = re.fullmatch(r"(.+)_([cfk])", short)
    if celsius is not None and _known(celsius[1]) == "temperature":
        unit = {"c": "degC", "f": "degF", "k": "K"}[celsius[2]]
        return _meant("temperature", celsius[1], unit, "synonym", f"{stated} {field}")
    index = re.fullmatch(r"(.*?)(\[[012]\]|\([123]\))", field.strip())
    if index is not None:
        axis = "xyz"[int(index[2][1]) - (index[2][0] == "(")]
        if (known := _known(f"{_words(index[1])[0]}_{axis}")) is not None:
            return Named(known, "part", "", f"is index {index[2]} the axis {axis}?")
    return _part(field, short.split("_"), unit, stated)


def _bare(words: str) -> str:
    """A name without what stands behind it."""
    tokens = words.split("_")
    while len(tokens) > 1 and tokens[-1] in _BEHIND:
        tokens.pop()
    return "_".join(tokens)


def _deflection(field: str) -> Named | None:
    """The surface of a name such as ``delta_canard``; None for the change of another quantity."""
    of = plain_name(field)[0].removeprefix("delta_")
    if of in _COMMANDED:
        return Named(field, "part", "", "is it the deflection of a control surface?")
    known = _known(of)
    if _CHANGING.intersection(of.split("_")) or (known is not None and not is_surface(known)):
        return None
    return Named(field, "exact", "")


def _part(field: str, tokens: list[str], unit: str, stated: str) -> Named | None:
    """The channel of a name by some of its words (`tokens`), where the others allow it."""
    if _OTHERS.intersection(tokens):
        return None
    behind: list[str] = []
    while len(tokens) > 1 and tokens[-1] in _BEHIND:
        behind.append(tokens.pop())
        words = "_".join(tokens)
        known = _known(words)
        if known is not None and _may_stand(known, behind, ()):
            counted = len(words) == 1 and behind[-1].isdigit()  # as in a quaternion, q[0] to q[3]
            return None if counted else _meant(known, words, unit, "part", f"{stated} {field}")
    for first in range(1, len(tokens)):
        words = "_".join(tokens[first:])
        known = _known(words)
        if known is not None and (len(words) > 1 or stated or unit):
            if not _may_stand(known, behind, tokens[:first]):
                return None
            return _meant(known, words, unit, "part", f"{stated} {field}")
    return None


def _may_stand(known: str, behind: Iterable[str], before: Iterable[str]) -> bool:
    """Whether a name of a channel remains one with words behind and before it."""
    if any(_COEFFICIENT.fullmatch(word) for word in before):
        return False
    if not is_surface(known) and _CHANGES.intersection(before):
        return False
    allowed = _BEFORE.get(known)
    return allowed is None or {*behind, *before} <= allowed | _AS_RECORDED


def _known(words: str) -> str | None:
    for names in (_NAMES, FOREIGN):
        for known, pattern in names.items():
            if re.fullmatch(pattern, words):
                return known
    return None


def _meant(
    known: str, words: str, unit: str, how: Literal["synonym", "part"], written: str
) -> Named | None:
    """The channel of a name, as what is written of its unit tells the quantity."""
    text = written.lower()
    if known in ("V", "calibrated_airspeed"):
        unit = unit or ("knot" if re.fullmatch(r"k[tice]as", words) else "")
        if re.search(r"\bk?gs\b|kgs", text):
            return None
        if re.search(r"k?[ic]as\b", text):
            known = "calibrated_airspeed"
        elif re.search(r"(k|m)?tas\b|true", text):
            return Named("V", how, unit)
        elif re.search(r"k?eas\b", text):
            return Named("calibrated_airspeed", how, unit, "equivalent airspeed is not calibrated")
    if known == "altitude" and re.search(r"agl\b", text):
        return Named("height_above_ground", how, unit)
    if known == "altitude" and re.search(r"m?sl\b|gps", text):
        return Named(known, how, unit)
    if known == "psi" and re.search(r"mag|(heading|hdg)[_ ]?m\b", text):
        return Named(known, how, unit, "it is magnetic: true heading differs by the declination")
    if known == "psi" and "true" in text:
        return Named(known, how, unit)
    open_ = _left_open(known, words)
    up = known == "velocity_down" and re.fullmatch(f"{_UP}|{CLIMBING}", words) is not None
    return Named(known, how, unit, open_, -1.0 if up else 1.0)


def _left_open(known: str, words: str) -> str:
    return next((ask for k, p, ask in _OPEN if k == known and re.fullmatch(p, words)), "")
