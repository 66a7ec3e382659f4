"""Names of channels in German, French, Spanish, Italian and Portuguese logs, in lower case with
underscores and without accents; ae, oe and ue count as ä, ö and ü."""

from typing import Final

_WITH: Final = r"(_?(ausschlag|winkel|stellung))?"
_OF: Final = r"(velocidade?|velocita|tasa|taxa|razon|razao|rateo)_(angular[e]?_)?(de_|di_|do_)?"
_DEFLECTED: Final = r"((deflexion|deflexao|deflessione|posicion|posicao|posizione)_(del?_|do_)?)?"
_LOAD: Final = r"(factor_de_carga|fattore_di_carico|fator_de_carga|facteur_(de_)?charge)"
_ACCELERATION: Final = r"(aceleracion|aceleracao|accelerazione|acceleration)"

#: Names of `velocity_down` that are positive upwards.
CLIMBING: Final = "|".join(
    (
        r"steig(rate|geschwindigkeit)|vario(_?met(er|ro))?",
        r"vitesse_(verticale|ascensionnelle)|taux_de_montee",
        r"velocidade?_(vertical|de_(ascenso|subida))|(tasa|razon|regimen)_de_ascenso",
        r"(razao|taxa)_de_subida",
        r"velocita_(verticale|di_salita)|rateo_di_salita",
    )
)
#: Channel -> pattern of its names.
FOREIGN: Final[dict[str, str]] = {
    "V": r"(wahre_?)?(flug|luft)?geschwindigkeit|fahrt|vitesse(_air)?(_vraie)?|v_?v"
    r"|velocidade?(_del?_aire?|_do_ar)?(_verdade(ra|ira))?|velocita(_(dell_)?aria)?(_vera)?",
    "calibrated_airspeed": r"angezeigte_?(flug)?geschwindigkeit|vi|vitesse_(indiquee|corrigee)"
    r"|velocidade?_(indicada|calibrada)|velocita_(indicata|calibrata)",
    "alpha": r"anstellwinkel|incidence|angle_d_incidence|angulo_de_ataque|angolo_d(i_)?_?attacco"
    r"|angolo_d(i_)?_?incidenza|incidenza|incidencia",
    "beta": r"schiebewinkel|(angle_de_)?derapage|(angulo_de_)?(resbalamiento|derrape|derrapagem)"
    r"|(angolo_di_)?derapata",
    "phi": r"rollwinkel|hae?ngewinkel|querneigung(swinkel)?|(angle_de_)?(roulis|gite)"
    r"|(angulo_de_)?(alabeo|balanceo|rolamento|rolagem)|(angolo_di_)?(rollio|sbandamento)",
    "theta": r"nickwinkel|lae?ngsneigung(swinkel)?|(angle_de_)?tangage|assiette(_longitudinale)?"
    r"|(angulo_de_)?(cabeceo|arfagem)|(angolo_di_)?beccheggio|assetto(_longitudinale)?",
    "psi": r"gierwinkel|steuerkurs|(angle_de_)?lacet|cap(_vrai)?|(angulo_de_)?guinada|rumbo|proa"
    r"|(angolo_di_)?imbardata|prua",
    "p": rf"roll(rate|geschwindigkeit)|(vitesse|taux)_(de_)?roulis"
    rf"|{_OF}(alabeo|balanceo|rolamento|rolagem|rollio)",
    "q": rf"nick(rate|geschwindigkeit)|(vitesse|taux)_(de_)?tangage"
    rf"|{_OF}(cabeceo|arfagem|beccheggio)",
    "r": rf"gier(rate|geschwindigkeit)|(vitesse|taux)_(de_)?lacet|{_OF}(guinada|imbardata)",
    "ax_imu": rf"lae?ngsbeschleunigung|{_ACCELERATION}_longitudinale?|{_LOAD}_x",
    "ay_imu": rf"querbeschleunigung|{_ACCELERATION}_laterale?|{_LOAD}_y",
    "az_imu": rf"lastvielfaches|normalbeschleunigung|{_ACCELERATION}_normale?"
    rf"|{_LOAD}(_(z|normale?))?",
    "altitude": r"hoe?he(_?(msl|(ue?ber_)?nn))?|altitud|altura|altitudine|quota(_(msl|slm))?",
    "height_above_ground": r"hoe?he_?ue?ber_?grund|hauteur(_sol)?|radiosonde"
    r"|altura_sobre_el_(suelo|terreno)|altezza_(dal_|sul_)?suolo|altura_(do|sobre_o)_solo",
    "velocity_down": rf"sink(rate|geschwindigkeit)|{CLIMBING}",
    "velocity_north": r"v_?nord|vitesse_nord|nordgeschwindigkeit|velocidade?_norte|velocita_nord",
    "velocity_east": r"v_?(ost|est)|vitesse_est|ostgeschwindigkeit|velocidade?_[el]ste"
    r"|velocita_est",
    "latitude": r"(geogr(aphische)?_)?breite(ngrad)?|latitud(ine)?",
    "longitude": r"(geogr(aphische)?_)?lae?nge(ngrad)?|longitud(ine)?",
    "temperature": r"(aussen|luft|umgebungs)?temperatur|temperature_(exterieure|statique)"
    r"|temperatura(_(exterior|e[sx]terna|ambiente|e?statica|del_aire|(dell_)?aria|do_ar))?",
    "static_pressure": r"stati(scher_?|k)druck|luftdruck|pression_(statique|atmospherique)"
    r"|presion_(estatica|atmosferica)|pressione_(statica|atmosferica)|pressao_estatica",
    "qbar": r"staudruck|pression_dynamique|presion_dinamica|pressione_dinamica|pressao_dinamica",
    "rho": r"luftdichte|masse_volumique|densite_(de_l_)?air|densidade?(_del?_aire?|_do_ar)?"
    r"|densita(_(dell_)?aria)?",
    "mach": r"mach_?zahl|nombre_de_mach|numero_d[ei]_mach",
    "delta_elevator": rf"hoe?henruder{_WITH}|((gouverne|braquage)_(de_)?)?profondeur"
    rf"|{_DEFLECTED}((timon_de_)?profundidad|elevador|profundor|equilibratore|elevatore)",
    "delta_aileron": rf"querruder{_WITH}|((gouverne|braquage)_(de_)?)?ailerons?|gauchissement"
    rf"|{_DEFLECTED}(aleron(es)?|aileron|aletton[ei])",
    "delta_rudder": rf"seitenruder{_WITH}|(gouverne|braquage)_(de_)?direction"
    rf"|{_DEFLECTED}(timone?(_d[ei]_(direccion|direzione))?|leme)",
    "delta_flap": rf"(lande)?klappen?{_WITH}|volets?|{_DEFLECTED}(flaps?|ipersostentator[ei])",
    "thrust": r"schub|poussee|empuje|empuxo|spinta",
    "mass": r"(flug(zeug)?)?masse|gewicht|massa?|masa",
}
