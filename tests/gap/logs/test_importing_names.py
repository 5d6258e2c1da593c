"""What columns' names are taken for, and what they are not."""

import numpy as np
import pandas as pd
import pytest
from importing_bench import rows

from drift_drake.gap.logs.importing.clocks import numbers_of_column
from drift_drake.gap.logs.importing.formats.topics import Topic
from drift_drake.gap.logs.importing.guess import guessed_mapping
from drift_drake.gap.logs.importing.names import LIMIT, RULES, fit, is_handwheel
from drift_drake.gap.logs.wording.conversion import factor

MEANT = {
    "r": "yaw_rate|YawRate|yawrate|imu.angular_velocity.z|gyro_z|GyroZ|gyro[2]|GyrZ|wz|ang_vel_z|psi_dot|YawRt"
    "|Gyro Yaw Velocity|omega(rad/s)"
    "|z_rate_of_rotation|GPS Yaw Rate|nYawRate|Gierrate|Giergeschwindigkeit|Drehrate z|vitesse de lacet|taux de lacet"
    "|ESP_Gierrate|yawr_dps|/odom/twist/twist/angular/z|/velocity_status/heading_rate|Girhastighet"
    "|yaw [deg/s]|yaw_rate_deg_s|gyro_z_mdps|velocidad de guiñada|r"
    "|ヨーレート|ﾖｰﾚｰﾄ|ヨー角速度【度/秒】|横摆角速度(rad/s)|偏航角速度|요레이트|요 각속도"
    "|Girhastighet (grader/s)|ψ̇ [°/s]|velocità di imbardata|taxa de guinada",
    "v": "speed|VehSpeed|vehicle_speed|VehSpd|Ground Speed|GPS Speed (km/h)|Speed (m/s) *gps|vCar|v|v [km/h]|speed_mph"
    "|SpeedKmh|speedkmh|Speed (kts)|v_knots|Geschwindigkeit|Fahrzeuggeschwindigkeit|v_Fzg|vitesse véhicule|vitesse"
    "|drive.drive.speed|speed_2d|vehicle_status.speed|ESP_v_Signal|Hastighet (km/h)|snelheid|/control/speed"
    "|Vitesse [nœuds]|velocity kmh|speed_over_ground|Speed (GPS)"
    "|車速|車速【km/h】|車両速度|車速_kmh|车速|车辆速度 km/h|차속|Hastighet (km/t)|snelheid [km/u]",
    "vx": "vx|vel_x|v_x|twist.linear.x|VelForward (m/s)|/odom/twist/twist/linear/x|velocity[0]|velocity.x|Lng._Vel."
    "|vx_mps",
    "vy": "vy|twist.linear.y|velocity[1]|v_lat|Lat._Vel.",
    "ax": "ax|acc_x|linear_acceleration.x|accel[0]|InlineAcc|GPS LonAcc|GForceX|Längsbeschleunigung|LaengsBeschl",
    "ay": "ay|acc_y [g]|AccY|LatAcc|G Force Lat|gLat|lateral_acc|Lateral G|lat_g|Querbeschl.|Querbeschleunigung"
    "|accélération latérale|accel transversale|linear_acceleration.y|imu.acceleration[1]"
    "|横加速度|横G|侧向加速度|횡가속도",
    "delta_cmd": "steering_angle|SteerAng|Steered Angle|road_wheel [rad]|delta|delta_f|steering"
    "|Steering Wheel Angle|SWA"
    "|ángulo del volante|angolo del volante [°]|Lenkradwinkel|Lenkwinkel|angle volant|Angle de braquage"
    "|Kąt obrotu kierownicy [°]|Úhel natočení volantu [°]|Direksiyon aç\u0131s\u0131|Угол поворота руля|Ratvinkel [°]"
    "|StW_Angl|StrgWhlAngl|Angle Steering Wheel [deg]"
    "|steering_angle_cmd|LWI_Lenkradwinkel|steering_tire_angle|StrWhlAng|Steering Pos"
    "|操舵角|ハンドル角|舵角[度]|方向盘转角|前轮转角|조향각|스티어링 휠 각도"
    "|Rattvinkel (grader)|stuurhoek [graden]|ángulo de dirección|δ",
    "omega_r": "wheel_speed_rl|wheelspeedrr|WheelSpdRR|ws_rl|omega_r|rear_wheel_speed|Raddrehzahl hinten links"
    "|Radgeschwindigkeit HL|vitesse roue AR gauche|wheel_rpm_rl|wheel rr (km/h)|Wheel Speed LR",
    "psi": "psi|heading|yaw|yaw_angle|orientation.yaw|Gierwinkel|cap|psi_deg|方位角|航向角|ヨー角|ψ",
    "beta": "beta|Slip_COG|Slip CG [deg]|sideslip|side_slip_angle|Schwimmwinkel|angle de dérive|横滑り角|质心侧偏角|β",
    "tau_cmd": "tau|engine_torque|motor_torque_cmd|Motormoment|couple moteur|Antriebsmoment [Nm]",
    "x": "x|pos_x|position.x|x_m|x [m]|pos[0]",
    "time": "time|t|Time|timestamp|Zeit [s]|Zeitstempel|temps|time_ms|header.stamp|elapsed_time|UTC|Uhrzeit|log_time"
    "|seconds of day|millis|iTOW|時間[s]|时间(s)|시간|経過時間 [秒]|時刻",
}
NONE = [  # names of no quantity of the log
    "omega", "wheel slip", "Slip_RL",
    "desired_yaw_rate", "yaw_rate_target", "yaw_rate_setpoint", "Sollgierrate", "yaw_rate_offset", "yaw_rate_limit",
    "yaw_acceleration", "roll_rate", "gyro_x", "imu.angular_velocity.x", "GyroY", "pitch_rate", "Wankrate",
    "engine_speed", "EngineSpeed", "motor_speed", "Motordrehzahl", "régime moteur", "vitesse moteur", "wind_speed",
    "Windgeschwindigkeit", "vitesse du vent", "target_speed", "speed_limit", "Sollgeschwindigkeit",
    "vitesse consigne", "speed_accuracy", "speed_error", "fan_speed", "turbo_speed", "average_speed", "max_speed",
    "lap_time", "steering_rate", "steering_torque", "steering_velocity", "Lenkradmoment", "Lenkwinkelgeschwindigkeit",
    "couple volant", "vitesse volant", "steering_offset", "steering_angle_rate", "steering_angle_velocity",
    "wheel_speed_fl", "WheelSpeedFR", "front_wheel_speed", "Raddrehzahl vorne links", "vitesse roue AV gauche",
    "ws_fr", "slip_angle_front", "brake_torque", "engine_torque_limit", "orientation.x", "mag.x",
    "angular_acceleration.y", "heading_accuracy", "speed_time", "vel_n", "counter", "gear",
    "airspeed", "LWI_Lenkradw_Geschw", "/control/lateral/steering_tire_rotation_rate", "目標ヨーレート", "目標車速",
    "エンジン回転数", "アクセル開度", "ブレーキ圧", "左前輪速度", "风速", "油门开度", "ロールレート", "俯仰角速度",
    "StW_AnglSpd", "Rychlost otáčení volantu [°/s]", "prędkość obrotowa silnika", "gz",
    "发动机转速", "스로틀", "操舵角速度", "ヨー角加速度", "速度制限",
]  # fmt: skip


@pytest.mark.parametrize("quantity", sorted(MEANT))
def test_names(quantity):
    for name in MEANT[quantity].split("|"):
        ranks = {key: found[0] for key in RULES if (found := fit(key, name)) is not None}
        assert quantity in ranks, name
        assert min(ranks, key=lambda key: ranks[key]) == quantity, (name, ranks)
        assert ranks[quantity] < LIMIT


@pytest.mark.parametrize("name", NONE)
def test_names_of_other_things(name):
    assert not {key: found for key in RULES if (found := fit(key, name)) is not None}


@pytest.mark.parametrize(
    ("name", "unit", "quantity"),
    [("speed", "rpm", "v"), ("speed", "%", "v"), ("yaw", "deg/s", "psi"), ("yaw_rate", "deg", "r"),
     ("steering", "Nm", "delta_cmd"),
     ("steering", "deg/s", "delta_cmd"), ("ay", "rad/s", "ay"), ("torque", "V", "tau_cmd"), ("speed_rpm", "", "v"),
     ("steering_pct", "", "delta_cmd"), ("steer_bar", "", "delta_cmd")],
)  # fmt: skip
def test_a_unit_of_another_dimension_rules_a_column_out(name, unit, quantity):
    assert fit(quantity, name) is None or unit
    assert fit(quantity, name, unit) is None


def test_a_topic_of_something_else_is_named_and_not_taken():
    assert fit("v", "speed", topic="/engine")[0] >= LIMIT
    assert fit("v", "speed", topic="/drive")[0] < fit("v", "speed", topic="/ackermann_cmd")[0] < LIMIT
    assert fit("v", "data", topic="/vehicle/speed")[0] < LIMIT
    assert fit("r", "yaw_rate", topic="/engine_bus")[0] < LIMIT


def test_the_steering_wheel_is_distinguished_from_the_road_wheel():
    assert all(map(is_handwheel, ["steering_wheel", "Lenkradwinkel", "angle volant", "SWA", "SteeringWheelAngle"]))
    assert not any(map(is_handwheel, ["road_wheel", "steering_angle", "roadwheel_steer", "delta"]))


def table(**columns):
    exact = rows()
    return Topic("", pd.DataFrame({"time": exact["t"]} | columns))


def test_of_several_columns_the_motion_decides():
    exact = rows()
    noise = np.random.default_rng(0).standard_normal(len(exact["t"]))
    content, _, notes = guessed_mapping(
        [table(yaw_rate_1=noise, yaw_rate_2=exact["r"], speed=exact["v"], ay=exact["ay"], steering=exact["delta_cmd"])]
    )
    assert content["signals"]["r"]["column"] == "yaw_rate_2"
    assert any(note.startswith("r is taken from yaw_rate_2; it may also be yaw_rate_1") for note in notes)


def test_a_dead_column_is_not_taken_where_another_moves():
    exact = rows()
    content, _, _ = guessed_mapping([table(speed=0.0 * exact["v"], gps_speed=exact["v"], yaw_rate=exact["r"])])
    assert content["signals"]["v"]["column"] == "gps_speed"


@pytest.mark.parametrize("speed", ["m/s", "km/h", "mph", "kn"])
@pytest.mark.parametrize("rate", ["rad/s", "deg/s"])
@pytest.mark.parametrize("acceleration", ["m/s^2", "g"])
def test_units_that_nothing_states_are_recognised_by_the_motion(speed, rate, acceleration):
    exact = rows(noise=0.3)
    content, _, notes = guessed_mapping(
        [table(yaw_rate=exact["r"] / factor(rate), speed=exact["v"] / factor(speed), steering=exact["delta_cmd"],
               lateral_acc=exact["ay"] / factor(acceleration))]
    )  # fmt: skip
    signals = content["signals"]
    assert (signals["v"]["unit"], signals["r"]["unit"], signals["ay"]["unit"]) == (speed, rate, acceleration)
    changed = [unit for unit in (speed, rate, acceleration) if unit not in ("m/s", "rad/s", "m/s^2")]
    assert all(any(f"in {unit}" in note for note in notes) for unit in changed)


def test_degrees_of_steering_and_a_wheel_s_turning_are_recognised_by_the_motion():
    exact = rows()
    content, _, _ = guessed_mapping(
        [table(yaw_rate=exact["r"], speed=exact["v"], steering=np.degrees(exact["delta_cmd"]),
               wheel_speed_rl=exact["omega_r"] / 0.31)]
    )  # fmt: skip
    assert content["signals"]["delta_cmd"]["unit"] == "deg"
    assert content["signals"]["omega_r"]["unit"] == "rad/s"
    assert content["signals"]["omega_r"]["radius"] == pytest.approx(0.31, rel=0.05)


def test_a_compass_heading_is_recognised_by_its_turning():
    exact = rows()
    columns = {"yaw_rate": exact["r"], "speed": exact["v"], "heading": np.degrees(-exact["psi"]) % 360.0}
    content, _, _ = guessed_mapping([table(**columns)])
    assert content["signals"]["psi"] == {"column": "heading", "unit": "deg", "frame": "ned"}


def test_velocities_of_a_fixed_frame_are_no_body_s():
    exact = rows()
    course = exact["psi"] + exact["beta"]
    columns = {"velocity_x": exact["v"] * np.cos(3.0 * course), "velocity_y": exact["v"] * np.sin(3.0 * course)}
    content, _, _ = guessed_mapping([table(speed=exact["v"], yaw_rate=exact["r"], **columns)])
    assert {"v", "r"} == set(content["signals"])


@pytest.mark.parametrize("flags", [(0.0, 1.0), (-1.0, 1.0), (-1.0, 0.0, 1.0)])
def test_a_column_of_signs_is_no_yaw_rate(flags):
    exact = rows()
    signs = np.asarray(flags)[(exact["r"] > 0.0).astype(int)]
    content, _, _ = guessed_mapping([table(yaw_rate=signs, yaw_rate_2=exact["r"], speed=exact["v"])])
    assert content["signals"]["r"]["column"] == "yaw_rate_2"
    assert fit("r", "yaw_rate_sign") is None
    assert fit("r", "Gierrate Vorzeichen") is None


def test_a_tyre_and_a_unit_in_radians_are_no_steering_wheel():
    assert not is_handwheel("steering_tire_angle")
    assert not is_handwheel("drive_steering_angle_rad")
    assert is_handwheel("steering_wheel_angle_rad")


def test_the_speed_that_a_car_has_is_taken_before_the_one_that_a_drive_message_asks_for():
    t = 0.01 * np.arange(400)
    columns = {"t": t, "odom_twist_linear_x": 3.0 + np.sin(t), "odom_twist_angular_z": 0.3 * np.sin(2.0 * t),
               "drive_steering_angle_rad": 0.05 * np.sin(2.0 * t),
               "drive_speed_mps": 3.0 + np.sin(1.0 + t)}  # fmt: skip
    found = guessed_mapping([Topic("", pd.DataFrame(columns))]).mapping["signals"]
    assert found["v"]["column"] == "odom_twist_linear_x"
    assert "vx" not in found


def test_a_column_in_seconds_that_always_advances_is_the_clock_in_any_language():
    t = 0.01 * np.arange(400)
    columns = {"czas [s]": t, "speed [m/s]": 3.0 + np.sin(t), "yaw rate [rad/s]": 0.3 * np.sin(t)}
    assert guessed_mapping([Topic("", pd.DataFrame(columns))]).mapping["clocks"] == {"recorder": {"column": "czas [s]"}}


@pytest.mark.parametrize(("factor_", "said"), [(1.0, False), (14.0, True), (40.0, True)])
def test_steering_that_is_no_road_wheel_s_needs_a_scale(factor_, said):
    exact = rows()
    columns = {"yaw_rate": exact["r"], "speed": exact["v"], "steering [deg]": factor_ * np.degrees(exact["delta_cmd"])}
    _, _, notes = guessed_mapping([table(**columns)])
    assert any("like a steering wheel" in note for note in notes) == said


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("phi(rad)", "'psi: {column: phi(rad), unit: rad}'"),
        ("theta", "'psi: {column: theta, unit: rad}'"),
        ("Theta_deg", "'psi: {column: Theta_deg, unit: deg}'"),
        ("phi_dot [deg/s]", "'r: {column: phi_dot [deg/s], unit: deg/s}'"),
    ],
)
def test_a_symbol_of_yaw_or_roll_is_asked_and_not_taken(name, line):
    d = rows()
    table = pd.DataFrame({"t": d["t"], "v": d["v"], "steer": d["delta_cmd"], name: d["psi"]})
    guess = guessed_mapping([Topic("", table)])
    assert not {"psi", "r"} & set(guess.mapping["signals"])
    (note,) = (note for note in guess.notes if "may be the" in note)
    assert line in note


def test_times_of_commands_are_named_and_not_taken():
    d = rows()
    signals = {"v": d["v"], "yaw_rate": d["r"], "command_t": d["t"] + 0.02, "command_steering": d["delta_cmd"]}
    guess = guessed_mapping([Topic("", pd.DataFrame({"state_t": d["t"]} | signals))])
    assert guess.mapping["clocks"] == {"recorder": {"column": "state_t"}}
    assert any("command_t may be times too" in note for note in guess.notes)
    guess = guessed_mapping([Topic("", pd.DataFrame(signals))])
    assert guess.mapping["clocks"] == {"recorder": {"column": "?"}}
    assert any("(it may be command_t)" in note for note in guess.notes)


@pytest.mark.parametrize(
    ("quantity", "name"),
    [
        ("v", "Rychlost [km/h]"), ("v", "Prędkość [km/h]"), ("r", "Rychlost stáčení [deg/s]"),
        ("r", "Prędkość odchylenia [deg/s]"), ("delta_cmd", "Úhel natočení kol [deg]"),
        ("delta_cmd", "Kąt skrętu kół [deg]"), ("delta_cmd", "VA_Radlenkwinkel"), ("time", "sec"), ("time", "Czas [s]"),
        ("r", "Stáčivá rychlost [°/s]"), ("r", "Legyezési szögsebesség [°/s]"), ("r", "Sapma h\u0131z\u0131 [°/s]"),
        ("r", "Угловая скорость рыскания [°/сек]"), ("r", "kääntymisnopeus [°/s]"), ("v", "Скорость [км/ч]"),
        ("ay", "Oldalgyorsulás [m/s²]"), ("ay", "Поперечное ускорение [м/сек²]"), ("ay", "Yanal ivme (m/s²)"),
        ("delta_cmd", "Kormányszög [°]"), ("r", "Girhastighed [°/s]"),
        ("ay", "Sideacceleration [m/s²]"), ("v", "Швидкість (км/год)"), ("v", "locationSpeed(m/s)"),
        ("longitude", "Länge [°]"), ("latitude", "locationLatitude(WGS84)"), ("time", "X_Value"),
        ("time", "Idő [s]"), ("time", "Время [сек]"),
    ],
)  # fmt: skip
def test_further_languages_and_the_german_road_wheel(quantity, name):
    rank, _ = fit(quantity, name)
    assert rank < LIMIT
    assert quantity != "delta_cmd" or not is_handwheel(name)


def test_gz_is_a_yaw_rate_next_to_az_and_nothing_alone():
    r = np.radians(10.0) * np.sin(np.arange(0.0, 40.0, 0.01))
    v = np.full(4000, 12.0)
    columns = {"t": np.arange(0.0, 40.0, 0.01), "gz": np.degrees(r), "speed [m/s]": v, "steer": r * 2.5 / v}
    alone = guessed_mapping([Topic("", pd.DataFrame(columns))])
    assert alone.missing == ["r"]
    together = guessed_mapping(
        [Topic("", pd.DataFrame({**columns, "ax": 0.0 * r, "ay": v * r / 9.81, "az": 0.0 * r + 1}))]
    )
    assert together.mapping["signals"]["r"] == {"column": "gz", "unit": "deg/s"}
    assert [together.mapping["signals"][name]["unit"] for name in ("ax", "ay")] == ["g", "g"]


def test_names_without_a_word_are_nothing():
    t = np.arange(0.0, 4.0, 0.01)
    columns = {"time": t, "speed": 12.0 + np.sin(t), "yaw_rate": np.cos(t), "[m]": t, "--": t, "_": t}
    assert set(guessed_mapping([Topic("", pd.DataFrame(columns))]).mapping["signals"]) == {"r", "v"}


def test_a_clock_may_be_called_by_its_unit():
    t = np.arange(0.0, 40.0, 0.01)
    columns = {"speed [m/s]": 12.0 + np.sin(t), "yaw_rate": np.cos(t), "steer": np.cos(t) / 5.0, "s": 12.0 * t + 1e-3}
    assert guessed_mapping([Topic("", pd.DataFrame(columns))]).mapping["clocks"] == {"recorder": {"column": "?"}}
    guess = guessed_mapping([Topic("", pd.DataFrame({"us": 1e6 * t + 5.0, **columns}))])
    assert guess.mapping["clocks"] == {"recorder": {"column": "us", "unit": "us"}}


def test_a_unit_of_a_yaw_rate_with_two_meanings_is_asked():
    assert fit("r", "yaw_rate_rps")[1] == "?"
    assert fit("omega_r", "wheel_speed_rps")[1] == "rev/s"


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (("Easting [m]", "Northing [m]"), True), (("utm_easting", "utm_northing"), True), (("pos_e", "pos_n"), True),
        (("Rechtswert", "Hochwert"), True), (("east [km]", "north [km]"), True), (("east", "north"), False),
        (("vel_e", "vel_n"), False), (("Easting [m/s]", "Northing [m/s]"), False),
    ],
)  # fmt: skip
def test_a_position_to_the_east_and_north_is_x_and_y(names, taken):
    exact = rows()
    columns = {"yaw_rate": exact["r"], "speed": exact["v"], names[0]: exact["x"], names[1]: exact["y"]}
    signals = guessed_mapping([table(**columns)]).mapping["signals"]
    assert [signals.get(key, {}).get("column") for key in ("x", "y")] == (list(names) if taken else [None, None])


def test_a_signalling_nan_of_a_damaged_file_is_a_gap():
    t = np.arange(0.0, 4.0, 0.01)
    speed = (12.0 + np.sin(t)).astype(np.float32)
    speed.view(np.uint32)[7] = 0x7F800001
    topic = Topic("", pd.DataFrame({"time": t, "speed": speed, "yaw_rate": np.cos(t)}))
    assert set(guessed_mapping([topic]).mapping["signals"]) == {"r", "v"}
    assert np.flatnonzero(np.isnan(numbers_of_column(topic, "speed"))).tolist() == [7]
