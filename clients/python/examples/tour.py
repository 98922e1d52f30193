"""A tour of the Python package: from no measurements to corrected targets, with a virtual robot.

    python3 tour.py [FOLDER with config/ and models/; else /usr/share/trammel]

Behind each print stands what it prints.
"""

import sys

import numpy as np

import trammel

data = sys.argv[1] if len(sys.argv) > 1 else "/usr/share/trammel"

# A cell: the robot, its base, tools, payloads and tracker.
cell = trammel.Cell.load(f"{data}/config/cell-7.yaml")
print(f"{cell.name}: {cell.robot}, {cell.joints} joints, tools {cell.tools}")
#> cell-7: ABB IRB 6640-205/2.75, 6 joints, tools ['spindle']

# Poses to measure, (N, n) in deg. A real robot would be driven there; here a virtual one is measured.
planned = trammel.plan(cell, count=80, seed=1)
print(planned.joints_deg.shape)
#> (80, 6)
batch = trammel.simulate(cell, f"{data}/models/truth/chapter-5.yaml", planned, seed=1)
fresh = trammel.simulate(cell, f"{data}/models/truth/chapter-5.yaml", trammel.plan(cell, count=40, seed=2), seed=2)

# A model: what physics explains of the error, and what is learned of the rest.
model = trammel.train(cell, batch, level="M3", bias="none")
print(len(model.parameters), "parameters,", model.parameter_covariance.shape, "covariance")
#> 36 parameters, (36, 36) covariance
levels = model.evaluate(fresh)["levels"]
print(f"rms {levels['nominal']['rms_mm']:.1f} mm nominal, {levels['compensated']['rms_mm']:.2f} mm compensated")
#> rms 9.7 mm nominal, 0.02 mm compensated

# The error to expect at joints (N, n) in deg; vectors in the base frame, mm.
errors = model.predict(planned.joints_deg)
print(errors.error_mm.shape, errors.covariance_mm2.shape, bool(errors.in_domain.all()))
#> (80, 3) (80, 3, 3) True

# What to command so that the tool lands on poses (N, 7): x, y, z in mm, quaternion qw, qx, qy, qz.
wanted = errors.nominal[:2]
corrected = model.correct(wanted, joints_deg=planned.joints_deg[:2])
print(corrected.status)
#> ['ok', 'ok']
print(f"{np.mean(corrected.error_before_mm):.1f} mm become {np.max(corrected.error_after_mm):.2f} mm at most")
#> 14.0 mm become 0.01 mm at most

# What goes wrong is data.
try:
    model.predict([[0, 0, 0, 0, 500, 0]])
except trammel.Refused as error:
    print(f"row {error.row}: {error.value:.0f} is beyond {error.limit:.0f}")
#> row 0: 500 is beyond 120
