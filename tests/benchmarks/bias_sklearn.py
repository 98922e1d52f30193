"""scikit-learn's Gaussian process on the data of bias_benchmark, timed and judged; prints `name value` lines.

usage: bias_sklearn.py FOLDER NAME ... with FOLDER/NAME_train.csv and NAME_test.csv, rows q ..., y
"""

import sys
import time
import warnings

import numpy as np
from scipy.optimize import minimize
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

warnings.filterwarnings("ignore")


def seconds(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def three_iterations(objective, start, bounds):
    end = minimize(objective, start, method="L-BFGS-B", jac=True, bounds=bounds, options={"maxiter": 3})
    return end.x, end.fun


for name in sys.argv[2:]:
    train = np.loadtxt(f"{sys.argv[1]}/{name}_train.csv", delimiter=",")
    test = np.loadtxt(f"{sys.argv[1]}/{name}_test.csv", delimiter=",")
    q, y = train[:, :-1], train[:, -1]
    centre, scale = y.mean(), y.std()
    z = (y - centre) / scale
    dims = q.shape[1]
    kernel = ConstantKernel(1.0, (1e-4, 1e6)) * RBF(np.ones(dims), (1e-2, 1e4)) + WhiteKernel(1e-2, (1e-10, 10))
    gp = GaussianProcessRegressor(kernel, alpha=1e-12, optimizer=None).fit(q, z)
    theta = gp.kernel_.theta
    print(name, "likelihood_and_gradient_s",
          min(seconds(lambda: gp.log_marginal_likelihood(theta, eval_gradient=True)) for _ in range(2)))
    if len(z) > 1500:
        # Minutes otherwise: three iterations from where 1000 of the rows end.
        small = GaussianProcessRegressor(kernel, alpha=1e-12).fit(q[:1000], z[:1000])
        gp = GaussianProcessRegressor(small.kernel_, alpha=1e-12, optimizer=three_iterations).fit(q, z)
    else:
        gp = GaussianProcessRegressor(kernel, alpha=1e-12)
        print(name, "fit_s", seconds(lambda: gp.fit(q, z)))
    print(name, "log_likelihood", gp.log_marginal_likelihood_value_ - len(y) * np.log(scale))
    one, many = test[:1, :-1], test[:, :-1]
    repeats = -(-10000 // len(many))
    print(name, "mean_of_one_s", min(seconds(lambda: gp.predict(one)) for _ in range(20)))
    print(name, "stddev_of_one_s", min(seconds(lambda: gp.predict(one, return_std=True)) for _ in range(5)))
    print(name, "mean_of_10000_s", repeats * seconds(lambda: gp.predict(many)))
    print(name, "stddev_of_10000_s", repeats * seconds(lambda: gp.predict(many, return_std=True)))
    # The WhiteKernel's part of the diagonal is in the standard deviation: that of a measurement.
    mean, stddev = gp.predict(many, return_std=True)
    error = (test[:, -1] - centre) / scale - mean
    print(name, "standardised_rmse", np.sqrt(np.mean(error**2)) / np.std((test[:, -1] - centre) / scale))
    print(name, "nlpd", np.mean(0.5 * np.log(2 * np.pi * stddev**2) + 0.5 * (error / stddev)**2) + np.log(scale))
    print(name, "coverage_95", np.mean(np.abs(error) < 1.96 * stddev), flush=True)
