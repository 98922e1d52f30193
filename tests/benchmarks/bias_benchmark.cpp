// The learned bias beside scikit-learn's Gaussian process (package python3-sklearn) on the same
// data in one run: time of a likelihood with its gradient, of a fit and of predictions, and how
// good they are; and how honest a model is beyond its training poses. `bias_benchmark [--quick]`
// and the options of Google Benchmark. scikit-learn models one output, ours three at once; its
// single start stands beside our 20.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>

#include "clients/cli/studies/study_tables.h"
#include "server/base/check.h"
#include "server/base/units.h"
#include "server/bias/bias_model.h"
#include "server/bias/process/gaussian_process.h"
#include "server/bias/search/hyperparameter_search.h"
#include "server/tasks/train/train.h"
#include "tests/bias/bias_data.h"
#include "tests/support/figure.h"
#include "tests/support/outside.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

BiasModel fitted(Index count, int starts) {
  BiasOptions options;
  options.starts = starts;
  auto model = BiasModel::fit(smooth_problem(count, 1), options);
  TRAMMEL_CHECK(model.has_value());
  return *std::move(model);
}

// ---- Google Benchmark: ours alone, at every size
// ------------------------------------------------------------------

struct LikelihoodCase {
  ProfiledLikelihood likelihood;
  VectorXd parameters;
};

LikelihoodCase likelihood_case(Index count) {
  const BiasProblem problem = smooth_problem(count, 1);
  GpPrior prior;
  prior.parameter_centre = VectorXd::Zero(6);
  VectorXd parameters = VectorXd::Constant(7, 0.3);
  parameters[6] = std::log(1e-3);
  return {ProfiledLikelihood(make_kernel("se"),
                             {problem.q, problem.residual_B, VectorXd::Ones(count)}, prior),
          parameters};
}

void likelihood_and_gradient(benchmark::State& state) {
  LikelihoodCase at = likelihood_case(state.range(0));
  ObjectiveValue evaluation;
  for (auto _ : state) benchmark::DoNotOptimize(at.likelihood.evaluate(at.parameters, &evaluation));
}

void full_fit(benchmark::State& state) {
  for (auto _ : state) {
    const BiasModel model = fitted(state.range(0), 20);
    state.counters["evaluations"] = model.report().evaluations;
    state.counters["loo_um"] = 1e6 * model.report().leave_one_out_rms;
    state.counters["nats"] = model.report().log_likelihood.sum();
    state.counters["at_best"] = model.report().starts_at_best;
  }
}

void restore(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0), 2);
  for (auto _ : state) benchmark::DoNotOptimize(BiasModel::restore(model.state()));
}

void mean(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0), 2);
  const MatrixXd q = random_joints(state.range(1), 7);
  for (auto _ : state) benchmark::DoNotOptimize(model.mean_all_B(q));
}

void mean_and_stddev(benchmark::State& state) {
  const BiasModel model = fitted(state.range(0), 2);
  const MatrixXd q = random_joints(state.range(1), 7);
  for (auto _ : state) benchmark::DoNotOptimize(model.predict_all(q));
}

// ---- one process: what a single target costs
// --------------------------------------------------------------------

// Noise of a few per cent of the signal: what a calibrated robot leaves over.
void variance(benchmark::State& state, VarianceForm form) {
  const auto count = static_cast<Index>(state.range(0));
  const MatrixXd q = random_joints(count, 3);
  const GpHyperparameters at = {VectorXd::Constant(6, std::log(0.9)), std::log(1e-4),
                                std::log(2.6e-5)};
  const auto gp =
      GaussianProcess::condition(make_kernel("se"), q, q.col(0), VectorXd::Ones(count), at, form);
  TRAMMEL_CHECK(gp.has_value());
  const MatrixXd targets = random_joints(1000, 4);
  Index next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(gp->variance(targets.middleRows(next, state.range(1))));
    next = (next + state.range(1)) % targets.rows();
  }
}

// ---- coupled: a bias on top of M3 of a virtual robot with gear errors, asked as a cell asks
// -----------------------

// Trained once for each number of poses; hundreds of columns.
const CompensatedModel& coupled_model(int poses) {
  static std::map<int, CompensatedModel> models;
  const auto known = models.find(poses);
  if (known != models.end()) return known->second;
  TrainOptions options;
  options.level = "M3";
  options.bias = "matern52 + joint_map + parameters";
  VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  for (const char* spec : {"joint_map:1@9", "joint_map:2@7", "joint_map:3@8"}) {
    const auto map = make_error_source(spec, *robot.truth.cell);
    TRAMMEL_CHECK(map.has_value());
    const Index first = add_source(robot.truth, *map);
    robot.truth.values.segment(first, static_cast<Index>((*map)->parameters().size()))
        .setConstant(4e-5);
  }
  auto model = train(robot.truth.cell, test::measured(robot, poses, 11), options);
  TRAMMEL_CHECK(model.has_value());
  return models.emplace(poses, *std::move(model)).first->second;
}

struct CoupledTargets {
  MatrixXd q;
  std::vector<BiasFeatures> features;
};

CoupledTargets coupled_targets(const CompensatedModel& model, Index count) {
  CoupledTargets targets;
  const MatrixXd& known = model.parts().bias->q;
  targets.q.resize(count, known.cols());
  std::mt19937_64 random(7);
  for (Index i = 0; i < count; ++i) {
    for (Index j = 0; j < known.cols(); ++j)
      targets.q(i, j) =
          std::uniform_real_distribution(model.parts().q_min(j), model.parts().q_max(j))(random);
    PoseContext context = model.parts().bias_contexts.front();
    context.q = targets.q.row(i);
    targets.features.push_back(model.features(context));
  }
  return targets;
}

void coupled_mean(benchmark::State& state) {
  const CompensatedModel& model = coupled_model(static_cast<int>(state.range(0)));
  const CoupledTargets targets = coupled_targets(model, state.range(1));
  for (auto _ : state)
    benchmark::DoNotOptimize(model.bias()->mean_all_B(targets.q, targets.features));
}

void coupled_mean_and_stddev(benchmark::State& state) {
  const CompensatedModel& model = coupled_model(static_cast<int>(state.range(0)));
  const CoupledTargets targets = coupled_targets(model, state.range(1));
  for (auto _ : state)
    benchmark::DoNotOptimize(model.bias()->predict_all(targets.q, targets.features));
}

void coupled_correction(benchmark::State& state) {
  const CompensatedModel& model = coupled_model(static_cast<int>(state.range(0)));
  const CoupledTargets targets = coupled_targets(model, 1);
  const PoseContext& context = model.parts().bias_contexts.front();
  Target target;
  target.joint_target = true;
  target.seed = targets.q.row(0);
  for (auto _ : state)
    benchmark::DoNotOptimize(model.correct(target, context.tool, context.payload));
}

void sizes(benchmark::internal::Benchmark* benchmark) {
  for (const int count : {300, 800, 1200, 2000}) benchmark->Arg(count);
}
void sizes_and_targets(benchmark::internal::Benchmark* benchmark) {
  for (const int count : {300, 1200, 2000}) benchmark->Args({count, 1})->Args({count, 10000});
}

BENCHMARK(likelihood_and_gradient)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(full_fit)->Apply(sizes)->Arg(5000)->Unit(benchmark::kMillisecond);
BENCHMARK(restore)->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK(mean)->Apply(sizes_and_targets)->Unit(benchmark::kMicrosecond);
BENCHMARK(mean_and_stddev)->Apply(sizes_and_targets)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(variance, exact, VarianceForm::kExact)
    ->ArgsProduct({{200, 1200, 4000}, {1, 1000}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(variance, served, VarianceForm::kServed)
    ->ArgsProduct({{200, 1200, 4000}, {1, 1000}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(coupled_mean)->Args({1200, 1})->Args({1200, 10000})->Unit(benchmark::kMicrosecond);
BENCHMARK(coupled_mean_and_stddev)
    ->Args({1200, 1})
    ->Args({1200, 10000})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(coupled_correction)->Arg(1200)->Unit(benchmark::kMicrosecond);

// ---- beside scikit-learn
// ----------------------------------------------------------------------------------------------

struct Table {
  MatrixXd q;
  VectorXd y;
};

// Height of the tip of a arm of eight joints that turn about different axes, with noise: strongly
// nonlinear, every joint matters. Units of length; our own chain.
Table eight_joint_arm(Index count, std::uint64_t seed) {
  Table table{random_joints(count, seed, 8), VectorXd(count)};
  std::mt19937_64 random(seed + 500);
  const double length[] = {0.5, 1.0, 0.8, 0.7, 0.5, 0.4, 0.3, 0.2};
  for (Index i = 0; i < count; ++i) {
    Matrix3 R = Matrix3::Identity();
    Vector3 p = Vector3::Zero();
    for (int j = 0; j < 8; ++j) {
      const Vector3 axis = j % 3 == 0 ? Vector3(Vector3::UnitZ())
                                      : Vector3(j % 3 == 1 ? Vector3::UnitY() : Vector3::UnitX());
      R = R * Eigen::AngleAxisd(table.q(i, j), axis).toRotationMatrix();
      p += R * (length[j] * Vector3(0.6, 0.0, 0.8));
    }
    table.y[i] = p.z() + 0.05 * normal(&random);
  }
  return table;
}

Table smooth_output(Index count, std::uint64_t seed) {
  const BiasProblem problem = smooth_problem(count, seed);
  return {problem.q, problem.residual_B.col(0)};
}

void write(const Table& table, const std::string& path) {
  std::ofstream file(path);
  file.precision(17);
  for (Index i = 0; i < table.y.size(); ++i) {
    for (Index j = 0; j < table.q.cols(); ++j) file << table.q(i, j) << ',';
    file << table.y[i] << '\n';
  }
}

// Processor seconds, as the script beside it counts: other programs run here too.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double least_seconds(int repeats, const std::function<void()>& work) {
  double least = std::numeric_limits<double>::max();
  for (int i = 0; i < repeats; ++i) {
    const double start = processor_seconds();
    work();
    least = std::min(least, processor_seconds() - start);
  }
  return least;
}

using Figures = std::map<std::string, double>;

// Judges one output's predictions, and what the model thinks of its data.
void judge(const Table& train, const Table& test, Figures* figures) {
  const double centre = train.y.mean();
  const VectorXd noise_shape = VectorXd::Ones(train.y.size());
  const GpData data{train.q, train.y.array() - centre, noise_shape};
  // No metrology here, as scikit-learn has none: the prior on the noise is put where it costs
  // nothing.
  const auto found = search_hyperparameters(make_kernel("se"), data, 1e-9, {});
  TRAMMEL_CHECK(found.has_value());
  const auto process = GaussianProcess::condition(make_kernel("se"), data.q, data.y, noise_shape,
                                                  found->outputs.front());
  TRAMMEL_CHECK(process.has_value());
  VectorXd mean(test.y.size());
  process->mean(test.q, mean.data());
  const auto variance = process->variance(test.q);
  double square = 0;
  double nlpd = 0;
  double inside = 0;
  for (Index i = 0; i < mean.size(); ++i) {
    const double error = test.y[i] - centre - mean[i];
    const double v = variance[static_cast<std::size_t>(i)].posterior + process->noise_variance();
    square += error * error;
    nlpd += 0.5 * std::log(2 * std::numbers::pi * v) + 0.5 * error * error / v;
    inside += std::abs(error) < 1.96 * std::sqrt(v) ? 1 : 0;
  }
  const auto n = static_cast<double>(mean.size());
  const double spread = std::sqrt((test.y.array() - test.y.mean()).square().mean());
  (*figures)["log_likelihood"] = process->log_likelihood();
  (*figures)["standardised_rmse"] = std::sqrt(square / n) / spread;
  (*figures)["nlpd"] = nlpd / n;
  (*figures)["coverage_95"] = inside / n;
}

void time_ours(Index count, Figures* figures) {
  LikelihoodCase at = likelihood_case(count);
  ObjectiveValue evaluation;
  (*figures)["likelihood_and_gradient_s"] =
      least_seconds(10, [&] { TRAMMEL_CHECK(at.likelihood.evaluate(at.parameters, &evaluation)); });
  (*figures)["fit_s"] = least_seconds(3, [&] { (void)fitted(count, 20); });
  const BiasModel model = fitted(count, 20);
  const MatrixXd many = random_joints(10000, 7);
  const MatrixXd one = many.topRows(1);
  (*figures)["mean_of_one_s"] =
      least_seconds(2000, [&] { benchmark::DoNotOptimize(model.mean_all_B(one)); });
  (*figures)["stddev_of_one_s"] =
      least_seconds(500, [&] { benchmark::DoNotOptimize(model.predict_all(one)); });
  (*figures)["mean_of_10000_s"] =
      least_seconds(5, [&] { benchmark::DoNotOptimize(model.mean_all_B(many)); });
  (*figures)["stddev_of_10000_s"] =
      least_seconds(5, [&] { benchmark::DoNotOptimize(model.predict_all(many)); });
}

void beside_sklearn(bool quick) {
  test::TemporaryFolder folder;
  std::map<std::string, Figures> ours;
  std::string command =
      "OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 /usr/bin/python3 " TRAMMEL_SOURCE_DIR
      "/tests/benchmarks/bias_sklearn.py " +
      folder.path().string();
  const auto add = [&](const std::string& name, const Table& train, const Table& test) {
    write(train, folder.file(name + "_train.csv"));
    write(test, folder.file(name + "_test.csv"));
    judge(train, test, &ours[name]);
    command += " " + name;
  };
  for (const Index count : quick ? std::vector<Index>{300} : std::vector<Index>{300, 800, 1200}) {
    const std::string name = "smooth" + std::to_string(count);
    add(name, smooth_output(count, 1), smooth_output(2000, 2));
    time_ours(count, &ours[name]);
  }
  for (const Index count : quick ? std::vector<Index>{1000} : std::vector<Index>{1000, 3000})
    add("arm" + std::to_string(count), eight_joint_arm(count, 3), eight_joint_arm(2000, 4));

  std::FILE* pipe = popen(command.c_str(), "r");
  TRAMMEL_CHECK(pipe != nullptr);
  std::printf("\n%-10s %-26s %12s %12s %9s\n", "data", "figure", "ours", "sklearn", "ratio");
  char line[256];
  while (std::fgets(line, sizeof line, pipe) != nullptr) {
    std::istringstream words(line);
    std::string name, figure;
    double theirs = 0;
    words >> name >> figure >> theirs;
    const auto known = ours[name].find(figure);
    if (known == ours[name].end()) continue;
    std::printf("%-10s %-26s %12.6g %12.6g %9.3g\n", name.c_str(), figure.c_str(), known->second,
                theirs, theirs / known->second);
    std::fflush(stdout);
  }
  pclose(pipe);
}

// ---- beyond the training poses
// -------------------------------------------------------------------------------------

// Error, claimed stddev (mm, of a coordinate) and coverage of the 95 % interval at growing
// distances, all seeds together; true outsiders caught and insiders refused.
std::string share(int part, int all) {
  return all == 0 ? "none" : fmt::format("{:.1f} %", 100.0 * part / all);
}

/// The least and the most of a share, in %.
struct Range {
  double least = 100, most = 0;
  void take(double percent) {
    least = std::min(least, percent);
    most = std::max(most, percent);
  }
};

double percent(int part, int all) { return all == 0 ? 0 : 100.0 * part / all; }

void beyond_the_poses(bool quick) {
  Range within, farther, caught, refused;
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  std::printf("\n%-8s %-6s %6s", "box", "model", "learnt");
  for (const char* band : {"within", "to 0.1 ranges", "to 0.3", "to 1", "farther"})
    std::printf(" | %21s", band);
  std::printf(" | %8s %8s\n", "caught", "refused");
  for (const cli::BiasStudy& study : cli::kBiasStudies) {
    if (!study.name.starts_with("6dim")) continue;
    JointRanges ranges;
    for (const auto& [low, high] : study.ranges) ranges.emplace_back(from_deg(low), from_deg(high));
    for (const char* level : {"M0", "M1", "M2", "M3"}) {
      for (const int poses : quick ? std::vector{300} : std::vector{100, 300, 800}) {
        const test::OutsideFigures figures =
            test::asked_outside(robot, ranges, level, "se", poses, quick ? 1 : 3);
        std::printf("%-8s %-6s %6d", std::string(study.name).c_str(), level, poses);
        for (const test::OutsideBand& band : figures.bands) {
          std::printf(" | %6.3f %6.3f %5.1f %%", to_mm(band.rms), to_mm(band.stddev),
                      100 * band.coverage_95);
        }
        within.take(100 * figures.bands.front().coverage_95);
        farther.take(100 * figures.bands.back().coverage_95);
        if (figures.outsiders > 0) caught.take(percent(figures.caught, figures.outsiders));
        refused.take(percent(figures.refused, figures.insiders));
        std::printf(" | %8s %8s\n", share(figures.caught, figures.outsiders).c_str(),
                    share(figures.refused, figures.insiders).c_str());
        std::fflush(stdout);
      }
    }
  }
  test::tell_figure("within the poses, least inside 95 %", within.least);
  test::tell_figure("within the poses, most inside 95 %", within.most);
  test::tell_figure("a joint range and more out, least inside 95 %", farther.least);
  test::tell_figure("true outsiders not in domain, least %", caught.least);
  test::tell_figure("insiders refused, most %", refused.most);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  bool quick = false;
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--quick") == 0) {
      quick = true;
    } else {
      argv[kept++] = argv[i];
    }
  }
  argc = kept;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  trammel::beyond_the_poses(quick);
  if (std::system("/usr/bin/python3 -c 'import sklearn' 2>/dev/null") != 0) {
    std::puts("scikit-learn is not installed (package python3-sklearn): nothing to compare with");
    return 0;
  }
  trammel::beside_sklearn(quick);
  return 0;
}
