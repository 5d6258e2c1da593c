"""Small files of every format of one simulated drive: three topics on clocks of their own."""

import json

import numpy as np
from importing_bench import truth

EPOCH = 1.7e9  # [s]
GPS_LATE = 0.008  # [s] that the second topic's stamps lie behind the first one's


def topics():
    """Time [s] and columns of the topics: an inertial unit at 100 Hz, velocity at 50 Hz, commands at 40 Hz."""
    exact = truth()

    def at(t, *names):
        return {name: np.interp(t, exact["t"], exact[name]) for name in names}

    imu, gps, drive = np.arange(0.0, 11.9, 0.01), np.arange(0.1, 11.8, 0.02) + GPS_LATE, np.arange(0.05, 11.85, 0.025)
    body = at(gps, "v", "beta")
    velocity = {"vx": body["v"] * np.cos(body["beta"]), "vy": body["v"] * np.sin(body["beta"])}
    return {"imu": (imu, at(imu, "r", "ax", "ay")), "gps": (gps, velocity), "drive": (drive, at(drive, "delta_cmd"))}


def messages(name, values):
    """Messages of one topic as nested fields and arrays."""
    if name == "imu":
        return [
            {"angular_velocity": {"x": 0.0, "y": 0.0, "z": r}, "acceleration": [ax, ay, 9.81]}
            for r, ax, ay in zip(values["r"], values["ax"], values["ay"], strict=True)
        ]
    if name == "gps":
        return [{"velocity": {"x": x, "y": y}} for x, y in zip(values["vx"], values["vy"], strict=True)]
    return [{"steering_angle": angle} for angle in values["delta_cmd"]]


def mapping(clocks, r="imu.angular_velocity.z", ay="imu.acceleration[1]", vx="gps.velocity.x", vy="gps.velocity.y"):
    """A mapping's content for columns by these names."""
    return {
        "clocks": {name: {"column": column} for name, column in clocks.items()},
        "signals": {
            "r": {"column": r, "unit": "rad/s"},
            "ay": {"column": ay, "unit": "m/s^2"},
            "vx": {"column": vx, "unit": "m/s", "clock": "gps"},
            "vy": {"column": vy, "unit": "m/s", "clock": "gps"},
            "delta_cmd": {"column": "drive.steering_angle", "unit": "rad", "clock": "drive"},
        },
    }


def write_json_mcap(path):
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for name, (t, values) in topics().items():
            schema = writer.register_schema(name=name, encoding="jsonschema", data=b'{"type": "object"}')
            channel = writer.register_channel(topic=f"/{name}", message_encoding="json", schema_id=schema)
            for time, message in zip(t, messages(name, values), strict=True):
                stamp = round(1e9 * (EPOCH + time))
                writer.add_message(channel, log_time=stamp, publish_time=stamp, data=json.dumps(message).encode())
        writer.finish()


ROS_TYPES = {
    "imu": ("sensor_msgs/Imu", "angular_velocity"),
    "gps": ("geometry_msgs/TwistStamped", "twist"),
    "drive": ("test_msgs/Drive", ""),
}


def ros_messages(typestore):
    """Messages of ROS 2 by topic: stamped times [s] and objects."""
    types = typestore.types
    header, time_of = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]

    def stamped(t):
        return header(stamp=time_of(sec=int(EPOCH + t), nanosec=round(1e9 * ((EPOCH + t) % 1.0)) % 10**9), frame_id="")

    (imu, inertial), (gps, velocity), (drive, commands) = topics().values()
    nine, still = np.zeros(9), vector(x=0.0, y=0.0, z=0.0)
    yield (
        "/imu",
        "sensor_msgs/msg/Imu",
        imu,
        [
            types["sensor_msgs/msg/Imu"](
                header=stamped(t),
                orientation=quaternion(x=0.0, y=0.0, z=np.sin(0.5 * t), w=np.cos(0.5 * t)),
                orientation_covariance=nine,
                angular_velocity=vector(x=0.0, y=0.0, z=r),
                angular_velocity_covariance=nine,
                linear_acceleration=vector(x=ax, y=ay, z=9.81),
                linear_acceleration_covariance=nine,
            )
            for t, r, ax, ay in zip(imu, *inertial.values(), strict=True)
        ],
    )
    twist = types["geometry_msgs/msg/Twist"]
    yield (
        "/gps",
        "geometry_msgs/msg/TwistStamped",
        gps,
        [
            types["geometry_msgs/msg/TwistStamped"](
                header=stamped(t), twist=twist(linear=vector(x=x, y=y, z=0.0), angular=still)
            )
            for t, x, y in zip(gps, *velocity.values(), strict=True)
        ],
    )
    array = types["std_msgs/msg/Float64MultiArray"]
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    yield (
        "/drive",
        "std_msgs/msg/Float64MultiArray",
        drive,
        [array(layout=layout, data=np.array([angle, 0.0])) for angle in commands["delta_cmd"]],
    )


def write_bag(folder, mcap=False):
    """A bag of ROS 2, in SQLite or MCAP; what is read is later than its stamp by 30 ms."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    typestore = get_typestore(Stores.ROS2_JAZZY)
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        for topic, kind, times, sent in ros_messages(typestore):
            connection = writer.add_connection(topic, kind, typestore=typestore)
            for t, message in zip(times, sent, strict=True):
                writer.write(connection, round(1e9 * (EPOCH + t)), typestore.serialize_cdr(message, kind))


def write_mdf(path):
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        for name, (t, values) in topics().items():
            file.append([Signal(v, t, name=key, unit="") for key, v in values.items()], acq_name=name)
        file.save(path)


def arrays():
    """The topics as nested arrays: n x 3 for the vectors."""
    (imu, inertial), (gps, velocity), (drive, commands) = topics().values()
    turns = np.stack([0.0 * imu, 0.0 * imu, inertial["r"]], axis=1)
    accelerations = np.stack([inertial["ax"], inertial["ay"], 0.0 * imu + 9.81], axis=1)
    return {
        "imu": {"t": imu, "gyro": turns, "acc": accelerations},
        "gps": {"t": gps, "velocity": np.stack(list(velocity.values()), axis=1)},
        "drive": {"t": drive, "steering_angle": commands["delta_cmd"]},
    }
