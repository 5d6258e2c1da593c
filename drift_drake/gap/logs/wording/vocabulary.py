"""The words of a column's name, and what they speak of, in English, German and French (some in other languages).

Accents are left out; German umlauts stand with and without their e.
"""

import functools
import re
import unicodedata

from drift_drake.gap.logs.wording.eastern import in_english

CONCEPTS = {
    "yaw": (
        "yaw yawing gier gieren gir lacet imbardata guinada odchylenia odchylania staceni "
        "staciva stacania stacava legyezesi sapma giratie рыскания рыскание zakretanja skretanja kaantymis рискання "
        "kiertymis"
    ),
    "turn": "roll rolling wank wanken roulis rollio pitch pitching nick nicken tangage beccheggio",  # not about z
    "rate": "rate rates rt taux taxa dot punkt point deriv",
    "gyro": "gyro gyros gyr gyroscope gyroskop gyroscop kreisel drehrate drehraten rotation",
    "angular": (
        "angular angulaire rotational angvel winkelgeschwindigkeit katowa uhlova uhlovou угловая угловои кутова "
        "obrotowa"
    ),
    "linear": "linear",
    "speed": (
        "speed speeds spd velocity velocities vel velo geschwindigkeit geschw vitesse vit velocidad "
        "velocidade velocita hastighet snelheid predkosc rychlost sog "
        "sebesseg hiz hizi nopeus viteza brzina hitrost hastighed скорость швидкість rychlosti predkosci"
    ),
    "steer": (
        "eps steer steering steered str strg lenk lenkung lenken braquage sterzo sterzata styr stuur direccion direcao "
        "skretu natoceni "
        "kormany ohjaus obrotu поворота повороту natocenia zatoceni strg ste upravljaca krmila"
    ),
    "handwheel": (
        "handwheel swa sas lenkrad volant volante volantu ratt stuurwiel timon kierownicy kierownica "
        "kormanykerek direksiyon ratti ratin руля рулевого руль керма rattutslag volana stw ohjauspyoran"
    ),
    "road": "road roadwheel strasse",
    "angle": (
        "angle ang angles winkel wkl angulo angolo vinkel hoek kat uhel "
        "angl an szog aci acisi kulma unghi угол кут uhol kut kot"
    ),
    "wheel": "wheel wheels whl whls колеса rad raeder rader roue roues ruota ruote rueda pneu",
    "axle": "axle achse essieu asse",
    "revs": "rpm revs rev drehzahl regime omega w",
    "acc": (
        "acc accel accels accl acceleration accelerations accelerometer beschleunigung beschl aceleracion "
        "aceleracao accelerazione acceleratie versnelling przyspieszenie zrychleni gforce gforces "
        "gyorsulas ivme ivmesi kiihtyvyys akselerasjon прискорення ускорение ubrzanje pospesek zrychlenie"
    ),
    "gee": "g",
    "lat": (
        "lat lateral laterale quer seitlich transversal transversale trasversale sido dwars poprzeczne pricne "
        "oldal keresztiranyu yanal sivuttais поперечное боковое бічне priecne bocno precni laterala"
    ),
    "long": (
        "wzdluzne podelne long lon longitudinal longitudinale langs laengs inline forward fwd vorwaerts "
        "hosszanti hosszirany hossziranyu boyuna pitkittais продольное поздовжнє podelna pozdlzne longitudinala uzduzno"
    ),
    "x": "x",
    "y": "y",
    "z": "z vertical vertikal verticale hoch down",
    "latitude": "latitude breite breitengrad",
    "longitude": "longitude lng laenge lange laengengrad",
    "course": "course cog kurs bearing",
    "heading": "heading hdg cap psi steuerkurs rumbo azimuth azimut",
    "orientation": "orientation quat quaternion attitude euler rpy ypr lage",
    "slip": "slip sideslip schwimm derive drift",
    "side": "side seiten",
    "beta": "beta",
    "delta": "delta",
    "torque": "torque torques trq tq moment drehmoment couple coppia vridmoment koppel tau",
    "engine": (
        "engine eng motor motors mot moteur motore crank crankshaft kurbelwelle antrieb antriebs traction drivetrain "
        "shaft propshaft cardan powertrain emotor "
        "silnika motoru motorul moottori двигателя"
    ),
    "rear": "rear rl rr lr hl hr hinten hinter hinterachse heck arriere ar arg ard back posteriore",
    "front": "front f fl fr lf rf vl vr vorn vorne vorder vorderachse avant av avg avd anteriore",
    "earth": "north east northing easting nord sud ned enu",
    "hand": "left right links rechts gauche droite",
    "pos": "pos position positions pose",
    "v": "v",
    "r": "r",
    "time": (
        "time times zeit temps tiempo tempo timestamp timestamps stamp stempel zeitstempel horodatage tow itow uhrzeit "
        "uhr utc gmt epoch unixtime tijd tid czas cas seconds secs sec millis "
        "milliseconds micros microseconds sekunden secondes segundos secondi "
        "ido zaman aika timp время час vrijeme vreme"
    ),
    "t": "t ts",
    "date": "date datum datetime",
    "car": (
        "car vehicle veh fahrzeug fzg fahr vehicule voiture auto vehiculo veicolo ground over own host body chassis "
        "pojazdu vozidla jarmu arac aracin ajoneuvo автомобиля vozila"
    ),
    "norm": "norm magnitude abs absolute total horizontal",
    "source": (
        "based gps imu ins gnss rtk can obd odom odometry ego sensor sensors measured measure meas measurement mess "
        "messwert ist actual act est estimated estimate filtered filt raw corr corrected calc calculated kf ekf fused "
        "state states drive unix data msg msgs message header twist stamped value val signal sig channel ch vicon "
        "mocap optitrack vbox racebox racelogic aim motec cog cg com mpu vesc fix pvt local global map world base "
        "location motion link frame elapsed "
        " log since start uptime boot system sys ros recording recorder session of and the in at by "
        "for de do du la le au del della dell di al der die das von vom rec xyz "
        "true mean smoothed smooth lowpass lp current topic can1 can2 bus "
        "actl comp esti "
        "hydra daq logger adma oxts rt3000 kistler correvit inertial unit group"
    ),
    "target": (
        "desired des target tgt ref reference setpoint set soll sollwert consigne cible demand demanded dem request "
        "requested req goal plan planned wanted cmd cmds command commanded commands commande befehl vorgabe input "
        "control ctrl controller expected predicted pred nominal ackermann pilot"
    ),
    "other": (
        "wind vent wehen air airspeed luft gust gusts fan ventilator luefter pump pumpe pompe oil oel huile fuel "
        "turbo turbine gear gearbox getriebe ratio brake brakes bremse bremsen frein clutch kupplung embrayage "
        "throttle pedal gas accelerator acelerador acceleratore freno freio broms gaspedal drosselklappe papillon "
        "lap laps lapnumber runde tour sector sektor split beacon distance dist "
        "strecke altitude height hoehe elevation temp temperature temperatur pressure druck pression voltage volt "
        "spannung battery batt power leistung lambda count counter index idx id number num nr quality valid validity "
        "status flag flags accuracy genauigkeit precision error err fehler erreur std stddev stdev dev deviation var "
        "variance cov covariance sigma uncertainty dop hdop vdop pdop satellites sats limit limits limited lim max "
        "min maximum minimum maximal minimal offset bias zero null nullpunkt calib calibration trim gain scale factor "
        "jerk ruck force forces kraft suspension damper daempfer camber toe stroke hub travel mag magnetometer "
        "magnetic compass track trajectory path curvature radius "
        "diff difference gap residual rest loss friction reserve best interval duration delay latency dead remaining "
        "timeout age period mode gradient noise checksum crc cursor mouse joystick stick touch camera lidar radar "
        "object obstacle lead leading relative rel other traffic closing conveyor average avg trip weather driver "
        "sign signum vorzeichen signe segno spin spoiler drone rotor propeller prop anemometer pitot counts"
    ),
}
PAIRS = {  # words that say two things
    "tyre": "wheel tyre", "tire": "wheel tyre", "reifen": "wheel tyre",
    "kol": "road wheel", "radlenkwinkel": "road wheel angle", "radeinschlag": "road wheel angle",
    "radeinschlagwinkel": "road wheel angle",
    "lws": "handwheel angle", "hwa": "handwheel angle", "rwa": "road wheel angle",
    "lenkw": "steer angle", "lw": "steer angle", "lrw": "handwheel angle", "strangle": "steer angle",
    "vx": "speed x", "vy": "speed y", "vz": "speed z", "ux": "speed x", "uy": "speed y", "ax": "acc x", "ay": "acc y",
    "az": "acc z", "wx": "gyro x", "wy": "gyro y", "wz": "gyro z", "omegaz": "gyro z", "omegax": "gyro x",
    "omegay": "gyro y", "ws": "wheel speed", "wspd": "wheel speed", "yrs": "yaw rate", "psip": "yaw rate",
    "yawr": "yaw rate", "psidot": "yaw rate", "dpsi": "yaw rate", "glat": "acc lat", "glong": "acc long",
    "glon": "acc long", "vcar": "car speed", "vveh": "car speed", "vfzg": "car speed", "vlat": "speed lat",
    "vlon": "speed long", "vlong": "speed long",
    "alat": "acc lat", "along": "acc long", "alon": "acc long", "nmot": "engine revs",
    "strwhl": "handwheel", "steerwheel": "handwheel", "steeringwheel": "handwheel", "wss": "wheel speed",
    "sideslip": "slip side", "schwimmwinkel": "slip angle", "drehrate": "gyro", "datetime": "date time",
    "roadwheel": "road wheel", "nengine": "engine revs", "omegar": "revs rear", "asteer": "steer angle",
    "airspeed": "other", "laptime": "other", "runtime": "other", "swangle": "handwheel angle",
    "swrate": "handwheel rate", "strang": "steer angle", "winkelgeschwindigkeit": "angular speed",
    "angvel": "angular speed", "szogsebesseg": "angular speed", "stwhl": "handwheel",
    "ratvinkel": "handwheel angle", "xvalue": "time",
    "uptime": "time source", "hinterrad": "rear wheel", "vorderrad": "front wheel",
}  # fmt: skip
WORDS = {word: (concept,) for concept, words in CONCEPTS.items() for word in words.split()} | {
    word: tuple(concepts.split()) for word, concepts in PAIRS.items()
}
CORNERS = ("fl", "fr", "rl", "rr", "vl", "vr", "hl", "hr")
LETTERS = str.maketrans(
    {"ß": "ss", "œ": "oe", "Œ": "Oe", "æ": "ae", "ł": "l", "Ł": "L", "\u0131": "i", "ø": "o", "đ": "d"}
)
LONGEST = 200  # characters of a name that is read


@functools.lru_cache(maxsize=8192)
def pieces(name: str) -> tuple[str, ...]:
    """The words of a name in lower case, without accents, cut at signs, capitals and digits, and compounds apart."""
    plain = unicodedata.normalize("NFKD", in_english(name).translate(LETTERS))
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    found: list[str] = []
    for word in re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_a-zA-Z]+", plain):
        word = word.lower()
        joined = found and found[-1] + word in WORDS and (found[-1], word) != ("pos", "e")  # of north and east
        if joined and (len(found[-1]) == 1 or len(word) == 1):
            found[-1] += word  # v_x, g-force, gLat
        elif found and (found[-1], word) == ("g", "force"):
            found[-1] = "gforce"
        else:
            found += pieces_of_compound(word)
    return tuple(found)


@functools.lru_cache(maxsize=8192)
def pieces_of_compound(word: str) -> list[str]:
    """The words of a compound, as few as will do; itself where it is none of known words."""
    if word in WORDS or word.isdigit() or len(word) > 60:
        return [word]
    best: list[list[str] | None] = [[]] + [None] * len(word)
    for end in range(1, len(word) + 1):
        for start in range(end):
            before, part = best[start], word[start:end]
            known = (len(part) > 2 and part in WORDS) or (end == len(word) and start > 2 and part in (*"xyz", *CORNERS))
            if before is None or not (known or (part == "s" and len(before) > 0)):
                continue
            cut = before if part == "s" else [*before, part]
            if best[end] is None or len(cut) < len(best[end] or []):
                best[end] = cut
    return best[-1] or [word]


def speaks_of(name: str) -> set[str]:
    """The concepts that a name's words speak of."""
    return {concept for word in pieces(name[:LONGEST]) for concept in WORDS.get(word, ())}
