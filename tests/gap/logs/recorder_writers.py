"""Small files of recorders' own formats, written for the tests."""

import struct

import numpy as np

HEADER = "satellites\ntime\nlatitude\nlongitude\nvelocity kmh\nheading\nheight\nyaw rate\nsteering\n"
NAMES = "sats time lat long velocity heading height yaw_rate steering"


def packed(seconds):
    """hhmmss.sss of a time of day [s]."""
    milli = round(1000 * seconds) % 86_400_000
    hours, rest = divmod(milli, 3_600_000)
    minutes, rest = divmod(rest, 60_000)
    return f"{hours:02d}{minutes:02d}{rest / 1000:06.3f}"


def write_vbo(path, t, lat, long, speed, heading, yaw_rate, steering, header=HEADER, units="deg/s\ndeg\n", **changes):
    """A VBOX file: latitude, longitude [deg], speed [m/s], heading (clockwise from north), yaw rate, steering [rad]."""
    rows = [
        f"012 {packed(a)} {60 * b:+012.5f} {-60 * c:+012.5f} {3.6 * d:07.3f} {np.degrees(e) % 360:06.2f} +00300.00 "
        f"{np.degrees(f):+.6E} {np.degrees(g):+.6E}"
        for a, b, c, d, e, f, g in zip(t, lat, long, speed, heading, yaw_rate, steering, strict=True)
    ]
    parts = [
        "File created on 01/05/2024 @ 10:00\n",
        f"[header]\n{header}",
        f"[channel units]\n{units}",
        "[comments]\n(c) made by a test\nLog Rate (Hz) : 100.00\n",
        f"[column names]\n{NAMES}\n",
        "[data]\n" + "\n".join(rows) + "\n",
    ]
    text = "\n".join(parts)
    for old, new in changes.get("replaced", ()):
        text = text.replace(old, new)
    path.write_bytes(text.replace("\n", "\r\n").encode(changes.get("encoding", "utf-8")))


def write_ulog(path, messages):
    """A PX4 log: of each message its fields' types by name, and its rows; `timestamp` in microseconds first."""

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    codes = {"uint64_t": "Q", "float": "f", "double": "d", "int32_t": "i", "float[4]": "4f", "float[3]": "3f"}
    for name, (fields, _) in messages.items():
        text = f"{name}:" + "".join(f"{kind} {field};" for field, kind in fields.items())
        parts.append(message("F", text.encode()))
    for number, name in enumerate(messages):
        parts.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
    for number, (fields, rows) in enumerate(messages.values()):
        layout = "<" + "".join(codes[kind] for kind in fields.values())
        parts += [message("D", struct.pack("<H", number) + struct.pack(layout, *row)) for row in rows]
    path.write_bytes(b"".join(parts))


def _framed(name, body):
    token = name.ljust(4).encode()
    head, foot = struct.pack("<iB", len(body), 1), struct.pack("<H", sum(body) & 0xFFFF)
    return b"<h" + token + head + b">" + body + b"<" + token + foot + b">"


def write_xrk(path, channels):
    """An AiM log of channels: name, AiM's code of the unit, period [ms], values."""
    definitions, samples = [], []
    for index, (name, unit, period, values) in enumerate(channels):
        body = bytearray(112)
        struct.pack_into("<H", body, 0, index)
        body[12], body[16], body[20], body[72] = unit, 1, 6, 4
        body[24:56] = name[:8].encode().ljust(8, b"\0") + name.encode().ljust(24, b"\0")
        struct.pack_into("<I", body, 64, 1000 * period)
        definitions.append(_framed("CHS", bytes(body)))
        samples += [(number * period, index, value) for number, value in enumerate(values)]
    parts = [b"(S" + struct.pack("<iHf", *sample) + b")" for sample in sorted(samples)]
    path.write_bytes(_framed("CNF", b"".join(definitions)) + b"".join(parts))


DBC = """VERSION ""

NS_ :

BS_:

BU_: CAR

BO_ 256 Motion: 8 CAR
 SG_ YawRate : 0|16@1- (0.01,0) [-300|300] "deg/s" CAR
 SG_ Speed : 16|16@1+ (0.01,0) [0|600] "km/h" CAR
 SG_ AccY : 39|16@0- (0.001,0) [-30|30] "m/s^2" CAR

BO_ 512 Steering: 4 CAR
 SG_ SteeringAngle : 7|16@0- (0.01,0) [-300|300] "deg" CAR
 SG_ State : 16|8@1+ (1,0) [0|255] "" CAR

BO_ 2566844926 Extended: 8 CAR
 SG_ Mode M : 0|8@1+ (1,0) [0|255] "" CAR
 SG_ First m0 : 8|16@1- (1,0) [-30|30] "" CAR
 SG_ Second m1 : 8|16@1- (1,0) [-30|30] "" CAR

VAL_ 256 Speed 65535 "SNA" ;
VAL_ 512 State 0 "off" 1 "on" ;
"""


def write_frames(path, database, t, yaw_rate, speed, angle):
    """A log of frames in the format of the path's ending: [deg/s], [km/h] (655.35: not available), [deg]."""
    import can

    with can.Logger(str(path)) as log:
        for i, time in enumerate(t):
            motion = {"YawRate": yaw_rate[i], "Speed": speed[i], "AccY": -1.25}
            frames = [(256, motion, False)]
            if i % 2 == 0:
                frames.append((512, {"SteeringAngle": angle[i], "State": 1}, False))
            if i % 10 == 0:
                mode = i // 10 % 2
                frames.append((0x18FEF1FE, {"Mode": mode, ("First", "Second")[mode]: -i // 10}, True))
            for number, values, extended in frames:
                data = database.get_message_by_name({256: "Motion", 512: "Steering"}.get(number, "Extended")).encode(
                    values
                )
                log(can.Message(timestamp=time, arbitration_id=number, is_extended_id=extended, data=data, channel=0))
            log(can.Message(timestamp=time, arbitration_id=0x7FF, is_extended_id=False, data=b"12", channel=0))
