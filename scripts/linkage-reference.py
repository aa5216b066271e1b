#!/usr/bin/env python3
"""Reference numbers of suspension linkages by the multibody package exudyn: testdata/linkages.csv, live-axle.csv.

    python3 -m venv target/venv-exudyn && target/venv-exudyn/bin/pip install exudyn==1.13.6
    target/venv-exudyn/bin/python scripts/linkage-reference.py

Each corner is built of rigid bodies, ideal joints and rods from the hard-points of a vehicle file. The length of the
strut is a constraint, and a force with a moment acts on the carrier of the wheel. The static solution gives positions,
attitude, forces in the members and the force of the strut. Derivatives are central differences of positions, of fourth
order.

A live axle on five links and two springs has one length too many. Its links are elongated by s t, with the state of
self-stress s of the design position and the number t at which the springs have the wanted lengths.

Frame: that of the vehicle file, left corner (origin on the ground below the middle of the wheel centres).
"""

import csv
import sys
import tomllib
from pathlib import Path

import exudyn as exu
import numpy as np
from exudyn.utilities import RigidBodyInertia

ROOT = Path(__file__).resolve().parent.parent
GRAVITY = 9.80665
# Differences for derivatives, m; positions are solved to 1e-13 m.
STEP_M = 3e-4
# Force, N, and moment about the wheel centre, N m, of the ground on the wheel.
FORCE = np.array([1200.0, -2300.0, 4100.0])
MOMENT = np.array([760.0, 310.0, -95.0])
# Travel of strut and rack from the design position, m.
STRUTS = (-0.05, 0.0, 0.04)
RACKS = (-0.04, 0.0, 0.03)
NAMES = ("upper_front", "upper_rear", "lower_front", "lower_rear", "tie_rod")


def unit(vector):
    return vector / np.linalg.norm(vector)


class System:
    """Bodies and joints between points of the design position."""

    def __init__(self):
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground = self.mbs.CreateGround()
        self.places = {self.ground: np.zeros(3)}
        self.settings = exu.SimulationSettings()
        self.settings.solution.file.write = False
        newton = self.settings.staticSolver.newton
        newton.relativeTolerance = 1e-12
        newton.absoluteTolerance = 1e-9
        newton.maxIterations = 50

    def body(self, cg, mass):
        inertia = RigidBodyInertia(mass=max(mass, 1e-9), com=[0, 0, 0], inertiaTensor=np.eye(3) * 0.1)
        made = self.mbs.CreateRigidBody(
            referencePosition=list(cg), inertia=inertia, gravity=[0, 0, -GRAVITY]
        )
        self.places[made] = np.array(cg)
        return made

    def local(self, body, point):
        return list(np.array(point) - self.places[body])

    def joint(self, a, b, point, free_about=None, free_along=None):
        """A ball joint; a hinge about an axis or a slide along one."""
        if free_about is None and free_along is None:
            return self.mbs.CreateSphericalJoint(itemNumbers=[a, b], position=list(point))
        axis = unit(free_along if free_about is None else free_about)
        across = unit(np.cross(axis, [0.0, 0.3, 1.0]))
        axes = np.column_stack([np.cross(across, axis), across, axis])
        free = [1, 1, 1, 1, 1, 0] if free_along is None else [1, 1, 0, 1, 1, 1]
        return self.mbs.CreateGenericJoint(
            itemNumbers=[a, b], position=list(point), rotationMatrixAxes=axes, constrainedAxes=free
        )

    def rod(self, a, b, from_a, to_b):
        """A rod without mass between two points."""
        return self.mbs.CreateDistanceConstraint(
            itemNumbers=[a, b], localPosition0=self.local(a, from_a), localPosition1=self.local(b, to_b)
        )

    def link(self, carrier, inner, outer, mass):
        """A link with mass: joints at both ends, one of which holds it about its own axis."""
        body = self.body((np.array(inner) + outer) / 2, mass)
        axis = unit(np.array(outer) - inner)
        across = unit(np.cross(axis, [0.0, 0.3, 1.0]))
        axes = np.column_stack([axis, across, np.cross(axis, across)])
        self.mbs.CreateGenericJoint(
            itemNumbers=[self.ground, body],
            position=list(inner),
            rotationMatrixAxes=axes,
            constrainedAxes=[1, 1, 1, 1, 0, 0],
        )
        return body, self.joint(body, carrier, outer)

    def load(self, body, point):
        at = self.local(body, point)
        self.mbs.CreateForce(itemNumber=body, loadVector=list(FORCE), localPosition=at)
        self.mbs.CreateTorque(itemNumber=body, loadVector=list(MOMENT), localPosition=at)

    def solve(self):
        if not self.mbs.SolveStatic(self.settings, updateInitialValues=True):
            sys.exit("exudyn found no static solution")

    def set(self, item, name, value):
        self.mbs.SetObjectParameter(item, name, value)

    def at(self, body, point):
        local = self.local(body, point)
        output = exu.OutputVariableType.Position
        return np.array(self.mbs.GetObjectOutputBody(body, output, local))

    def turned(self, body):
        output = exu.OutputVariableType.RotationMatrix
        return np.array(self.mbs.GetObjectOutputBody(body, output, [0, 0, 0])).reshape(3, 3)

    def tension(self, rod):
        return -float(self.mbs.GetObjectOutput(rod, exu.OutputVariableType.Force))

    def force(self, ball):
        """Force of the first body of a ball joint on the second."""
        return np.array(self.mbs.GetObjectOutput(ball, exu.OutputVariableType.Force))


class Corner:
    """One left corner: system, carrier of the wheel, strut, and what its members carry."""

    def __init__(self, axle):
        self.system = System()
        self.masses = axle["unsprung"]
        self.members = None
        self.tie_rod = None
        self.rack = 0.0

    def build(self, points, cg_m, others):
        """The carrier with wheel and upright as one body."""
        wheel, upright = self.masses["wheel_mass_kg"], self.masses["upright_mass_kg"]
        centre = np.array(points["wheel_centre_m"])
        whole = sum(mass for mass, _ in others) + wheel + upright
        cg = wheel * centre + upright * np.array(cg_m) + sum(mass * np.array(at) for mass, at in others)
        self.centre = centre
        self.carrier = self.system.body(cg / whole, whole)
        self.system.load(self.carrier, centre)

    def add_tie_rod(self, inner, outer):
        self.tie_rod = self.system.rod(self.system.ground, self.carrier, inner, outer)
        self.rod_ends = np.array(inner), np.array(outer)

    def add_strut(self, body, chassis, end):
        self.strut = self.system.rod(self.system.ground, body, chassis, end)
        self.length = np.linalg.norm(np.array(end) - chassis)

    def place(self, strut_m, rack_m):
        # Rods in front of the king-pin pull to the left.
        self.system.set(self.strut, "distance", self.length + strut_m)
        if self.tie_rod is not None:
            marker = self.system.mbs.GetObjectParameter(self.tie_rod, "markerNumbers")[0]
            inner = self.rod_ends[0] + [0.0, self.direction * rack_m, 0.0]
            self.system.mbs.SetMarkerParameter(marker, "localPosition", list(inner))
        self.system.solve()
        return self.system.at(self.carrier, self.centre), self.system.turned(self.carrier)

    def strut_push(self):
        return -self.system.tension(self.strut)

    def rod_tension(self):
        return self.system.tension(self.tie_rod)


def side(points):
    """The way of the rack that steers left: by the tie rod before or behind the king-pin."""
    outer = np.array(points["tie_rod_outer_m"])
    lower, upper = points["lower"], points["upper"]
    axis = unit(upper - lower)
    lever = outer - lower
    return -1.0 if (lever - axis * axis.dot(lever))[0] < 0 else 1.0


def arm_parts(force, ball, hinges):
    """Tensions of the legs of an arm that pull the upright with this force at its ball joint, in the plane of the arm."""
    legs = np.column_stack([unit(np.array(hinge) - ball) for hinge in hinges])
    return np.linalg.lstsq(legs, force, rcond=None)[0]


def wishbone(axle):
    p, corner = axle["wishbone"], Corner(axle)
    system, masses = corner.system, corner.masses
    middle = (np.array(p["upper_ball_m"]) + p["lower_ball_m"]) / 2
    corner.build(p, masses.get("upright_cg_m", middle), [])
    joints, bodies = {}, {}
    for name in ("upper", "lower"):
        front, rear, ball = (np.array(p[f"{name}_{part}_m"]) for part in ("front", "rear", "ball"))
        cg = masses.get(f"{name}_arm_cg_m", (front + rear) / 4 + ball / 2)
        bodies[name] = system.body(cg, masses[f"{name}_arm_mass_kg"])
        system.joint(system.ground, bodies[name], rear, free_about=front - rear)
        joints[name] = system.joint(bodies[name], corner.carrier, ball)
    corner.add_tie_rod(p["tie_rod_inner_m"], p["tie_rod_outer_m"])
    corner.add_strut(bodies["lower"], p["strut_chassis_m"], p["strut_arm_m"])
    corner.direction = side(p | {"lower": np.array(p["lower_ball_m"]), "upper": np.array(p["upper_ball_m"])})

    def members():
        found = []
        for name in ("upper", "lower"):
            ball = system.at(corner.carrier, p[f"{name}_ball_m"])
            hinges = [p[f"{name}_front_m"], p[f"{name}_rear_m"]]
            found += list(arm_parts(system.force(joints[name]), ball, hinges))
        return [*found, corner.rod_tension(), corner.strut_push()]

    corner.members = members
    return corner


def macpherson(axle):
    p, corner = axle["macpherson"], Corner(axle)
    system, masses = corner.system, corner.masses
    ball, top, low = (np.array(p[name]) for name in ("lower_ball_m", "strut_top_m", "strut_low_m"))
    corner.build(p, masses.get("upright_cg_m", (low + ball) / 2), [])
    front, rear = np.array(p["lower_front_m"]), np.array(p["lower_rear_m"])
    cg = masses.get("lower_arm_cg_m", (front + rear) / 4 + ball / 2)
    arm = system.body(cg, masses["lower_arm_mass_kg"])
    system.joint(system.ground, arm, rear, free_about=front - rear)
    joint = system.joint(arm, corner.carrier, ball)
    piston = system.body(top, 0.0)
    at_top = system.joint(system.ground, piston, top)
    system.joint(piston, corner.carrier, top, free_along=low - top)
    corner.add_tie_rod(p["tie_rod_inner_m"], p["tie_rod_outer_m"])
    corner.add_strut(corner.carrier, top, low)
    corner.direction = side(p | {"lower": ball, "upper": top})

    def members():
        turned = system.turned(corner.carrier)
        along = unit(low - top)
        forward = unit(np.array([1.0, 0.0, 0.0]) - along * along[0])
        across = [turned @ forward, turned @ np.cross(forward, along)]
        # The strut is a rod beside the piston: the joint at the top carries the rest.
        at = [system.force(at_top).dot(direction) for direction in across]
        legs = arm_parts(system.force(joint), system.at(corner.carrier, ball), [front, rear])
        return [*at, *legs, corner.rod_tension(), corner.strut_push()]

    corner.members = members
    return corner


def five_link(axle):
    p, corner = axle["five_link"], Corner(axle)
    system, masses = corner.system, corner.masses
    ends = [[np.array(p[f"{name}_{end}_m"]) for end in ("inner", "outer")] for name in NAMES]
    outer = [end for _, end in ends]
    upper, lower = (outer[0] + outer[1]) / 2, (outer[2] + outer[3]) / 2
    corner.build(p, masses.get("upright_cg_m", (upper + lower) / 2), [])
    corner.direction = side(p | {"lower": lower, "upper": upper})
    halves = [masses["upper_arm_mass_kg"] / 2] * 2 + [masses["lower_arm_mass_kg"] / 2] * 2
    links = [system.link(corner.carrier, *end, mass) for end, mass in zip(ends, halves)]
    corner.add_tie_rod(*ends[4])
    on = p.get("strut_on", "upright")
    body = corner.carrier if on == "upright" else links[NAMES.index(on)][0]
    corner.add_strut(body, p["strut_chassis_m"], p["strut_mount_m"])

    def members():
        found = []
        for (_, joint), (inner, end) in zip(links, ends):
            pull = unit(inner - system.at(corner.carrier, end))
            found.append(system.force(joint).dot(pull))
        return [*found, corner.rod_tension(), corner.strut_push()]

    corner.members = members
    return corner


def trailing_arm(axle):
    p, corner = axle["trailing_arm"], Corner(axle)
    system, masses = corner.system, corner.masses
    outer, inner, centre = (np.array(p[name]) for name in ("outer_bushing_m", "inner_bushing_m", "wheel_centre_m"))
    cg = masses.get("lower_arm_cg_m", (outer + inner) / 4 + centre / 2)
    corner.build(p, masses.get("upright_cg_m", centre), [(masses["lower_arm_mass_kg"], cg)])
    axis = unit(outer - inner)
    forward = unit(np.array([1.0, 0.0, 0.0]) - axis * axis[0])
    upward = np.cross(forward, axis)
    upward *= np.sign(upward[2])
    # The inner bushing is a ball joint, the outer one slides along the line of both.
    at_inner = system.joint(system.ground, corner.carrier, inner)
    axes = np.column_stack([forward, np.cross(axis, forward), axis])
    at_outer = system.mbs.CreateGenericJoint(
        itemNumbers=[system.ground, corner.carrier],
        position=list(outer),
        rotationMatrixAxes=axes,
        constrainedAxes=[1, 1, 0, 0, 0, 0],
    )
    corner.add_strut(corner.carrier, p["strut_chassis_m"], p["strut_arm_m"])

    def members():
        local = np.array(system.mbs.GetObjectOutput(at_outer, exu.OutputVariableType.ForceLocal))
        far, near = axes @ local, system.force(at_inner)
        across = [force.dot(direction) for force in (far, near) for direction in (forward, upward)]
        return [*across, near.dot(axis), corner.strut_push()]

    corner.members = members
    return corner


BUILDERS = {"wishbone": wishbone, "macpherson": macpherson, "five_link": five_link, "trailing_arm": trailing_arm}
FILES = (
    ("crates/model/vehicles/prowler.toml", "front"),
    ("crates/model/vehicles/prowler.toml", "rear"),
    ("testdata/vehicle-with-struts.toml", "front"),
    ("testdata/vehicle-with-links.toml", "front"),
    ("testdata/vehicle-with-links.toml", "rear"),
    ("testdata/vehicle-with-trailing-arms.toml", "rear"),
)


def slopes_at(place, at):
    """Derivatives of centre and rotation by both coordinates."""
    _, middle = place(*at)

    def seen(coordinate, steps):
        moved = list(at)
        moved[coordinate] += steps * STEP_M
        centre, turned = place(*moved)
        # The vector of the skew part of R is w (1 - w^2/6): its derivative at 0 is that of the rotation.
        skew = turned @ middle.T
        turn = [skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]]
        return np.concatenate([centre, np.array(turn) / 2])

    def slope(coordinate):
        near = seen(coordinate, 1) - seen(coordinate, -1)
        far = seen(coordinate, 2) - seen(coordinate, -2)
        return list((8 * near - far) / (12 * STEP_M))

    return slope(0) + slope(1)


LINES = [
    *[(f"{name}_link", side) for name in ("lower", "upper") for side in (1.0, -1.0)],
    ("panhard", None),
    ("spring", 1.0),
    ("spring", -1.0),
]


# The upper right link.
FREE_LINK = 3


class Axle:
    """A live axle on links and springs: all lengths but that of the upper right link are constraints."""

    def __init__(self, axle):
        p, masses = axle["live_axle"], axle["unsprung"]
        self.system = system = System()
        mirror = lambda point, side: np.array(point) * [1.0, 1.0 if side is None else side, 1.0]
        centres = [mirror(p["wheel_centre_m"], side) for side in (1.0, -1.0)]
        wheel, axle_kg = masses["wheel_mass_kg"], 2 * masses["upright_mass_kg"]
        whole = axle_kg + 2 * wheel
        self.centre = sum(centres) / 2
        self.carrier = system.body((axle_kg * np.array(p["cg_m"]) + wheel * sum(centres)) / whole, whole)
        for centre in centres:
            system.load(self.carrier, centre)
        self.ends = [[mirror(p[f"{name}_{end}_m"], side) for end in ("body", "axle")] for name, side in LINES]
        self.lengths = [np.linalg.norm(end - body) for body, end in self.ends]
        kept = [k for k in range(7) if k != FREE_LINK]
        self.rods = {k: system.rod(system.ground, self.carrier, *self.ends[k]) for k in kept}
        lines = [unit(body - end) for body, end in self.ends]
        columns = [np.concatenate([line, np.cross(end - self.centre, line)]) for line, (_, end) in zip(lines, self.ends)]
        stress = np.linalg.svd(np.array(columns).T)[2][-1][:5]
        self.stress = stress / np.linalg.norm(stress)

    def miss_m(self, lengths_m, elongation):
        """Error of the length of the link that is no constraint."""
        stretched = self.stress * elongation
        wanted = dict(enumerate([*stretched, *lengths_m]))
        for k, rod in self.rods.items():
            self.system.set(rod, "distance", self.lengths[k] + wanted[k])
        self.system.solve()
        body, end = self.ends[FREE_LINK]
        found = np.linalg.norm(self.system.at(self.carrier, end) - body)
        return found - self.lengths[FREE_LINK] - stretched[FREE_LINK]

    def place(self, *lengths_m):
        before, now = 0.0, 1e-4
        missed = self.miss_m(lengths_m, before)
        for _ in range(30):
            miss = self.miss_m(lengths_m, now)
            if abs(miss) < 1e-15 or miss == missed:
                break
            before, now, missed = now, now - miss * (now - before) / (miss - missed), miss
        self.elongation = now
        return self.system.at(self.carrier, self.centre), self.system.turned(self.carrier)

    def members(self):
        """Forces without one of the links: others differ from them by a self-stress."""
        tensions = np.zeros(7)
        for k, rod in self.rods.items():
            tensions[k] = self.system.tension(rod)
        return [*tensions[:5], *-tensions[5:]]


def axle_rows():
    file = tomllib.loads((ROOT / "crates/model/vehicles/second-vehicle.toml").read_text())
    for lengths in ((0.0, 0.0), (-0.04, -0.04), (0.05, 0.05), (-0.04, 0.05), (0.02, -0.03)):
        axle = Axle(file["rear"])
        for part in (0.25, 0.5, 0.75, 1.0):
            centre, turned = axle.place(part * lengths[0], part * lengths[1])
        members, elongation = axle.members(), abs(axle.elongation)
        slopes = slopes_at(axle.place, lengths)
        yield [*lengths, *(centre - axle.centre), *turned.flat, elongation, *members, *slopes]


def rows():
    for path, name in FILES:
        axle = tomllib.loads((ROOT / path).read_text())[name]
        kind = next(kind for kind in BUILDERS if kind in axle)
        racks = RACKS if name == "front" else (0.0,)
        for strut_m in STRUTS:
            for rack_m in racks:
                corner = BUILDERS[kind](axle)
                for part in (0.25, 0.5, 0.75, 1.0):
                    centre, turned = corner.place(part * strut_m, part * rack_m)
                members = corner.members()
                slopes = slopes_at(corner.place, (strut_m, rack_m))
                yield [path, name, kind, strut_m, rack_m, *(centre - corner.centre), *turned.flat, *members, *slopes]


def write(name, head, found):
    with (ROOT / "testdata" / name).open("w", newline="") as file:
        file.write(f"# scripts/linkage-reference.py with exudyn {exu.__version__}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        for row in found:
            writer.writerow([value if isinstance(value, str) else f"{value:.13g}" for value in row])


def slope_names(*coordinates):
    names = []
    for per in coordinates:
        names += [f"centre_{axis}_per_{per}" for axis in "xyz"] + [f"turn_{axis}_per_{per}_rad_m" for axis in "xyz"]
    return names


def main():
    place = [f"moved_{axis}_m" for axis in "xyz"] + [f"turned_{row}{column}" for row in "xyz" for column in "xyz"]
    forces = [f"{name}_n" for name in (*NAMES, "strut")]
    head = ["vehicle", "axle", "linkage", "strut_m", "rack_m", *place, *forces, *slope_names("strut", "rack")]
    write("linkages.csv", head, rows())
    names = "lower_left lower_right upper_left upper_right panhard spring_left spring_right".split()
    head = ["left_m", "right_m", *place, "elongation_m", *[f"{name}_n" for name in names]]
    write("live-axle.csv", head + slope_names("left", "right"), axle_rows())


main()
