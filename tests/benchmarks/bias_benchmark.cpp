#include <benchmark/benchmark.h>

#include "server/base/check.h"
#include "server/bias/bias_model.h"
#include "server/bias/gaussian_process.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

BiasModel fitted(Eigen::Index count) {
  BiasOptions options;
  options.starts = 2;
  auto model = BiasModel::fit(smooth_problem(count, 1), options);
  TRAMMEL_CHECK(model.has_value());
  return *std::move(model);
}

void likelihood_and_gradient(benchmark::State& state) {
  const BiasProblem problem = smooth_problem(state.range(0), 1);
  GpPrior prior;
  prior.parameter_centre = Eigen::VectorXd::Zero(6);
  ProfiledLikelihood likelihood(make_kernel("se"),
                                {problem.q, problem.residual_B, Eigen::VectorXd::Ones(problem.q.rows())}, prior);
  Eigen::VectorXd parameters = Eigen::VectorXd::Constant(7, 0.3);
  parameters[6] = std::log(1e-3);
  Evaluation evaluation;
  for (auto _ : state) benchmark::DoNotOptimize(likelihood.evaluate(parameters, &evaluation));
}

void full_fit(benchmark::State& state) {
  const BiasProblem problem = smooth_problem(state.range(0), 1);
  for (auto _ : state) {
    const auto model = BiasModel::fit(problem, {});
    TRAMMEL_CHECK(model.has_value());
    state.counters["evaluations"] = model->report().evaluations;
    state.counters["loo_um"] = 1e6 * model->report().leave_one_out_rms;
    state.counters["nats"] = model->report().log_likelihood.sum();
    state.counters["at_best"] = model->report().starts_at_best;
  }
}

void restore(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(BiasModel::restore(model.state()));
}

void mean_of_one_target(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0));
  const JointVector q = random_joints(1, 7).row(0);
  for (auto _ : state) benchmark::DoNotOptimize(model.mean_B(q));
}

void mean_of_10000_targets(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0));
  const Eigen::MatrixXd q = random_joints(10000, 7);
  for (auto _ : state) benchmark::DoNotOptimize(model.mean_all_B(q));
}

void prediction_of_one_target(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0));
  const JointVector q = random_joints(1, 7).row(0);
  for (auto _ : state) benchmark::DoNotOptimize(model.predict(q));
}

void prediction_of_1000_targets(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0));
  const Eigen::MatrixXd q = random_joints(1000, 7);
  for (auto _ : state) benchmark::DoNotOptimize(model.predict_all(q));
}

void sizes(benchmark::internal::Benchmark* benchmark) {
  for (const int count : {300, 800, 1200, 2000}) benchmark->Arg(count);
}

BENCHMARK(likelihood_and_gradient)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(full_fit)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(restore)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(mean_of_one_target)->Apply(sizes)->Unit(benchmark::kMicrosecond);
BENCHMARK(mean_of_10000_targets)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(prediction_of_one_target)->Apply(sizes)->Unit(benchmark::kMicrosecond);
BENCHMARK(prediction_of_1000_targets)->Apply(sizes)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace trammel

BENCHMARK_MAIN();
