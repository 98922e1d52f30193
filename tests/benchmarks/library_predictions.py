"""For library_benchmark: the processor time in which the Python package predicts the poses of a plan, and their errors' sum.

    PYTHONPATH=build/release/clients/python python3 library_predictions.py MODEL PLAN
"""

import csv
import sys
import time

import numpy as np

import trammel

model = trammel.Model.load(sys.argv[1])
with open(sys.argv[2], newline="") as plan:
    rows = csv.DictReader(line for line in plan if not line.startswith("#"))
    joints = np.array([[float(row[f"q{j}_deg"]) for j in range(1, 7)] for row in rows])

model.predict(joints[:10])
best, errors = float("inf"), np.empty(0)
for _ in range(3):
    began = time.process_time()
    errors = model.predict(joints).error_mm
    best = min(best, time.process_time() - began)
print(best, repr(float(np.linalg.norm(errors, axis=1).sum() / 1000)))
