"""The fastest lap as a nonlinear programme: collocation at the middle of each step, solved by IPOPT.

After Perantoni & Limebeer (Vehicle System Dynamics 52, 2014): the way along the centre line is the
independent variable, the lap is periodic, and every point's states and every step's controls are unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nathlon.policies.lap_limit.guess import follow, quasi_steady
from nathlon.policies.lap_limit.model import CONTROLS, ROAD, STATES, point_of_lap
from nathlon.sim.car import Car
from nathlon.sim.physics.course import SURFACE_DRAG, SURFACE_GRIP
from nathlon.sim.track import (
    BANK,
    CURVATURE,
    KERB_LEFT,
    KERB_RIGHT,
    LEFT,
    RIGHT,
    RUNOFF_LEFT,
    RUNOFF_RIGHT,
    SLOPE,
    TANGENT_X,
    TANGENT_Y,
    WALL_LEFT,
    WALL_RIGHT,
    Track,
)

STEP_S = 0.1
"""Time from point to point, at the speed of the first guess."""
STEPS_M = (1.5, 10.0)
FIRST_BARRIER, SECOND_BARRIER = 1e-1, 1e-3
COARSER = 2.5
"""The lap is found on a mesh so much coarser first, where iterations are cheap."""
SLOWEST = 6.0
STEERING_COST = 1e-3  # s for each (rad/s)^2 s: without it the steering chatters where it hardly matters
PEDAL_COST = 1e-4  # s for each square of a change from step to step
SLIPS = 0.15
"""Largest slip ratio considered."""

SCALE = np.array([*STATES.values(), *CONTROLS.values()])
BALANCE_SCALE = np.array([1000.0] * 4 + [10.0] * 2)
TERMS = len(STATES) + 1 + len(BALANCE_SCALE) + 8
"""Of each step: gains of the states a metre, cost a metre, balance, room."""
HEADING = list(STATES).index("heading")
PEDAL = len(STATES) + list(CONTROLS).index("pedal")
IPOPT: dict[str, Any] = {
    "linear_solver": "mumps",
    "nlp_scaling_method": "none",
    "obj_scaling_factor": 100.0,  # hundredths of a second: its slopes are then as large as the other numbers
    "max_iter": 1000,
    "tol": 1e-3,
    "acceptable_tol": 1e-1,
    "acceptable_constr_viol_tol": 1e-4,
    "acceptable_obj_change_tol": 1e-6,
    "acceptable_iter": 5,
    "sb": "yes",
}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OptimalLap:
    """A lap at the limit.

    Attributes:
        lap_s: its time, s.
        distance: (n,) of each point along the centre line, m.
        step_s: (n,) time to the next point, s.
        states: (6, n) rows as in STATES.
        controls: (8, n) rows as in CONTROLS, from each point to the next.
        road: (15, n) rows as in ROAD, half-way to the next point.
        status: what IPOPT says.
        iterations: that it took.
    """

    lap_s: float
    distance: Array
    step_s: Array
    states: Array
    controls: Array
    road: Array
    status: str
    iterations: int

    @property
    def solved(self) -> bool:
        """Whether it is a solution."""
        return self.status in ("Solve_Succeeded", "Solved_To_Acceptable_Level")


def around(track: Track, values: Array, distance: Array) -> Array:
    """Values given for each row of the track, at distances along the lap, m."""
    places = np.arange(len(values) + 1) * track.spacing
    return np.interp(distance, places, np.append(values, values[0]))


def between(track: Track, distance: Array, values: Array, places: Array) -> Array:
    """Values given at distances along the lap (m), at other places."""
    return np.interp(places, distance, values, period=track.length)


def steps_of(track: Track, distance: Array) -> Array:
    """From each point to the next, m."""
    return np.append(np.diff(distance), track.length - distance[-1])


def mesh(track: Track, speed: Array, step_s: float) -> Array:
    """Distances of the points along the lap, m: `step_s` apart, but within STEPS_M."""
    fineness = step_s / STEP_S
    steps = np.clip(speed * step_s, STEPS_M[0] * fineness, STEPS_M[1] * fineness)
    # A point's step must not be long where that of its neighbours is short.
    count = np.concatenate([[0.0], np.cumsum(track.spacing / steps)])
    places = np.arange(len(count)) * track.spacing
    points = round(count[-1])
    return np.interp(np.arange(points) * count[-1] / points, count, places)


def road_at(track: Track, distance: Array) -> Array:
    """The road beside each point, (15, n) rows as in ROAD."""
    table = track.table
    grip, drag = np.array(SURFACE_GRIP), np.array(SURFACE_DRAG)
    left, right = table[:, RUNOFF_LEFT].astype(int), table[:, RUNOFF_RIGHT].astype(int)
    slope, bank = around(track, table[:, SLOPE], distance), around(track, table[:, BANK], distance)
    across = np.mod(np.roll(distance, -1) - np.roll(distance, 1), track.length)
    rows = {
        "curvature": around(track, table[:, CURVATURE], distance),
        "slope": slope,
        "bank": bank,
        "crest": (np.roll(slope, -1) - np.roll(slope, 1)) / across,
        "twist": (np.roll(bank, -1) - np.roll(bank, 1)) / across,
    }
    sides = {
        "left": (LEFT, KERB_LEFT, grip[left], drag[left], WALL_LEFT),
        "right": (RIGHT, KERB_RIGHT, grip[right], drag[right], WALL_RIGHT),
    }
    for side, (edge, kerb, runoff_grip, runoff_drag, wall) in sides.items():
        rows[side] = around(track, table[:, edge], distance)
        rows[f"kerb_{side}"] = around(track, table[:, kerb], distance)
        rows[f"grip_{side}"] = around(track, runoff_grip, distance)
        rows[f"drag_{side}"] = around(track, runoff_drag, distance)
        rows[f"wall_{side}"] = around(track, table[:, wall], distance)
    return np.stack([rows[name] for name in ROAD])


def limits(car: Car) -> tuple[Array, Array]:
    """Largest absolute values of states and controls, and the least ones where they differ."""
    most = np.array([150.0, 30.0, 5.0, np.inf, 1.2, car.steering.full_lock_rad])
    most = np.concatenate([most, [car.steering.rate_rad_s, 1.0, 100.0, 100.0], np.full(4, SLIPS)])
    least = -most
    least[0] = SLOWEST
    return least, most


def step_terms(car: Car) -> tuple[ca.Function, ca.Function, ca.Function]:
    """What cost and constraints are linear in, of one step: (TERMS,), with first and second derivatives.

    Functions of the unknowns in the middle of the step, in units of SCALE, and of the road there: the
    terms; their Jacobian; the Hessian of their sum with given weights.
    """
    unknowns, road = ca.SX.sym("w", len(SCALE)), ca.SX.sym("road", len(ROAD))
    values = SCALE * unknowns
    controls = values[len(STATES) :]
    rates, per_metre, balance, room, _ = point_of_lap(car)(values[: len(STATES)], controls, road)
    gains = rates * per_metre / SCALE[: len(STATES)]
    effort = STEERING_COST * controls[0] ** 2
    terms = ca.vertcat(gains, per_metre * (1.0 + effort), balance / BALANCE_SCALE, room)
    weights = ca.SX.sym("weights", TERMS)
    hessian, _ = ca.hessian(ca.dot(weights, terms), unknowns)
    options = {"cse": True}
    return (
        ca.Function("terms", [unknowns, road], [terms], options),
        ca.Function("slopes", [unknowns, road], [ca.jacobian(terms, unknowns)], options),
        ca.Function("bends", [unknowns, road, weights], [hessian], options),
    )


def blocks(values: ca.MX, width: int) -> ca.MX:
    """A block diagonal matrix of blocks that stand side by side."""
    return ca.diagcat(*ca.horzsplit(values, width))


def matrix(values: sparse.sparray) -> ca.DM:
    """A constant sparse matrix."""
    return ca.DM(sparse.csc_matrix(values))


def fastest_lap(track: Track, car: Car) -> OptimalLap:
    """The lap of least time that the car's equations and the rules allow.

    Args:
        track: the circuit.
        car: the car, with a full tank and new tyres.
    """
    rows = np.arange(len(track.table), dtype=np.float64) * track.spacing
    line = quasi_steady(track, car)
    coarse = mesh(track, line.speed, COARSER * STEP_S)
    guess = np.stack([around(track, row, coarse) for row in follow(line, car)])
    rough = solve(track, car, coarse, guess, FIRST_BARRIER)
    values = np.concatenate([rough.states, rough.controls])
    fine = mesh(track, between(track, rough.distance, rough.states[0], rows), STEP_S)
    refined = np.stack([between(track, rough.distance, row, fine) for row in values])
    return solve(track, car, fine, refined, SECOND_BARRIER)


def solve(track: Track, car: Car, distance: Array, guess: Array, barrier: float) -> OptimalLap:
    """The fastest lap on a mesh.

    Args:
        track, car: which.
        distance: (n,) of the points along the centre line, m.
        guess: (14, n) states and controls to begin with.
        barrier: parameter of IPOPT's to begin with: the smaller, the closer it stays to the guess.
    """
    n = len(distance)
    steps = steps_of(track, distance)
    road = road_at(track, np.mod(distance + 0.5 * steps, track.length))

    # Cost and constraints are linear in the steps' terms and the unknowns, but for the pedal's moves squared.
    here, following = sparse.eye_array(n), cyclic(n)
    gains = sparse.eye_array(len(STATES), TERMS)
    rest = sparse.eye_array(TERMS - len(STATES) - 1, TERMS, k=len(STATES) + 1)
    states, controls, pedal = (
        sparse.diags_array(np.isin(np.arange(len(SCALE)), chosen).astype(float))
        for chosen in (np.arange(len(STATES)), np.arange(len(STATES), len(SCALE)), PEDAL)
    )
    middle = sparse.kron(0.5 * (here + following), states) + sparse.kron(here, controls)
    of_terms = sparse.vstack([-sparse.kron(sparse.diags_array(steps), gains), sparse.kron(here, rest)])
    changes = sparse.kron(following - here, sparse.eye_array(len(STATES), len(SCALE)))
    of_unknowns = sparse.vstack([changes, sparse.csr_array((n * rest.shape[0], n * len(SCALE)))])
    moves = sparse.kron((following - here).T @ (following - here), pedal) * PEDAL_COST
    turns = np.zeros((n, len(STATES)))
    turns[:, HEADING] = heading_changes(track, distance) / SCALE[HEADING]
    constant = np.concatenate([turns.ravel(), np.zeros(n * rest.shape[0])])
    costs = np.zeros((n, TERMS))
    costs[:, len(STATES)] = steps

    step, slopes, bends = step_terms(car)
    unknowns = ca.MX.sym("x", n * len(SCALE))
    nothing, cost_factor, factors = ca.MX.sym("p", 0), ca.MX.sym("f"), ca.MX.sym("g", of_terms.shape[0])
    of_middle = matrix(middle)
    middles = ca.reshape(of_middle @ unknowns, len(SCALE), n)
    terms = ca.vec(step.map(n)(middles, road))
    cost = ca.dot(costs.ravel(), terms) + ca.dot(unknowns, matrix(moves) @ unknowns)
    constraints = matrix(of_terms) @ terms + matrix(of_unknowns) @ unknowns + constant
    by_middles = blocks(slopes.map(n)(middles, road), len(SCALE))
    jacobian = matrix(of_terms) @ by_middles @ of_middle + matrix(of_unknowns)
    weights = matrix(of_terms.T) @ factors + cost_factor * costs.ravel()
    second = blocks(bends.map(n)(middles, road, ca.reshape(weights, TERMS, n)), len(SCALE))
    hessian = ca.triu(of_middle.T @ second @ of_middle + 2.0 * cost_factor * matrix(moves))

    lower, upper = np.zeros(of_terms.shape[0]), np.zeros(of_terms.shape[0])
    upper[n * len(STATES) :].reshape(n, -1)[:, len(BALANCE_SCALE) :] = np.inf
    least, most = (np.tile(bound / SCALE, n) for bound in limits(car))
    solver = ca.nlpsol(
        "lap",
        "ipopt",
        {"x": unknowns, "f": cost, "g": constraints},
        {
            "jac_g": ca.Function("jac_g", [unknowns, nothing], [constraints, jacobian]),
            "hess_lag": ca.Function("hess_lag", [unknowns, nothing, cost_factor, factors], [hessian]),
            "print_time": False,
            "error_on_fail": False,
            "ipopt": {**IPOPT, "mu_init": barrier, "print_level": 0},
        },
    )
    found = solver(x0=(guess / SCALE[:, None]).ravel("F"), lbx=least, ubx=most, lbg=lower, ubg=upper)
    values = np.array(found["x"]).reshape(n, -1).T * SCALE[:, None]
    split = len(STATES)
    between_points = np.reshape(middle @ (values / SCALE[:, None]).ravel("F"), (n, -1)).T * SCALE[:, None]
    step_times = (
        steps * np.array(point_of_lap(car).map(n)(between_points[:split], values[split:], road)[1]).ravel()
    )
    return OptimalLap(
        lap_s=float(step_times.sum()),
        distance=distance,
        step_s=step_times,
        states=values[:split],
        controls=values[split:],
        road=road,
        status=str(solver.stats()["return_status"]),
        iterations=int(solver.stats()["iter_count"]),
    )


def cyclic(n: int) -> sparse.csr_array:
    """The matrix that takes each point's value to the point before, (n, n)."""
    rows = np.arange(n)
    return sparse.csr_array((np.ones(n), (rows, (rows + 1) % n)), shape=(n, n))


def heading_changes(track: Track, distance: Array) -> Array:
    """Turn of the centre line from each point to the next, rad."""
    direction = np.unwrap(np.arctan2(track.table[:, TANGENT_Y], track.table[:, TANGENT_X]))
    whole = direction[0] + 2.0 * np.pi * round((direction[-1] - direction[0]) / (2.0 * np.pi))
    places = np.arange(len(direction) + 1) * track.spacing
    return np.diff(np.interp(np.append(distance, track.length), places, np.append(direction, whole)))
