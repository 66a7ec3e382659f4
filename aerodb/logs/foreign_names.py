"""Names of channels in German and French logs, in lower case with underscores and without accents;
ae, oe and ue count as ä, ö and ü."""

from typing import Final

_WITH: Final = r"(_?(ausschlag|winkel|stellung))?"

#: Names of `velocity_down` that are positive upwards.
CLIMBING: Final = (
    r"steig(rate|geschwindigkeit)|vario(_?meter)?|vitesse_(verticale|ascensionnelle)|taux_de_montee"
)
#: Channel -> pattern of its names.
FOREIGN: Final[dict[str, str]] = {
    "V": r"(wahre_?)?(flug|luft)?geschwindigkeit|fahrt|vitesse(_air)?(_vraie)?|v_?v",
    "calibrated_airspeed": r"angezeigte_?(flug)?geschwindigkeit|vi|vitesse_(indiquee|corrigee)",
    "alpha": r"anstellwinkel|incidence|angle_d_incidence",
    "beta": r"schiebewinkel|(angle_de_)?derapage",
    "phi": r"rollwinkel|hae?ngewinkel|querneigung(swinkel)?|(angle_de_)?(roulis|gite)",
    "theta": r"nickwinkel|lae?ngsneigung(swinkel)?|(angle_de_)?tangage|assiette(_longitudinale)?",
    "psi": r"gierwinkel|steuerkurs|(angle_de_)?lacet|cap(_vrai)?",
    "p": r"roll(rate|geschwindigkeit)|(vitesse|taux)_(de_)?roulis",
    "q": r"nick(rate|geschwindigkeit)|(vitesse|taux)_(de_)?tangage",
    "r": r"gier(rate|geschwindigkeit)|(vitesse|taux)_(de_)?lacet",
    "ax_imu": r"lae?ngsbeschleunigung|acceleration_longitudinale|facteur_(de_)?charge_x",
    "ay_imu": r"querbeschleunigung|acceleration_laterale|facteur_(de_)?charge_y",
    "az_imu": r"lastvielfaches|normalbeschleunigung|acceleration_normale"
    r"|facteur_(de_)?charge(_(z|normal))?",
    "altitude": r"hoe?he(_?(msl|(ue?ber_)?nn))?",
    "height_above_ground": r"hoe?he_?ue?ber_?grund|hauteur(_sol)?|radiosonde",
    "velocity_down": rf"sink(rate|geschwindigkeit)|{CLIMBING}",
    "velocity_north": r"v_?nord|vitesse_nord|nordgeschwindigkeit",
    "velocity_east": r"v_?(ost|est)|vitesse_est|ostgeschwindigkeit",
    "latitude": r"(geogr(aphische)?_)?breite(ngrad)?",
    "longitude": r"(geogr(aphische)?_)?lae?nge(ngrad)?",
    "temperature": r"(aussen|luft|umgebungs)?temperatur|temperature_(exterieure|statique)",
    "static_pressure": r"stati(scher_?|k)druck|luftdruck|pression_(statique|atmospherique)",
    "qbar": r"staudruck|pression_dynamique",
    "rho": r"luftdichte|masse_volumique|densite_(de_l_)?air",
    "mach": r"mach_?zahl|nombre_de_mach",
    "delta_elevator": rf"hoe?henruder{_WITH}|((gouverne|braquage)_(de_)?)?profondeur",
    "delta_aileron": rf"querruder{_WITH}|((gouverne|braquage)_(de_)?)?ailerons?|gauchissement",
    "delta_rudder": rf"seitenruder{_WITH}|(gouverne|braquage)_(de_)?direction",
    "delta_flap": rf"(lande)?klappen?{_WITH}|volets?",
    "thrust": r"schub|poussee",
    "mass": r"(flug(zeug)?)?masse|gewicht",
}
