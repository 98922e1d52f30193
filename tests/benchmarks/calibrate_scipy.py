"""The calibration of calibrate_benchmark with SciPy's least_squares(method="lm"): numeric Jacobian, poses vectorised in NumPy.

usage: calibrate_scipy.py BATCH.csv SECONDS_OF_OURS
"""

import csv
import sys
import time

import numpy as np
from scipy.optimize import least_squares

rows = list(csv.DictReader(line for line in open(sys.argv[1]) if not line.startswith("#")))
N = len(rows)


def columns(*names):
    return np.array([[float(row[name]) for name in names] for row in rows])


q = np.radians(columns(*[f"q{i}_deg" for i in range(1, 7)]))
pm = columns("x_mm", "y_mm", "z_mm") * 1e-3
w_, x_, y_, z_ = columns("qw", "qx", "qy", "qz").T
Rm = np.stack([
    np.stack([1 - 2 * (y_ * y_ + z_ * z_), 2 * (x_ * y_ - z_ * w_), 2 * (x_ * z_ + y_ * w_)], -1),
    np.stack([2 * (x_ * y_ + z_ * w_), 1 - 2 * (x_ * x_ + z_ * z_), 2 * (y_ * z_ - x_ * w_)], -1),
    np.stack([2 * (x_ * z_ - y_ * w_), 2 * (y_ * z_ + x_ * w_), 1 - 2 * (x_ * x_ + y_ * y_)], -1)], 1)

d0 = np.array([0.78, 0, 0, 1.142, 0, 0.2])
a0 = np.array([0.32, 1.28, 0.2, 0, 0, 0])
al0 = np.radians([-90, 0, -90, -90, 90, 0])
th0 = np.radians([0, -90, 0, 180, 0, 0])
R_FT = np.array([[1, 0, -1], [0, 2**0.5, 0], [1, 0, 1]]) / 2**0.5
p_FT = np.array([0.1, 0, 0.15])
cog = np.array([0, 0, 0.1])
weight = np.array([0, 0, -100 * 9.80665])


def zyx(g, b, a):
    cg, sg, cb, sb, ca, sa = np.cos(g), np.sin(g), np.cos(b), np.sin(b), np.cos(a), np.sin(a)
    return np.array([[cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
                     [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
                     [-sb, cb * sa, cb * ca]])


def forward(p):
    """Tool point, tool rotation and small rotation by deflection, eq. (3.6), of all poses."""
    d = d0.copy()
    d[[0, 2, 3, 4, 5]] += p[12:17]
    a, alpha, C = a0 + p[17:23], al0 + p[23:29], p[30:36] * 1e-6
    R = np.broadcast_to(zyx(*p[3:6]), (N, 3, 3))
    t = np.broadcast_to(p[:3], (N, 3))
    points, axes = [], []
    for i in range(6):
        points.append(t)
        axes.append(R[:, :, 2])
        theta = q[:, i] + th0[i] + p[6 + i]
        c, s = np.cos(theta)[:, None], np.sin(theta)[:, None]
        x, y, z = R[:, :, 0] * c + R[:, :, 1] * s, R[:, :, 1] * c - R[:, :, 0] * s, R[:, :, 2]
        t = t + z * d[i] + x * a[i]
        ca, sa = np.cos(alpha[i]), np.sin(alpha[i])
        y, z = y * ca + z * sa, z * ca - y * sa
        if i == 1:
            cb, sb = np.cos(p[29]), np.sin(p[29])
            x, z = x * cb - z * sb, x * sb + z * cb
        R = np.stack([x, y, z], axis=2)
    tip, centre = t + R @ p_FT, t + R @ cog
    shift, turn = 0, 0
    for j in range(6):
        give = (np.einsum("ij,ij->i", axes[j], np.cross(centre - points[j], weight)) * C[j])[:, None]
        shift = shift + np.cross(axes[j], tip - points[j]) * give
        turn = turn + axes[j] * give
    return tip + shift, R @ R_FT, turn


def rotation(w):
    K = np.zeros((N, 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -w[:, 2], w[:, 1], -w[:, 0]
    K = K - np.swapaxes(K, 1, 2)
    return np.eye(3) + K + K @ K / 2


scale = np.r_[np.full(3, 2e-3), np.full(9, 5e-3), np.full(11, 2e-3), np.full(7, 5e-3), np.full(6, 10.0)]


def residual(x):
    p, R, turn = forward(x * scale)
    E = Rm @ np.swapaxes(rotation(turn) @ R, 1, 2)
    w = np.stack([E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]], 1) / 2
    return np.r_[((pm - p) / 13e-6).ravel(), (w / 61e-6).ravel(), x]


begin = time.process_time()
fit = least_squares(residual, np.zeros(36), method="lm")
seconds = time.process_time() - begin
rms = 1e3 * np.sqrt(((pm - forward(fit.x * scale)[0]) ** 2).sum(1).mean())
print(f"SciPy least_squares lm: {seconds:.3f} s, residual rms {rms:.5f} mm; ratio {seconds / float(sys.argv[2]):.1f} (aim 20)")
