"""Waterway, turbine, rotor, grid and speed governor of a small hydro unit, in per unit of its ratings.

The guide vanes are moved by somebody else: `Plant.advance` takes the opening of the servomotor and returns nothing but time.

  water column, rigid   T_w q' = 1 - h - f q^2               (Wylie and Streeter 1993, chapter 1)
  turbine               q = y sqrt(h),  P_m = A h (q - q_nl)  (IEEE Working Group 1992, nonlinear model)
  rotor                 T_a w' = (P_m - P_e) / w              (Kundur 1994, section 3.9)
  grid, infinite        d' = w_b (w - 1),  P_e = P_max sin d + D (w - 1)
  grid, islanded        P_e = P_load (1 + k (w - 1))
  governor              y_c = y_0 + PID(1 - w) with transient and permanent droop
  guide vanes           F = -(F_0 + F_1 y) (h - 1): what the head of now adds to the load that the twin has on its sheet
"""

import math
from dataclasses import dataclass, field

WATER_STARTING_TIME_S = 1.1
MECHANICAL_STARTING_TIME_S = 8.0
HEAD_LOSS = 0.02
NO_LOAD_FLOW = 0.06
TURBINE_GAIN = 1.0 / ((1.0 - HEAD_LOSS) * (math.sqrt(1.0 - HEAD_LOSS) - NO_LOAD_FLOW))
GRID_POWER_MAX = 1.8
GRID_DAMPING = 15.0
BASE_SPEED_RAD_S = 2.0 * math.pi * 50.0
LOAD_SELF_REGULATION = 1.0
VANE_LOAD_CLOSED_N = 1.5e5
VANE_LOAD_SLOPE_N = 2.5e5
GOVERNOR_GAIN = 2.0
GOVERNOR_INTEGRAL_1_S = 0.35
GOVERNOR_DERIVATIVE_S = 1.0
PERMANENT_DROOP = 0.04
LEAST_OPENING = 0.005


@dataclass
class Plant:
    """The unit's state; `breaker` is `grid`, `island` or `open`."""

    load: float
    breaker: str
    time_s: float = 0.0
    flow: float = 0.0
    speed: float = 1.0
    angle: float = 0.0
    opening: float = 0.0
    integral: float = 0.0
    last_speed: float = 1.0
    opening_reference: float = field(init=False)

    def __post_init__(self):
        # The steady state for this load: flow, head and opening by bisection.
        low, high = 0.0, 1.2
        for _ in range(60):
            self.flow = 0.5 * (low + high)
            low, high = (self.flow, high) if self.power_of(self.flow) < self.load else (low, self.flow)
        self.opening = self.flow / math.sqrt(1.0 - HEAD_LOSS * self.flow**2)
        self.opening_reference = self.opening
        self.angle = math.asin(self.load / GRID_POWER_MAX)

    @staticmethod
    def power_of(flow):
        head = 1.0 - HEAD_LOSS * flow**2
        return TURBINE_GAIN * head * (flow - NO_LOAD_FLOW)

    @property
    def head(self):
        return (self.flow / max(self.opening, LEAST_OPENING)) ** 2

    @property
    def mechanical_power(self):
        return TURBINE_GAIN * self.head * (self.flow - NO_LOAD_FLOW)

    @property
    def electrical_power(self):
        if self.breaker == "open":
            return 0.0
        if self.breaker == "island":
            return self.load * (1.0 + LOAD_SELF_REGULATION * (self.speed - 1.0))
        return GRID_POWER_MAX * math.sin(self.angle) + GRID_DAMPING * (self.speed - 1.0)

    def vane_force_n(self):
        """Force on the piston besides the sheet's load at rated head, + opens."""
        return -(VANE_LOAD_CLOSED_N + VANE_LOAD_SLOPE_N * self.opening) * (self.head - 1.0)

    def derivatives(self, flow, speed, angle):
        self.flow, self.speed, self.angle = flow, speed, angle
        return ((1.0 - self.head - HEAD_LOSS * flow * abs(flow)) / WATER_STARTING_TIME_S,
                (self.mechanical_power - self.electrical_power) / max(speed, 0.1) / MECHANICAL_STARTING_TIME_S,
                BASE_SPEED_RAD_S * (speed - 1.0) if self.breaker == "grid" else 0.0)

    def advance(self, opening, seconds, steps=10):
        """Advances by classic Runge-Kutta while the opening runs linearly to `opening`."""
        begin, step_s = self.opening, seconds / steps
        for step in range(steps):
            state = (self.flow, self.speed, self.angle)
            at = lambda share: begin + (opening - begin) * (step + share) / steps
            slopes = []
            for share, weight in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.5), (1.0, 1.0)):
                self.opening = at(share)
                moved = state if not slopes else tuple(x + weight * step_s * k for x, k in zip(state, slopes[-1]))
                slopes.append(self.derivatives(*moved))
            self.flow, self.speed, self.angle = (
                x + step_s / 6.0 * (a + 2.0 * b + 2.0 * c + d) for x, a, b, c, d in zip(state, *slopes))
            self.opening = at(1.0)
        self.time_s += seconds

    def command(self, seconds):
        """The governor's opening command, once each period."""
        error = 1.0 - self.speed
        slope = (self.last_speed - self.speed) / seconds
        self.last_speed = self.speed
        raw = (self.opening_reference + GOVERNOR_GAIN * error + self.integral + GOVERNOR_DERIVATIVE_S * slope)
        command = min(max(raw, 0.0), 1.0)
        # Permanent droop by feeding the command back; no winding up at the limits.
        drift = GOVERNOR_INTEGRAL_1_S * (error - PERMANENT_DROOP * (command - self.opening_reference))
        if raw == command or (raw > command) == (drift < 0.0):
            self.integral += drift * seconds
        return command


def pressure_rise_bound(flow, closing_time_s):
    """Largest head rise of a rigid column under linear closure (Micaud 1903; Chaudhry 2014, section 3.7)."""
    k = (WATER_STARTING_TIME_S * flow / closing_time_s) ** 2
    return k / 2.0 + math.sqrt(k * k / 4.0 + k)
