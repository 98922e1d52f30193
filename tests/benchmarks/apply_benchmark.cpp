// The worth of `diagnose --apply` on another day. The second simulation hides an effect, its batch
// is diagnosed and applied; then the same robot is measured on another day: it starts cold, the
// instrument stands elsewhere, and what the instrument did the day before is gone. 1000 fresh noisy
// poses judge the models without and with what was found, each with its base put where the fresh
// poses have it. `apply_benchmark [--trials N] [--poses N] [--kinds A,B] [--lambda L]`
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <sstream>

#include "server/base/units.h"
#include "server/diagnose/diagnose.h"
#include "server/robot/cell_file.h"
#include "server/robot/rigid_fit.h"
#include "server/tasks/train/extend.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/hidden_case.h"
#include "tests/support/hidden_files.h"

namespace trammel {
namespace {

using hidden::HiddenCase;
using hidden::HiddenSpec;
using test::demand;

constexpr int kFresh = 1000;
constexpr double kHeldOut = 0.2;  // as `diagnose --apply` draws it

struct Settings {
  int trials = 1;
  int poses = 300;
  double lambda = 200;
  std::string kinds;
};

/// True unless the effect is of that day alone: an instrument's, or that of a single pose.
bool is_of_the_robot(const hidden::Effect& effect) {
  const std::string& cause = effect.cause.cause;
  return cause != "tracker_moved" && cause != "tracker_drift" && cause != "outlier";
}

/// Another day of the same robot: 1000 rows that the batch's reader reads.
MeasurementBatch another_day(const HiddenCase& hidden, const HiddenSpec& spec) {
  hidden::World world = hidden.world;
  hidden::Random random(spec.seed * 977 + 5);
  hidden::PosePlan plan{.count = kFresh, .ranges = spec.ranges};
  plan.course = spec.kind == "time_lag" ? hidden::Course::kPath : hidden::Course::kScattered;
  plan.tools = static_cast<int>(world.tools.size());
  plan.loads = static_cast<int>(world.loads.size());
  world.poses = draw_poses(plan, random);
  for (hidden::MeasuringPose& pose : world.poses) pose.index += 100000;  // after all that happened
  std::erase_if(world.effects, [](const hidden::Effect& one) { return !is_of_the_robot(one); });
  hidden::Frames frames = frames_at(world, world.poses, world.effects);
  for (Eigen::Matrix4d& frame : frames) {
    for (int axis = 0; axis < 3; ++axis) frame(axis, 3) += world.sigma_mm * hidden::normal(random);
  }
  return demand(parse_batch_csv(batch_text(world, frames), "fresh.csv"));
}

/// m: what the model leaves of the rows, its base put where they have it.
double rms_of(const CompensatedModel& model, const CheckedBatch& fresh) {
  std::vector<PoseContext> contexts;
  Eigen::Matrix3Xd measured(3, static_cast<Eigen::Index>(fresh.size()));
  for (const Measurement& m : fresh.rows().measurements) {
    measured.col(static_cast<Eigen::Index>(contexts.size())) = m.p_W;
    contexts.push_back(m.context);
    contexts.back().served = true;
  }
  Eigen::Matrix3Xd predicted(3, measured.cols());
  Eigen::Index column = 0;
  for (const ErrorPrediction& one : model.predict_all(contexts))
    predicted.col(column++) = one.X_BT_predicted.translation();
  const Pose X = demand(fit_transform(predicted, measured));
  const Eigen::Matrix3Xd left = (X.linear() * measured).colwise() + X.translation() - predicted;
  return std::sqrt(left.squaredNorm() / static_cast<double>(left.cols()));
}

struct Count {
  int yes = 0, all = 0;
  void add(bool is) {
    ++all;
    yes += is ? 1 : 0;
  }
  [[nodiscard]] double percent() const { return all == 0 ? 100 : 100.0 * yes / all; }
};

struct Figures {
  int runs = 0, refused = 0, applied = 0, gained = 0;
  double worst = 0;  ///< rms after / before on fresh poses, of what was applied
  Count no_worse, within, inside, inside_large, random_within;
};

HiddenSpec spec_of(const std::string& kind, int seed, const Settings& settings) {
  HiddenSpec spec{.kind = kind,
                  .seed = static_cast<std::uint64_t>(seed),
                  .lambda = settings.lambda,
                  .poses = settings.poses};
  spec.orientation = seed % 2 == 1;
  return spec;
}

void judge(const Extension& extension, double before, double after, Figures& figures) {
  const double fresh = 1 - after / before;
  const double by_random_rows = 1 - extension.gain.rms_after / extension.gain.rms_before;
  ++figures.applied;
  figures.worst = std::max(figures.worst, after / before);
  figures.no_worse.add(after <= 1.02 * before);
  if (!extension.day) return;
  const bool inside = fresh >= extension.day->lower && fresh <= extension.day->upper;
  figures.inside.add(inside);
  if (fresh < 0.3) return;
  figures.inside_large.add(inside);
  figures.within.add(std::abs(extension.day->share - fresh) <= 0.15 * fresh);
  figures.random_within.add(std::abs(by_random_rows - fresh) <= 0.15 * fresh);
}

void run(const std::string& kind, int seed, const Settings& settings, Figures& figures) {
  const HiddenSpec spec = spec_of(kind, seed, settings);
  const HiddenCase hidden = hidden::hide(spec);
  const auto cell = std::make_shared<const Cell>(
      demand(parse_cell(hidden.cell_yaml, hidden.robot_yaml, "cell.yaml")));
  const CheckedBatch batch = demand(check_against_cell(
      demand(parse_batch_csv(hidden.batch_csv, "batch.csv")), *cell, drawn(kHeldOut, 1)));
  ++figures.runs;
  const clock_t begun = std::clock();
  const auto diagnosis = diagnose(cell, batch, {});
  if (!diagnosis) return;
  const auto extension = extend(cell, batch, *diagnosis, {});
  const double seconds = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
  if (!extension) {
    ++figures.refused;
    std::printf("%-22s %3d  %5.1f s  nothing to apply (%s)\n", kind.c_str(), seed, seconds,
                std::string(to_string(diagnosis->verdict)).c_str());
    return;
  }
  const CheckedBatch fresh = demand(check_against_cell(another_day(hidden, spec), *cell));
  const double before = rms_of(extension->before, fresh);
  const double after = rms_of(extension->after, fresh);
  std::printf(
      "%-22s %3d  %5.1f s  %-9s fresh %.4f -> %.4f mm (%+.0f %%)  random rows %+.0f %%  %s  "
      "[%s]%s\n",
      kind.c_str(), seed, seconds, extension->why_not().empty() ? "applied" : "not", to_mm(before),
      to_mm(after), 100 * (1 - after / before),
      100 * (1 - extension->gain.rms_after / extension->gain.rms_before),
      extension->day
          ? fmt::format("another day {:+.0f} % [{:+.0f}, {:+.0f}]", 100 * extension->day->share,
                        100 * extension->day->lower, 100 * extension->day->upper)
                .c_str()
          : "no day",
      fmt::format("{}", fmt::join(extension->sources, " ")).c_str(),
      after > 1.02 * before ? "  WORSE" : "");
  std::fflush(stdout);
  if (extension->why_not().empty()) judge(*extension, before, after, figures);
}

std::vector<std::string> kinds_of(const Settings& settings) {
  std::vector<std::string> kinds;
  std::istringstream words(settings.kinds);
  for (std::string word; std::getline(words, word, ',');) kinds.push_back(word);
  if (!kinds.empty()) return kinds;
  for (const auto* list :
       {&hidden::decidable_kinds(), &hidden::slow_kinds(), &hidden::foreign_kinds()})
    kinds.insert(kinds.end(), list->begin(), list->end());
  kinds.insert(kinds.end(), {"mixture2", "null_white"});
  return kinds;
}

void tell(const Figures& figures) {
  std::printf("%d runs, %d applied, %d with nothing to apply\n", figures.runs, figures.applied,
              figures.refused);
  std::printf("apply on another day: worst rms after over before %.3f (aim 1.02)\n", figures.worst);
  const auto line = [](const char* what, const Count& count, const char* aim) {
    std::printf("apply on another day: %s %.1f %% (%d of %d) aim %s\n", what, count.percent(),
                count.yes, count.all, aim);
  };
  line("never worse by more than 2 %,", figures.no_worse, "100");
  line("gain of 30 % or more claimed within 15 %,", figures.within, ">= 90");
  line("the same by rows held out at random,", figures.random_within, "");
  line("such a gain inside its stated interval,", figures.inside_large, ">= 90");
  line("any gain inside its stated interval,", figures.inside, ">= 90");
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::Settings settings;
  CLI::App app("What an applied diagnosis is worth on another day.");
  app.add_option("--trials", settings.trials, "a kind");
  app.add_option("--poses", settings.poses);
  app.add_option("--lambda", settings.lambda, "of the effect hidden");
  app.add_option("--kinds", settings.kinds, "only these, joined by ','");
  CLI11_PARSE(app, argc, argv);
  trammel::Figures figures;
  for (int seed = 1; seed <= settings.trials; ++seed) {
    for (const std::string& kind : trammel::kinds_of(settings))
      trammel::run(kind, seed, settings, figures);
  }
  trammel::tell(figures);
  return 0;
}
