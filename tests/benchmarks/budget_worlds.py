#!/usr/bin/env python3
"""Hides gross and usual errors in arms, and asks `trammel train` where the millimetres come from.

The arms are the shipped ones; their kinematics are written down here once more. Prints how often the first line is the
one that does most in truth (by itself, or named beside the one that leads), how often a value lies within U, how near its
millimetres are, how often a pair that no pose can tell apart is named as one, and how many healthy arms get an action.
A world measures positions or full poses. Every third arm carries a load: its gearboxes give way, and one of them may be
the gross error. Every third has a gear ripple in joint 3, which may be it, too. Each gross error is beyond what stands
out, at 60 to 300 poses; with `--small` it is from 0.2 mrad and 0.2 mm on, at 20 to 400 poses. Lines that name others are
held against nothing: they are of all of them together. A line whose U is beyond 5 % of its value has no millimetres to 5 %.

    tests/benchmarks/budget_worlds.py --trammel build/release/clients/trammel --worlds 40 --healthy 20
"""
import argparse
import json
import math
import pathlib
import re
import subprocess
import tempfile

import numpy as np
import yaml

ORDER = 20  # waves of the ripple in a turn of joint 3
COG = 150.0  # mm from the flange to where the load pulls
KINDS = ["plain", "load", "ripple"]
MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"
ARMS = ["abb_irb120-3-06", "abb_irb1200-5-09", "abb_irb6640-205-275", "fanuc_m-20ia", "kuka_kr210-r2700-extra",
        "kuka_lbr-iiwa-7-r800", "staubli_tx2-90l", "universal-robots_ur10", "yaskawa_gp25"]


def turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    T = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def shift(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


class Arm:
    """A shipped arm with errors: `zeros` as the controller counts, lengths in mm, angles in rad."""

    def __init__(self, name):
        self.name = name
        data = yaml.safe_load((MODELS / f"{name}.yaml").read_text())
        self.rows = data["joints"]
        self.n = len(self.rows)
        self.drive = np.diag([float(row.get("sign", 1)) for row in self.rows])
        self.transmission = self.drive.copy()
        # Its load bends each joint by about 0.2 mrad where the arm is half stretched.
        reach = sum(abs(row["a_mm"]) + abs(row.get("d_mm", 0)) for row in self.rows)
        self.load = max(3.0, 100 * (reach / 3500) ** 2)  # kg
        self.soft = 2e-4 / (9.8 * self.load * 0.5 * reach)  # rad/Nmm
        for coupling in data.get("coupling") or []:
            self.transmission[coupling["joint"] - 1, coupling["follows"] - 1] += coupling["ratio"]

    def keys(self):
        for k, row in enumerate(self.rows, 1):
            yield f"zero:{k}"
            yield f"length:a{k}"
            yield f"twist:alpha{k}"
            yield f"twist:beta{k}" if row.get("hayati") else f"length:d{k}"

    def links(self, theta, errors):
        """4 x 4 of each axis before its joint turns, and of the flange."""
        get = errors.get
        T = shift(*get("base", (0, 0, 0)))
        frames = []
        for k, row in enumerate(self.rows):
            frames.append(T)
            angle = math.radians(row["theta_deg"]) + theta[k]
            a = row["a_mm"] + get(f"length:a{k + 1}", 0.0)
            alpha = math.radians(row["alpha_deg"]) + get(f"twist:alpha{k + 1}", 0.0)
            if row.get("hayati"):
                T = T @ turn("z", angle) @ shift(a, 0, 0) @ turn("x", alpha) @ turn("y", get(f"twist:beta{k + 1}", 0.0))
            else:
                d = row["d_mm"] + get(f"length:d{k + 1}", 0.0)
                T = T @ shift(0, 0, d) @ turn("z", angle) @ shift(a, 0, 0) @ turn("x", alpha)
        return frames, T

    def pose(self, q, errors, load=0.0):
        """The tool, 4 x 4, mm; `q` commanded, rad; `load` in kg, COG mm out of the flange."""
        get = errors.get
        zeros = np.array([get(f"zero:{k + 1}", 0.0) for k in range(self.n)])
        # The controller's couplings change how q is counted; a zero moves its own axis alone.
        theta = self.transmission @ q + self.drive @ zeros
        theta[2] += get("gear_transmission:3", 0.0) * math.sin(ORDER * theta[2])
        if load > 0:
            frames, flange = self.links(theta, errors)
            at = (flange @ np.array([0, 0, COG, 1]))[:3]
            weight = np.array([0, 0, -9.80665 * load])
            for k, frame in enumerate(frames):  # a gearbox gives way by the torque about its axis, N mm
                torque = frame[:3, 2] @ np.cross(at - frame[:3, 3], weight)
                theta[k] += get(f"compliance:{k + 1}", 0.0) * torque
        _, flange = self.links(theta, errors)
        return flange @ shift(*(np.array([40.0, -25.0, 140.0]) + np.array(get("tool", (0, 0, 0)))))

    def tip(self, q, errors, load=0.0):
        return self.pose(q, errors, load)[:3, 3]

    def draw_poses(self, rng, count):
        low = np.radians([max(row["limits_deg"][0], -100) for row in self.rows])
        high = np.radians([min(row["limits_deg"][1], 100) for row in self.rows])
        middle, half = (low + high) / 2, (high - low) / 2
        return [middle + half * rng.uniform(-0.7, 0.7, self.n) for _ in range(count)]


def usual_errors(arm, rng, kind="plain"):
    errors = {}
    if kind == "load":
        for k in range(1, arm.n + 1):
            errors[f"compliance:{k}"] = arm.soft * float(rng.uniform(0.5, 1))
    if kind == "ripple":
        errors["gear_transmission:3"] = 1e-4
    for key in arm.keys():
        size = 0.1 if key.startswith("length") else 1.5e-4
        errors[key] = float(rng.normal(0, size))
    errors["base"] = tuple(rng.normal(0, 3, 3))
    return errors


def gross_error(arm, rng, small, world="plain"):
    """A key and its error: a zero of up to 5 degrees, a length of up to 10 mm, a twist, a tool, the base; of a `load` world
    a gearbox of joint 2 or 3, of a `ripple` world the ripple. `small`: from 0.2 mrad and 0.2 mm on, of any joint; else
    beyond what stands out, and of joints that frames do not take."""
    if world == "load" and rng.random() < 0.5:
        return f"compliance:{rng.integers(2, 4)}", arm.soft * float(rng.uniform(4, 12))
    if world == "ripple" and rng.random() < 0.5:
        return "gear_transmission:3", float(rng.uniform(3e-4, 3e-3))
    joints = range(1, arm.n + 1) if small else range(2, arm.n)
    kind = rng.choice(["zero", "zero", "length", "twist", "tool", "base"] if small else
                      ["zero", "zero", "length", "twist", "tool"])
    sign = rng.choice([-1, 1])
    least_angle, least_length = (0.2e-3, 0.2) if small else (6e-3, 4)

    def drawn(least, most):
        return float(sign * math.exp(rng.uniform(math.log(least), math.log(most))))

    if kind in ("tool", "base"):
        least, most = (0.2, 10) if small else (7, 12)
        return kind, tuple(drawn(least, most) * v for v in np.eye(3)[rng.integers(3)])
    k = int(rng.choice(list(joints)))
    if kind == "zero":
        return f"zero:{k}", drawn(least_angle, math.radians(5))
    if kind == "length":
        return f"length:a{k}", drawn(least_length, 10)
    return f"twist:alpha{k}", drawn(least_angle, 3e-2)


def cell_files(folder, arm, kind):
    (folder / "robot.yaml").write_text((MODELS / f"{arm.name}.yaml").read_text())
    more = {"plain": "", "load": ", compliance", "ripple": f", 'gear_transmission:3@{ORDER}'"}[kind]
    payload = f"payloads: {{load: {{mass_kg: {arm.load}, cog_mm: [0, 0, {COG}]}}}}\n" if kind == "load" else ""
    (folder / "cell.yaml").write_text(
        "version: 1\ncell: world\nrobot: robot.yaml\nbase: {xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}\n"
        f"gravity: [0, 0, -1]\n{payload}"
        "tools: {tip: {xyz_mm: [40, -25, 140], q_wxyz: [1, 0, 0, 0]}}\n"
        f"tracker: {{sigma_mm: 0.02, sigma_deg: 0.003}}\nmodel: {{error_sources: [base, geometry, tool{more}], bias: none}}\n")


def quaternion(R):
    """w, x, y, z of a rotation matrix."""
    w, v = np.linalg.eigh(np.array([
        [R[0, 0] + R[1, 1] + R[2, 2], R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
        [R[2, 1] - R[1, 2], R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
        [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1]],
        [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1]]]))
    return v[:, np.argmax(w)]


def batch_file(path, world, rng):
    arm = world.arm
    full = ",qw,qx,qy,qz" if world.full else ""
    lines = ["pose_id," + ",".join(f"q{k + 1}_deg" for k in range(arm.n)) + ",x_mm,y_mm,z_mm" + full]
    for i, q in enumerate(world.poses):
        T = arm.pose(q, world.errors, world.load)
        numbers = [f"{v:.4f}" for v in np.degrees(q)] + [f"{v:.5f}" for v in T[:3, 3] + rng.normal(0, 0.02, 3)]
        if world.full:
            turned = T[:3, :3]
            for axis, angle in zip("xyz", rng.normal(0, math.radians(0.003), 3)):
                turned = turn(axis, angle)[:3, :3] @ turned
            numbers += [f"{v:.9f}" for v in quaternion(turned)]
        lines.append(f"p{i + 1}," + ",".join(numbers))
    path.write_text("\n".join(lines) + "\n")


def line_of(key):
    """The line of the budget that a hidden error belongs to: the lengths of a link are one, and so are its angles."""
    return re.sub(r"^(length|twist):[a-z]+", r"\1:", key)


class World:
    """An arm with hidden errors, the poses that it is measured at, and what each error does to them."""

    def __init__(self, number, rng, gross=0, small=False, counts=(40, 200)):
        self.arm = Arm(ARMS[number % len(ARMS)])
        self.kind = KINDS[(number // len(ARMS) + number) % len(KINDS)]
        self.errors = usual_errors(self.arm, rng, self.kind)
        self.gross = dict(gross_error(self.arm, rng, small, self.kind) for _ in range(gross))
        self.errors.update(self.gross)
        self.full = bool(rng.integers(2))
        self.load = self.arm.load if self.kind == "load" else 0.0
        self.poses = [np.radians(np.round(np.degrees(q), 4))
                      for q in self.arm.draw_poses(rng, int(rng.integers(*counts)))]

    def alone_mm(self, line):
        without = {k: v for k, v in self.errors.items() if line_of(k) != line}
        return math.sqrt(np.mean([np.sum((self.arm.tip(q, self.errors, self.load) - self.arm.tip(q, without, self.load)) ** 2)
                                  for q in self.poses]))

    def pairs(self):
        """Two lines of which no position can tell the one hidden here from the other."""
        if "zero:1" in self.gross:
            yield "zero:1", "base"
        tool = self.gross.get("tool", (1, 1, 1))
        if tool[0] == tool[1] == 0 and "d_mm" in self.arm.rows[-1] and self.arm.rows[-1]["alpha_deg"] == 0:
            yield "tool", f"length:{self.arm.n}"


def budget_of(trammel, folder, world, rng):
    cell_files(folder, world.arm, world.kind)
    batch_file(folder / "batch.csv", world, rng)
    done = subprocess.run([trammel, "train", "--cell", "cell.yaml", "--batch", "batch.csv", "-o", "m.model", "--json", "-"],
                          cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{world.arm.name}: {done.stderr}")
    return json.loads(done.stdout)["budget"]


def hidden_value(key, error):
    """As people read it: mm, deg, or of a gearbox deg/kNm."""
    if isinstance(error, tuple):
        return float(np.linalg.norm(error))
    if key.startswith("compliance"):
        return math.degrees(1e6 * error)
    return error if key.startswith("length") else math.degrees(error)


class Counts:
    """How often a budget is right."""

    def __init__(self):
        self.right = self.inside = self.near = self.values = self.lines = self.pairs = self.named = self.worlds = 0
        self.blurred = 0  # lines whose value is not known to 5 %: their millimetres cannot be, either

    def add(self, name, world, budget, verbose):
        by_line = {line_of(key): key for key in world.gross}
        sizes = {line: world.alone_mm(line) for line in {line_of(key) for key in world.errors}}
        largest = max(sizes, key=sizes.get)
        first = budget["lines"][0]
        good = max(sizes.get(one, 0) for one in [first["line"], *first["with"]]) >= 0.8 * sizes[largest]
        self.worlds += 1
        self.right += good
        if not good:
            print(f"{name} {len(world.poses)} poses: {world.gross} first {first['line']} with {first['with']}, "
                  f"largest {largest} {sizes[largest]:.3f} mm")
        for found in budget["lines"]:
            if found["line"] in by_line:
                self.add_line(name, by_line[found["line"]], found, world, sizes, verbose)
        together = [{line["line"], *line["with"]} for line in budget["lines"]]
        for pair in world.pairs():
            is_named = any(set(pair) <= names for names in together)
            self.pairs += 1
            self.named += is_named
            if not is_named:
                print(f"{name}: {pair} is not named as a pair")

    def add_line(self, name, key, found, world, sizes, verbose):
        if found["with"]:  # all of them together: no single error is hidden that the line could be held against
            return
        own = {number["name"]: number for number in found.get("numbers", [])}.get(key.partition(":")[2], found)
        if own["value"] is not None and own["u95"] > 0.05 * abs(own["value"]):
            self.blurred += 1
            return self.add_value(name, key, own, world, verbose)
        is_near = abs(found["alone_rms_mm"] - sizes[found["line"]]) <= 0.05 * sizes[found["line"]]
        self.near += is_near
        self.lines += 1
        if verbose and not is_near:
            print(f"{name}: {key} alone {found['alone_rms_mm']:.4f} mm, hidden {sizes[found['line']]:.4f}")
        self.add_value(name, key, own, world, verbose)

    def add_value(self, name, key, own, world, verbose):
        if own["value"] is None:  # there are several numbers
            return
        self.values += 1
        hidden = hidden_value(key, world.errors[key])
        is_inside = abs(own["value"] - hidden) <= own["u95"]
        self.inside += is_inside
        if verbose and not is_inside:
            print(f"{name} {len(world.poses)} poses: {key} {own['value']:.6g} +- {own['u95']:.2g} {own['unit']}, "
                  f"hidden {hidden:.6g}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trammel", default="build/release/clients/trammel")
    parser.add_argument("--worlds", type=int, default=40)
    parser.add_argument("--healthy", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--small", action="store_true", help="gross errors from 0.2 mrad and 0.2 mm on, of any joint")
    parser.add_argument("--verbose", action="store_true", help="print each value that lies outside its U")
    asked = parser.parse_args()
    trammel = str(pathlib.Path(asked.trammel).resolve())
    rng = np.random.default_rng(asked.seed)
    counts, actions = Counts(), 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number in range(asked.worlds):
            world = World(number, rng, int(rng.integers(1, 5)), asked.small, (20, 400) if asked.small else (60, 300))
            counts.add(f"world {number} {world.arm.name} ({world.kind})", world,
                       budget_of(trammel, folder, world, rng), asked.verbose)
        for number in range(asked.healthy):
            world = World(number, rng)
            acted = [line["line"] for line in budget_of(trammel, folder, world, rng)["lines"] if line["action"]]
            actions += bool(acted)
            if acted:
                print(f"healthy {number} {world.arm.name}: {acted}")
    print(f"first line right {counts.right} of {counts.worlds}; value within U {counts.inside} of {counts.values}; "
          f"millimetres within 5 % {counts.near} of {counts.lines}, beside {counts.blurred} whose value is not known to 5 %; pairs named {counts.named} of {counts.pairs}; "
          f"healthy arms with an action {actions} of {asked.healthy}")


if __name__ == "__main__":
    main()
