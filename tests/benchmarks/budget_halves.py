#!/usr/bin/env python3
"""Asks whether two halves of the poses of a real arm tell the same error budget.

Trains on each half by itself (`base, geometry`, no bias) and holds every
number of the budget that both halves tell against the other: they agree where they differ by less than U (k = 2) of the
difference. Expected: 93 to 98 % of the numbers. Halves are drawn at random, or with `--blocks` are the first and the
second half of the rows. The measurements are no part of this project; without them nothing is done.

    tests/benchmarks/budget_halves.py --trammel build/release/clients/trammel --data ../shared/data
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import tempfile

WAM = [(0, 0, 0, -90), (0, 0, 0, 90), (0, 550, 45, -90), (0, 0, -45, 90), (0, 300, 0, -90), (0, 0, 0, 90), (0, 60, 0, 0)]
UR_10 = "universal-robots_ur10.yaml"
UR_5 = "universal-robots_ur5.yaml"
# file, robot (of models/; none: WAM), tracker's sigma in mm, error sources
ARMS = [("ur10_series_c.csv", UR_10, 0.009, "base, geometry"), ("ur10_series_d.csv", UR_10, 0.013, "base, geometry"),
        ("ur5_grid.csv", UR_5, 0.02, "base, geometry"), ("wam_grid.csv", None, 0.02, "base, geometry")]
MODELS = pathlib.Path(__file__).resolve().parents[2] / "models"


def robot_text(robot):
    if robot:
        return (MODELS / robot).read_text()
    rows = "".join(f"  - {{theta_deg: {t}, d_mm: {d}, a_mm: {a}, alpha_deg: {al}, limits_deg: [-360, 360]}}\n" for t, d, a, al in WAM)
    return "version: 1\nname: Barrett WAM\njoints:\n" + rows


def budget_of(trammel, folder, header, rows):
    (folder / "half.csv").write_text("".join([header, *rows]))
    done = subprocess.run([trammel, "train", "--cell", "cell.yaml", "--batch", "half.csv", "--bias", "none", "--as-read",
                           "-o", "half.model", "--json", "-"], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout)["budget"]


def numbers_of(budget):
    """Each number of a line as (value, U); what the lines are told together with is part of their name."""
    numbers = {}
    for line in budget["lines"]:
        name = "+".join([line["line"], *sorted(line["with"])])
        if line["value"] is None or line["kind"] in ("base", "tool"):  # told from where each half finds them
            continue
        for number in line.get("numbers") or [{"name": "", "value": line["value"], "u95": line["u95"]}]:
            numbers[name, number["name"]] = number["value"], number["u95"]
    return numbers


def halves_of(rows, blocks, rng):
    if not blocks:
        rng.shuffle(rows)
    return rows[: len(rows) // 2], rows[len(rows) // 2:]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trammel", default="build/release/clients/trammel")
    parser.add_argument("--data", default="../shared/data")
    parser.add_argument("--poses", type=int, default=600, help="at most, of each arm")
    parser.add_argument("--repeats", type=int, default=3, help="random halves of each arm")
    parser.add_argument("--blocks", action="store_true", help="the first and the second half of the rows")
    parser.add_argument("--verbose", action="store_true", help="print each number that does not agree")
    asked = parser.parse_args()
    data = pathlib.Path(asked.data)
    if not data.is_dir():
        print(f"{data} is not there: nothing is asked")
        return
    trammel = str(pathlib.Path(asked.trammel).resolve())
    all_agree = all_numbers = 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for file, robot, sigma, sources in ARMS:
            (folder / "robot.yaml").write_text(robot_text(robot))
            (folder / "cell.yaml").write_text(
                f"version: 1\ncell: real\nrobot: robot.yaml\nbase: null\ntools: {{reflector: null}}\n"
                f"tracker: {{sigma_mm: {sigma}, sigma_deg: 0.0035}}\nmodel: {{error_sources: [{sources}], bias: none}}\n")
            header, *rows = [line for line in (data / file).read_text().splitlines(keepends=True) if not line.startswith("#")]
            agree = numbers = 0
            for repeat in range(1 if asked.blocks else asked.repeats):
                rng = random.Random(repeat)
                drawn = rows if len(rows) <= asked.poses else [rows[k] for k in sorted(rng.sample(range(len(rows)), asked.poses))]
                one, other = (budget_of(trammel, folder, header, half) for half in halves_of(list(drawn), asked.blocks, rng))
                first, second = numbers_of(one), numbers_of(other)
                for key in first.keys() & second.keys():
                    off = first[key][0] - second[key][0]
                    within = math.hypot(first[key][1], second[key][1])
                    numbers += 1
                    agree += abs(off) <= within
                    if asked.verbose and abs(off) > within:
                        print(f"  {file} {key}: {first[key]} {second[key]}: {2 * abs(off) / within:.1f} standard deviations")
            print(f"{file}: {one['nominal_rms_mm']:.3f} mm, beyond frames {one['beyond_frames']['nominal_rms_mm']:.3f} mm; "
                  f"{agree} of {numbers} numbers agree within U")
            for line in one["beyond_frames"]["lines"][:6]:
                print(f"    {line['name']}: {line['value']} {line['unit'] or ''} alone {line['alone_rms_mm']:.3f} mm, "
                      f"share {line['share']:.2f}")
            all_agree, all_numbers = all_agree + agree, all_numbers + numbers
    print(f"all arms: {all_agree} of {all_numbers} numbers agree within U ({100 * all_agree / max(all_numbers, 1):.1f} %)")


if __name__ == "__main__":
    main()
