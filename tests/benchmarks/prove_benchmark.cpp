// Sizes from which causes are named, proved in a batch's own residuals, beside those that the
// diagnosis predicts: on arms of the second simulation and on the measured UR10 (../shared/data).
// `prove_benchmark [--arms N] [--poses N] [--minutes N] [--ur10 c|d]`: minutes of each batch.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "clients/cli/work/in_parallel.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/figure.h"
#include "tests/support/from_rows.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/ur10.h"

namespace trammel {
namespace {

constexpr double kNear = 0.15;  // of the predicted size

struct Settings {
  int arms = 3, poses = 120;
  double minutes = 30;
  std::string ur10;
};

DiagnoseOptions proving(double minutes) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double, std::ratio<60>>(minutes);
  DiagnoseOptions options = test::quick();
  options.prove = {.has_time = [end](int) { return Clock::now() < end; },
                   .for_each =
                       [](std::size_t count, const std::function<void(std::size_t)>& work) {
                         cli::in_parallel(
                             count, work, [](double) {}, 1);
                       }};
  return options;
}

/// The proofs of several batches, counted.
struct Sums {
  int causes = 0, proved = 0, never = 0, open = 0, healthy = 0, healthy_misnamed = 0;
  int tried = 0, misnamed = 0;
  std::vector<double> ratios;  ///< proved over predicted size

  void add(const Proof& proof) {
    healthy += proof.healthy.tried;
    healthy_misnamed += proof.healthy.misnamed;
    for (const ProvedCause& one : proof.causes) {
      ++causes;
      ++(one.never ? never : one.is_proved() ? proved : open);
      for (const PutIn& size : one.sizes) {
        tried += size.tried;
        misnamed += size.misnamed;
      }
      if (one.is_proved() && one.predicted) ratios.push_back(*one.smallest / *one.predicted);
    }
  }
};

void print_line(const ProvedCause& one) {
  const auto um = [](const std::optional<double>& size) { return size ? 1e6 * *size : NAN; };
  std::printf("  %-36s predicted %8.1f um, proved %8.1f um (%.1f to %.1f)%s\n",
              to_string(one.cause).c_str(), um(one.predicted), um(one.smallest), um(one.from),
              um(one.to), one.never ? "  never named" : "");
}

void add_proof(const std::string& name, const Result<Diagnosis>& result, Sums& sums) {
  const Proof proof = test::demand(result).proof.value();
  std::printf("%s\n", name.c_str());
  for (const ProvedCause& one : proof.causes) print_line(one);
  sums.add(proof);
}

double percent(double part, double whole) { return whole > 0 ? 100 * part / whole : 0; }

void tell(Sums sums) {
  std::sort(sums.ratios.begin(), sums.ratios.end());
  const auto near = std::count_if(sums.ratios.begin(), sums.ratios.end(),
                                  [](double ratio) { return std::abs(ratio - 1) <= kNear; });
  test::tell_figure("proof, causes", sums.causes);
  test::tell_figure("proof, causes proved, %", percent(sums.proved, sums.causes));
  test::tell_figure("proof, causes never named, %", percent(sums.never, sums.causes));
  test::tell_figure("proof, causes open, %", percent(sums.open, sums.causes));
  test::tell_figure("proof, another cause named for sure, %", percent(sums.misnamed, sums.tried));
  test::tell_figure("proof, false names with nothing put in, %",
                    percent(sums.healthy_misnamed, sums.healthy));
  if (sums.ratios.empty()) return;
  test::tell_figure("proof, within 15 % of the prediction, %",
                    percent(static_cast<double>(near), static_cast<double>(sums.ratios.size())));
  test::tell_figure("proof, median of proved over predicted", sums.ratios[sums.ratios.size() / 2]);
}

void run(const Settings& settings) {
  Sums sums;
  for (int arm = 1; settings.ur10.empty() && arm <= settings.arms; ++arm) {
    const hidden::HiddenCase hidden = hidden::hide(
        {.kind = "null_white", .seed = static_cast<std::uint64_t>(arm), .poses = settings.poses});
    add_proof(fmt::format("arm {}", arm), test::diagnose_files(hidden, proving(settings.minutes)),
              sums);
  }
  if (!settings.ur10.empty() && test::has_ur10()) {
    add_proof("UR10 " + settings.ur10,
              diagnose(test::ur10_cell(), test::ur10_series(settings.ur10, settings.poses, 3),
                       proving(settings.minutes)),
              sums);
  }
  tell(std::move(sums));
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::Settings settings;
  CLI::App app("Sizes from which causes are named, proved and predicted");
  app.add_option("--arms", settings.arms, "Arms of the second simulation");
  app.add_option("--poses", settings.poses, "Poses of each batch");
  app.add_option("--minutes", settings.minutes, "Time of each batch");
  app.add_option("--ur10", settings.ur10, "Series of the measured UR10 instead: c or d");
  CLI11_PARSE(app, argc, argv);
  trammel::run(settings);
  return 0;
}
