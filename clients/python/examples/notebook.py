"""From a batch to a corrected program, cell by cell, with its plots.

    python3 notebook.py DATA OUT     DATA: folder with config/ and models/ (/usr/share/trammel); OUT: where the results go

`# %%` begins a cell: Jupyter (jupytext), VS Code and Spyder open this file as a notebook. A virtual robot is measured here; with a
real one, load its batch instead. The plots are SVG, drawn without another package.
"""

# %% What is needed, and where results go
import pathlib
import sys
from typing import Dict, Sequence

import numpy as np

import trammel

data = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "/usr/share/trammel")
out = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else "trammel-notebook")
out.mkdir(parents=True, exist_ok=True)
print("trammel", trammel.__version__)


def plot(name: str, title: str, across: Sequence[float], series: Dict[str, Sequence[float]]) -> None:
    """Points of each series over `across`, as an SVG."""
    tones = ("#7b8794", "#0072b2", "#009e73")
    highest = max(max(values) for values in series.values()) or 1.0
    left, right = min(across), max(across)
    marks = [f'<text x="20" y="20" font-size="14">{title}</text>', f'<text x="20" y="300">0 to {highest:.3g}</text>']
    for tone, (label, values) in zip(tones, series.items()):
        marks.append(f'<text x="{120 + 130 * tones.index(tone)}" y="300" fill="{tone}">{label}</text>')
        for x, y in zip(across, values):
            marks.append(f'<circle cx="{30 + 540 * (x - left) / ((right - left) or 1):.1f}" cy="{280 - 240 * y / highest:.1f}" r="3" '
                         f'fill="{tone}"/>')
    text = "".join(marks)
    (out / name).write_text(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 310" font-family="sans-serif" font-size="12">{text}</svg>')


# %% The cell, the poses, and where the robot believes its tool to be there: no model is needed yet
cell = trammel.Cell.load(data / "config/cell-7.yaml")
planned = trammel.plan(cell, count=80, seed=1)
believed = cell.tool_poses(planned.joints_deg)
print(f"{cell.name}: {len(planned)} poses, x from {believed[:, 0].min():.0f} to {believed[:, 0].max():.0f} mm")

# %% Measure them, and some more that no training sees
truth = data / "models/truth/chapter-5.yaml"
batch = trammel.simulate(cell, truth, planned, seed=1)
fresh = trammel.simulate(cell, truth, trammel.plan(cell, count=40, seed=2), seed=2)

# %% Train, and look at the parameters in mm and deg
model = trammel.train(cell, batch, level="M3", bias="none")
for parameter in model.parameters[:4]:
    print(f"{parameter['name']}: {parameter['value']:.3f} ± {parameter['u95']:.3f} {parameter['unit']}")

# %% The residual of each fresh pose
residuals = model.residuals(fresh)
lengths = {level: np.linalg.norm(getattr(residuals, f"{level}_mm"), axis=1) for level in ("nominal", "calibrated", "compensated")}
print(f"rms {np.sqrt(np.mean(lengths['nominal'] ** 2)):.1f} mm nominal, {np.sqrt(np.mean(lengths['compensated'] ** 2)):.2f} mm compensated")
reach = list(np.linalg.norm(cell.tool_poses(trammel.plan(cell, count=40, seed=2).joints_deg)[:, :3], axis=1))
plot("residuals.svg", "error of fresh poses over the distance from the base, mm", reach,
     {level: list(lengths[level]) for level in ("calibrated", "compensated")})

# %% The page that people read
model.report(out / "model.html", fresh)
model.save(out / "cell.model")

# %% Targets, one by one
wanted = believed[:10]
corrected = model.correct(wanted, joints_deg=planned.joints_deg[:10])
plot("targets.svg", "expected error of each target before and after, mm", list(range(10)),
     {"before": list(corrected.error_before_mm), "after": list(corrected.error_after_mm)})
print(f"{corrected.status.count('ok')} of {len(corrected)} targets corrected")

# %% A robot program: every byte that is no corrected number stays
program = model.correct_program(data / "config/programs/drill.mod", out / "program")
(out / "receipt.csv").write_text(program.receipt_csv)
print(f"{', '.join(program.files)}: {'all targets corrected' if program.complete else 'some targets left alone'}")

# %% Weeks later: is it still this robot?
few = trammel.simulate(cell, truth, trammel.plan(cell, count=12, seed=3, criterion="check"), seed=3)
health = model.check(few, tolerance_mm=0.2)
print(f"{health['verdict']}, next check by {health['due']}" if health["due"] else health["verdict"])
print(len(trammel.history([model])["versions"]), "version on record")
