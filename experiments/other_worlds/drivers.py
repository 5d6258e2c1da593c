"""Drivers of a day: open-loop steering, speed held by torque, and a car that slides is caught."""

import dataclasses

import numpy as np

from drift_drake.car.double_track.parameters import CARS, DoubleTrackParameters
from drift_drake.car.parameters import VehicleParameters
from experiments.benchmarks.drivers import STEERING_RATE, TORQUE_RATE, slewed

DAY_ONE = ("slalom", "power", "transient", "circle")
OTHER = ("lane_change", "lift_off", "two_circles", "sweep")
"""Manoeuvres of other days, at speeds and steering frequencies that day one mostly lacks."""

SPEED_GAIN = 0.3  # [1/s] acceleration asked for over an error in speed
RESISTANCE = 0.2  # [m/s^2] that a held speed takes
CATCH = 0.15  # [rad] of sideslip at which the driver steers against it and comes off the throttle
START_SPEED = 9.0  # [m/s] of a day-one run
TOP_SPEED = 24.0  # [m/s]
SPIN, SLOWEST = 1.0, 4.0  # [rad], [m/s] at which a run ends
FULL_SIZE = 2.5  # [m] wheelbase of the car that these figures are for


class DayDriver:
    """Commands of one manoeuvre, row by row; its draws are fixed at construction.

    Steering is in road-wheel radians, scaled by the car's wheelbase; torque by the one that gives 1 m/s^2. `effort`
    is the share of the steering and of the thrust that a manoeuvre of `DAY_ONE` is driven with.
    """

    def __init__(self, kind: str, rng: np.random.Generator, car: DoubleTrackParameters, effort: float = 1.0) -> None:
        if kind not in DAY_ONE + OTHER:
            raise ValueError(f"unknown manoeuvre {kind}; there are {', '.join(DAY_ONE + OTHER)}")
        self.kind, self.car, self.effort = kind, car, effort
        self.torque_unit = car.mass * car.wheel_radius / car.gear_ratio  # [N m] for 1 m/s^2
        self.wheelbase = car.front_axle_distance + car.rear_axle_distance
        u = rng.uniform
        self.side = 1.0 if u() < 0.5 else -1.0
        self.slow, self.fast = u(0.2, 0.45), u(0.5, 1.0)  # [Hz]
        self.phases = u(0.0, 2.0 * np.pi, 3)
        self.amplitude = u(0.05, 0.12) * self.wheelbase / 2.5  # [rad]
        self.speed = {"lane_change": u(17.0, 21.0), "lift_off": u(14.0, 18.0), "two_circles": u(7.0, 9.0),
                      "sweep": u(16.0, 21.0)}.get(kind, u(10.0, 16.0))  # fmt: skip
        self.period = {"lane_change": u(1.6, 2.4), "lift_off": u(4.5, 6.0)}.get(kind, u(5.0, 6.5))  # [s]
        self.share = u(0.6, 0.95)  # of the friction that the other days' turns ask for

    def start(self) -> np.ndarray:
        """First state (r, v, beta, omega_r): straight on."""
        speed = self.speed if self.kind in OTHER else START_SPEED
        return np.array([0.0, speed, 0.0, speed])

    def _wave(self, frequency: float, t: float, phase: int) -> float:
        return float(np.sin(2.0 * np.pi * frequency * t + self.phases[phase]))

    def _hold(self, speed: float, v: float) -> float:
        return SPEED_GAIN * (speed - v) + RESISTANCE

    def _turn(self, speed: float) -> float:
        """Road-wheel angle [rad] for the driver's share of friction at a speed [m/s], without slip."""
        return self.wheelbase * self.share * self.car.gravity * self.car.front_tire.lateral_friction / speed**2

    def _as_day_one(self, t: float, v: float) -> tuple[float, float]:
        """Steering [rad] and acceleration [m/s^2] of the manoeuvres of `DAY_ONE`."""
        if self.kind == "slalom":
            delta = self.amplitude * (self._wave(self.slow, t, 0) + 0.4 * self._wave(self.fast, t, 1))
            return delta, self._hold(self.speed, v)
        if self.kind == "power":
            thrust = 0.5 + 2.4 * max(0.0, self._wave(0.22, t, 2)) if v < 21.0 else -0.5
            return 0.6 * self.amplitude * self._wave(self.slow, t, 0), thrust
        kick = float(self._wave(self.fast, t, 1) > 0.4)
        scale = self.wheelbase / 2.5
        if self.kind == "transient":
            return 0.14 * scale * np.sign(self._wave(self.slow, t, 0)), self._hold(self.speed, v) + 1.0 * kick
        delta = self.side * scale * (0.12 + 0.03 * self._wave(self.slow, t, 0))
        return delta, self._hold(8.0 + 0.7 * t, v) + 2.2 * kick

    def _as_other(self, t: float, v: float) -> tuple[float, float]:
        """Steering [rad] and acceleration [m/s^2] of the manoeuvres of `OTHER`."""
        if self.kind == "lane_change":  # there, a second's pause, and back
            cycle, place = divmod(t, self.period + 1.0)
            wave = np.sin(2.0 * np.pi * place / self.period) if place < self.period else 0.0
            side = self.side if cycle % 2 == 0 else -self.side
            return side * self._turn(self.speed) * wave, self._hold(self.speed, v)
        if self.kind == "lift_off":  # into a turn at speed, then off the throttle, then on again
            cycle, place = divmod(t, self.period)
            side = self.side if cycle % 2 == 0 else -self.side
            held = min(1.0, 2.0 * place) * min(1.0, 2.0 * (self.period - place))
            off = 0.3 * self.period < place < 0.6 * self.period
            return side * self._turn(self.speed) * held, -2.0 if off else 2.0 * self._hold(self.speed, v)
        if self.kind == "two_circles":  # a slow tight one, then a fast wide one
            speed = self.speed if t < self.period else 2.1 * self.speed
            return self.side * self._turn(max(v, self.speed)), 2.0 * self._hold(speed, v)
        frequency_time = 0.2 * t + 0.5 * 0.2 * t * t  # cycles of a sweep from 0.2 Hz that gains 0.2 Hz a second
        return self._turn(self.speed) * np.sin(2.0 * np.pi * frequency_time), self._hold(self.speed, v)

    def wanted(self, t: float, v: float, beta: float) -> tuple[float, float]:
        """Steering [rad] and acceleration [m/s^2] at a time [s], speed [m/s] and sideslip [rad]."""
        if self.kind in OTHER:
            delta, thrust = self._as_other(t, v)
        else:
            delta, thrust = (self.effort * q for q in self._as_day_one(t, v))
        if v > TOP_SPEED:
            thrust = min(thrust, 0.0)
        if abs(beta) > CATCH:
            delta, thrust = 0.3 * delta + beta, min(thrust, RESISTANCE)
        return delta, thrust

    def command(self, t: float, state: np.ndarray, last: tuple[float, float]) -> tuple[float, float]:
        """Commands a row later, from the time [s], the state (r, v, beta, ...) and the last commands."""
        delta, thrust = self.wanted(t, float(state[1]), float(state[2]))
        car = self.car
        return (
            slewed(delta, last[0], STEERING_RATE, -car.steering_limit, car.steering_limit),
            slewed(thrust * self.torque_unit, last[1], TORQUE_RATE, car.torque_min, car.torque_max),
        )


class ScaledDriver:
    """The manoeuvres of `DayDriver` on a car of any size, at the same accelerations (Froude's law of similarity).

    Attributes:
        time: its unit and that of speeds, over a full-size car's; start_speed: of a run [m/s].
    """

    def __init__(self, kind: str, rng: np.random.Generator, car: VehicleParameters, effort: float = 1.0) -> None:
        self.car = car
        self.time = float(np.sqrt((car.front_axle_distance + car.rear_axle_distance) / FULL_SIZE))
        grip = dataclasses.replace(CARS["coupe"].front_tire, lateral_friction=car.friction)
        half = 0.5 * FULL_SIZE
        full_size = CARS["coupe"].replace(front_axle_distance=half, rear_axle_distance=half, front_tire=grip)
        self.driver = DayDriver(kind, rng, full_size, effort)
        self.start_speed = self.time * float(self.driver.start()[1])
        self.torque_unit = car.mass * car.wheel_radius / car.gear_ratio  # [N m] for 1 m/s^2

    def command(self, t: float, v: float, beta: float, last: tuple[float, float]) -> tuple[float, float]:
        """Commands a row later, from the time [s], speed [m/s], sideslip [rad] and the last commands."""
        delta, thrust = self.driver.wanted(t / self.time, v / self.time, beta)
        car, torque_rate = self.car, TORQUE_RATE * self.torque_unit / self.driver.torque_unit
        return (
            slewed(delta, last[0], STEERING_RATE / self.time, -car.steering_limit, car.steering_limit),
            slewed(thrust * self.torque_unit, last[1], torque_rate / self.time, car.torque_min, car.torque_max),
        )
