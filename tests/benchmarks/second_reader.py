#!/usr/bin/env python3
"""Corrects the small robot programs beside the project and computes by itself where the arm lands.

    tests/benchmarks/second_reader.py [--cells FOLDER] [PART_OF_A_NAME]

It shares no code with the program: it reads the programs again, has a chain of its own (NumPy), solves each corrected pose for
the drawing's joints, as a controller does, and moves an arm with the errors of ../shared/programs/cells/truth.yaml there. A row
of the table is a position: how far the tool lands from where the program sends it, before and after the correction, and in how
many of the ways to reach it (the best is shown; where the program gives joints for the posture, that way alone is taken). Exit
code 0: each position lands within 0.02 mm or is left with a reason; 1: one does not; 0 with a word where the programs are not
there. FOLDER keeps the virtual cells that ../shared/programs/make_cells.sh makes. TRAMMEL_BUILD: where the build is (build/release).
"""
import argparse
import csv
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = ROOT.parent / "shared" / "programs"
TRAMMEL = pathlib.Path(os.environ.get("TRAMMEL_BUILD", ROOT / "build" / "release")) / "clients" / "trammel"
NEAR_MM = 0.02
NUMBER = r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"


# ---- poses: 4 x 4, mm

def turn(axis, angle):
    """About x, y or z (0 to 2) by `angle`, rad."""
    c, s = math.cos(angle), math.sin(angle)
    pose, (i, j) = np.eye(4), ((1, 2), (2, 0), (0, 1))[axis]
    pose[i, i] = pose[j, j] = c
    pose[i, j], pose[j, i] = -s, s
    return pose


def shift(x, y, z):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def of_quaternion(xyz, wxyz):
    w, x, y, z = np.asarray(wxyz, float) / np.linalg.norm(wxyz)
    pose = shift(*xyz)
    pose[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
    return pose


def of_vector(xyz, vector):
    """As a UR writes it: mm and a rotation vector."""
    angle = float(np.linalg.norm(vector))
    half = np.asarray(vector, float) * (math.sin(angle / 2) / angle if angle else 0.5)
    return of_quaternion(xyz, [math.cos(angle / 2), *half])


def of_zyx(x, y, z, about_z, about_y, about_x):
    """deg, about z, then y, then x of the moved frame: A B C of a KUKA, R P W of a FANUC, Rz Ry Rx of a Yaskawa."""
    a, b, c = np.radians([about_z, about_y, about_x])
    return shift(x, y, z) @ turn(2, a) @ turn(1, b) @ turn(0, c)


def rotation_vector(turned):
    """rad, of a 3 x 3."""
    angle = math.acos(np.clip((np.trace(turned) - 1) / 2, -1, 1))
    axis = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    return axis * (0.5 if angle < 1e-9 else angle / (2 * math.sin(angle)))


# ---- the arm

class Arm:
    """A chain of links, mm and rad; `truth`: what its errors are, empty: the drawing."""

    def __init__(self, robot, truth):
        links, base = truth.get("geometry", {}), truth.get("base", {})

        def error(name):
            return float(links.get(name + "_mm", links.get(name + "_rad", 0.0)))  # YAML 1.1 takes 7e-4 for a text
        rows = robot["joints"]
        self.theta = np.array([math.radians(row.get("theta_deg", 0)) + error(f"q{k}") + error(f"theta{k}") for k, row in enumerate(rows, 1)])
        self.limits = np.radians([row["limits_deg"] for row in rows])
        # From the controller's joints to the turns about the axes; a joint that follows another one turns with it.
        sign = [row.get("sign", 1) for row in rows]
        self.turns = np.diag(np.array(sign, float))
        for one in robot.get("coupling") or []:
            self.turns[one["joint"] - 1, one["follows"] - 1] += one["ratio"] * sign[one["follows"] - 1]
        self.links = [shift(row.get("a_mm", 0) + error(f"a{k}"), 0, 0 if row.get("hayati") else row.get("d_mm", 0) + error(f"d{k}")) @
                      turn(0, math.radians(row.get("alpha_deg", 0)) + error(f"alpha{k}")) @ turn(1, error(f"beta{k}"))
                      for k, row in enumerate(rows, 1)]
        self.base = (shift(*(float(base.get(name, 0)) for name in ("x0_mm", "y0_mm", "z0_mm"))) @ turn(2, float(base.get("gamma0_rad", 0))) @
                     turn(1, float(base.get("beta0_rad", 0))) @ turn(0, float(base.get("alpha0_rad", 0))))

    def frames(self, q):
        """Those that the joints turn in, at the controller's joints `q`, rad, and the flange."""
        frames = [self.base]
        for angle, link in zip(self.theta + self.turns @ q, self.links):
            frames.append(frames[-1] @ turn(2, angle) @ link)
        return frames

    def flange(self, q):
        return self.frames(np.asarray(q, float))[-1]

    def solve(self, flange, start):
        """The joints that reach `flange`, from `start`; None where Newton's steps do not end."""
        q = np.array(start, float)
        for _ in range(40):
            frames = self.frames(q)
            now = frames[-1]
            left = np.concatenate([flange[:3, 3] - now[:3, 3],
                                   1000 * (now[:3, :3] @ rotation_vector(now[:3, :3].T @ flange[:3, :3]))])
            if np.linalg.norm(left) < 1e-8:
                return q
            axes = np.array([frame[:3, 2] for frame in frames[:-1]])
            arms = now[:3, 3] - np.array([frame[:3, 3] for frame in frames[:-1]])
            jacobian = np.vstack([np.cross(axes, arms).T, 1000 * axes.T]) @ self.turns
            step = np.linalg.lstsq(jacobian, left, rcond=1e-9)[0]
            q = q + step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-12))
        return None

    def postures(self, flange):
        """All ways to reach it within the joints' limits, but for whole turns."""
        random, found = np.random.default_rng(1), []
        for _ in range(60):
            q = self.solve(flange, random.uniform(np.maximum(self.limits[:, 0], -math.pi), np.minimum(self.limits[:, 1], math.pi)))
            if q is None:
                continue
            q = (q + math.pi) % (2 * math.pi) - math.pi
            if all(np.abs((q - one + math.pi) % (2 * math.pi) - math.pi).max() > 1e-3 for one in found):
                found.append(q)
        return found


# ---- the programs: each reader yields (name, pose of the tool in the robot's base, tool, joints that say the posture)

def numbers(text):
    return [float(one) for one in re.findall(NUMBER, text)]


def read_rapid(texts, _frames):
    all_text = "\n".join(texts.values())
    world = np.eye(4)
    for height in re.findall(r"-base_frame_pos_z (\S+)", all_text):
        world = shift(0, 0, 1000 * float(height))
    user = re.search(r"wOlp\.uframe:=(\[\[[^;]*)", all_text)
    frame = np.eye(4)
    if user:
        n = numbers(user[1])
        frame = of_quaternion(n[:3], n[3:7])
    tool = shift(0, 0, 200)
    for name, text in texts.items():
        start = re.search(r"jointtarget jStart:=\[\[([^\]]*)\]", text)
        seed = np.radians(numbers(start[1])) if start else None
        if "TGripper" in text or "tGripper" in text:
            continue
        for at, found in enumerate(re.finditer(r"(?:robtarget (\w+):=|MoveL )\[\[([^\]]*)\],\[([^\]]*)\],\[([^\]]*)\]", text), 1):
            pose = of_quaternion(numbers(found[2]), numbers(found[3]))
            if found[1] and not re.search(rf"Move\w+ {found[1]}\b", text):
                continue
            yield f"{name} {found[1] or at}", np.linalg.inv(world) @ frame @ pose, tool, seed


def read_krl(texts, _frames):
    all_text = "\n".join(texts.values())
    root = re.search(r"\$ROBROOT=\{([^}]*)\}", all_text)
    world = of_zyx(*numbers(re.sub(r"\b[A-Z]\d? ", " ", root[1]))) if root else np.eye(4)
    for name, text in texts.items():
        for found in re.finditer(r"E6POS (\w+)=\{X (\S+),Y (\S+),Z (\S+),A (\S+),B (\S+),C (\S+),", text):
            if not re.search(rf"(?:PTP|LIN) {found[1]}\b", all_text):
                continue
            pose = of_zyx(*(float(found[k]) for k in range(2, 8)))
            yield f"{name} {found[1]}", np.linalg.inv(world) @ pose, shift(0, 0, 200), None


def read_fanuc(texts, frames):
    for name, text in texts.items():
        for found in re.finditer(r"P\[(\d+)\]\{(.*?)\}", text, re.S):
            n = [float(value) for value in re.findall(rf"\b[XYZWPR] =\s+({NUMBER})", found[2])]
            pose = of_zyx(n[0], n[1], n[2], n[5], n[4], n[3])
            yield f"{name} P[{found[1]}]", frames["UFRAME[1]"] @ pose, frames["UTOOL[1]"], None


def read_inform(texts, frames):
    for name, text in texts.items():
        for found in re.finditer(r"^(C\d+)=(.*)$", text, re.M):
            n = numbers(found[2])
            yield f"{name} {found[1]}", of_zyx(n[0], n[1], n[2], n[5], n[4], n[3]), frames["TOOL[1]"], None


def read_ur(texts, _frames):
    """Motions in the order of the text; of a joint motion no pose. The posture by qnear, else by the joints before."""
    for name, text in texts.items():
        near = re.search(r"_q=\[([^\]]*)\]", text)
        seed, named, count = np.array(numbers(near[1])) if near else None, {}, 0
        for line in (one for one in text.split("\n") if not one.lstrip().startswith("#")):
            joints = re.search(r"movej\(\[([^\]]*)\]", line)
            poses = [of_vector(1000 * np.array(n[:3]), n[3:]) for n in map(numbers, re.findall(r"p\[([^\]]*)\]", line))]
            set_here = re.match(r"\s*global (\w+) ?= ?p\[", line)
            if set_here:
                named[set_here[1]] = poses[0]
            if "move" not in line:
                continue
            count += 1
            if joints:
                before = np.array(numbers(joints[1]))
                seed = before if seed is None else seed
                yield f"{name} motion {count}", None, shift(0, 0, 100), before
            elif "get_inverse_kin" in line:
                yield f"{name} motion {count}", named[re.search(r"get_inverse_kin\((\w+)", line)[1]], shift(0, 0, 100), seed
            elif "pose_inv" in line:
                yield f"{name} motion {count}", named["Plane_1"] @ np.linalg.inv(poses[0]) @ poses[1], shift(0, 0, 100), seed
            elif "pose_add" in line:  # positions add, turns follow each other
                moved = poses[0].copy()
                moved[:3, 3] += poses[1][:3, 3]
                moved[:3, :3] = poses[1][:3, :3] @ poses[0][:3, :3]
                yield f"{name} motion {count}", moved, shift(0, 0, 100), seed
            else:
                yield f"{name} motion {count}", poses[0], shift(0, 0, 100), seed


READERS = {"abb": read_rapid, "two": read_rapid, "kuka": read_krl, "fanuc": read_fanuc, "yask": read_inform, "ur10": read_ur}
# The input, its cell, and what the program is told beside it.
INPUTS = [("krl_root", "kuka"), ("krl_with_bas", "kuka"), ("krl_without_bas", "kuka"), ("krl_exbase", "kuka"), ("krl_tcp", "kuka"),
          ("rapid_confl_off.mod", "abb"), ("rapid_backup_base", "abb"), ("rapid_heavy.mod", "abb"), ("rapid_parts.mod", "abb"),
          ("rapid_movedo.mod", "abb", "--tool", "spindle"), ("rapid_spare.mod", "abb"), ("rapid_two_tools", "two"),
          ("fanuc_gun.ls", "fanuc", "--frames", "frames_fanuc.csv", "--idle-axis", "group 2, axis 1"),
          ("fanuc_linetrack.ls", "fanuc", "--frames", "frames_fanuc.csv"), ("inform_track.jbi", "yask", "--frames", "frames_yask.csv"),
          ("ur_inv.script", "ur10"), ("ur_qnear.script", "ur10"), ("ur_qnear_first.script", "ur10"), ("ur_wound.script", "ur10")]


def texts_of(path):
    files = [path] if path.is_file() else sorted(one for one in path.rglob("*") if one.is_file())
    return {file.name: file.read_text() for file in files if file.suffix not in (".csv", ".original")}


def cell_of(folder, name):
    robot = yaml.safe_load((ROOT / "models" / pathlib.Path(yaml.safe_load((folder / f"{name}.yaml").read_text())["robot"]).name).read_text())
    truth = yaml.safe_load((PROGRAMS / "cells" / "truth.yaml").read_text())["error_sources"]
    return Arm(robot, {}), Arm(robot, truth)


def chain_off(folder, name, true):
    """mm: how far this chain is from what the virtual arm of the program was measured at; its noise is 0.001."""
    worst = 0.0
    for row in csv.DictReader((folder / f"{name}.batch.csv").open()):
        q = np.radians([float(row[f"q{k}_deg"]) for k in range(1, 7)])
        tool = shift(0, 0, 100 if name == "ur10" else 200)
        there = (true.flange(q) @ tool)[:3, 3]
        worst = max(worst, float(np.linalg.norm(there - [float(row[axis]) for axis in ("x_mm", "y_mm", "z_mm")])))
    return worst


def landed(drawing, true, pose, tool, seed, others):
    """Where the true arm goes with the joints that the controller finds for `pose`, and these joints."""
    flange = pose @ np.linalg.inv(tool)
    if seed is None:
        q = drawing.solve(flange, others)
    else:
        turns = [one + 2 * math.pi * np.round((seed - one) / (2 * math.pi)) for one in drawing.postures(flange)]
        q = min(turns, key=lambda one: float(np.abs(one - seed).sum()), default=None)
    return None if q is None else ((true.flange(q) @ tool)[:3, 3], q)


def reasons(receipt):
    with receipt.open() as file:
        return [row["message"] or row["status"] for row in csv.DictReader(file) if row["status"] != "ok"]


def rows_of(name, cell, more, folder, out, near):
    """(position, off before, off after, posture) of each position of an input."""
    drawing, true = cell_of(folder, cell)
    told = [str(PROGRAMS / one) if one.startswith("frames_") else one for one in more]
    frames = {}
    for file in (one for one in told if one.endswith(".csv")):
        for row in csv.DictReader(open(file)):
            frames[row["name"]] = of_quaternion([float(row[k]) for k in ("x_mm", "y_mm", "z_mm")],
                                                [float(row[k]) for k in ("qw", "qx", "qy", "qz")])
    done = subprocess.run([TRAMMEL, "correct", "--model", folder / f"{cell}.model", PROGRAMS / name, "-o", out / name, "--receipt",
                           out / f"{name}.csv", *told], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{name}: {done.stderr}")
    read = READERS[cell]
    before, after = list(read(texts_of(PROGRAMS / name), frames)), list(read({**texts_of(PROGRAMS / name), **texts_of(out / name)}, frames))
    for (position, wanted, tool, seed), (_, commanded, _, joints) in zip(before, after, strict=True):
        if wanted is None:  # joints: the controller goes there
            wanted, ends = drawing.flange(seed) @ tool, [(true.flange(q) @ tool)[:3, 3] for q in (seed, joints)]
            off = [float(np.linalg.norm(end - wanted[:3, 3])) for end in ends]
            yield position, *off, np.degrees(joints), bool(np.allclose(seed, joints, atol=1e-9)), int(off[1] < near), 1
            continue
        ways = drawing.postures(wanted @ np.linalg.inv(tool)) if seed is None else [None]
        reached = []
        for way in ways:
            ends = [landed(drawing, true, pose, tool, seed, way) for pose in (wanted, commanded)]
            if None not in ends:
                off = [float(np.linalg.norm(end - wanted[:3, 3])) for end, _ in ends]
                reached.append((off[1], off[0], np.degrees(ends[1][1])))
        best = min(reached, key=lambda row: row[0])
        unmoved = bool(np.allclose(wanted, commanded, atol=1e-9))
        yield position, best[1], best[0], best[2], unmoved, len([row for row in reached if row[0] < near]), len(reached)


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--cells", type=pathlib.Path)
    options.add_argument("part", nargs="?", default="")
    asked = options.parse_args()
    if not PROGRAMS.is_dir():
        print(f"there are no programs at {PROGRAMS}")
        return 0
    with tempfile.TemporaryDirectory() as made:
        out = pathlib.Path(made)
        folder = asked.cells or out / "cells"
        if not (folder / "yask.model").exists():
            subprocess.run(["sh", PROGRAMS / "make_cells.sh", folder], cwd=ROOT, check=True, stdout=subprocess.DEVNULL,
                           env={**os.environ, "TRAMMEL": str(TRAMMEL)})
        chains = {name: chain_off(folder, name, cell_of(folder, name)[1]) for name in READERS}
        print("this chain against the virtual arm, mm:", ", ".join(f"{name} {off:.4f}" for name, off in chains.items()))
        wrong = sum(off > 0.006 for off in chains.values())
        print(f"{'position':46} {'before mm':>10} {'after mm':>9}  ways    joints deg")
        farthest, corrected = 0.0, 0
        for name, cell, *more in INPUTS:
            if asked.part not in name:
                continue
            for position, before, after, joints, unmoved, right, ways in rows_of(name, cell, more, folder, out, NEAR_MM):
                if unmoved:
                    print(f"{name + ': ' + position:46} {before:10.4f}      left")
                    continue
                farthest, corrected = max(farthest, after), corrected + 1
                wrong += after > NEAR_MM
                print(f"{name + ': ' + position:46} {before:10.4f} {after:9.4f}  {right} of {ways}  "
                      f"{np.array2string(joints, precision=1, suppress_small=True)}{' WRONG' if after > NEAR_MM else ''}")
            for reason in reasons(out / f"{name}.csv"):
                print(f"    left: {reason}")
    print(f"figure programs by a second reader: farthest landing, mm: {farthest:.4f}")
    print(f"figure programs by a second reader: positions corrected: {corrected}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
