// Checks of the first batch of a cell before anything is learned: mistakes of reading,
// each with 10 seeds, and good batches of robots as they are delivered. --seeds N, --kind TEXT,
// --good N: less of it; --verbose: every miss.
#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>

#include "tests/support/misread_batch.h"

namespace trammel {
namespace {

using test::FirstBatch;

struct Arguments {
  int seeds = 10, good = 200;
  std::string kind;
  int least_poses = 25;
  double least_spread = 0.4;
  bool verbose = false;
};

std::string described(const FirstBatch& f) {
  return fmt::format(
      "seed {} {} base {} tool {} oriented {} poses {} spread {:.2f} length {:.4f} zero {:.3f} "
      "outliers {:.2f} tracker {}",
      f.seed, f.robot, f.base_known, f.tool_known, f.orientation, f.poses, f.spread, f.length,
      f.zero, f.outliers, f.tracker);
}

void run_mistakes(const Arguments& arguments) {
  int all = 0, caught = 0, named = 0, first_named = 0;
  for (const test::Misreading& mistake : test::misreadings()) {
    if (mistake.kind.find(arguments.kind) == std::string::npos) continue;
    int here = 0, named_here = 0;
    for (int seed = 1; seed <= arguments.seeds; ++seed) {
      FirstBatch first =
          test::first_batch(static_cast<std::uint64_t>(seed), test::Robots::kOfSixJoints);
      first.poses = std::max(first.poses, arguments.least_poses);
      first.spread = std::max(first.spread, arguments.least_spread);
      if (mistake.needs_orientation) first.orientation = true;
      if (mistake.kind == "another point of the tool") first.tool_known = true;
      const auto cell = test::new_cell(first);
      MeasurementBatch batch = test::measured_first(first, *cell);
      std::mt19937_64 random(static_cast<std::uint64_t>(seed));
      const std::string expected = mistake.make(batch, *cell, random);
      const auto said = test::said_of(std::move(batch), *cell);
      ++all;
      here += said ? 1 : 0;
      const bool is_named = said && test::names(*said, expected);
      named_here += is_named ? 1 : 0;
      first_named += said && said->text.find(expected) != std::string::npos ? 1 : 0;
      if (arguments.verbose && !is_named)
        std::cout << "  " << mistake.kind << ": " << described(first) << "\n    expected '"
                  << expected << "': " << (said ? sentence(*said) : "nothing") << "\n";
    }
    std::cout << fmt::format("{:30} refused {} named {} of {}\n", mistake.kind, here, named_here,
                             arguments.seeds)
              << std::flush;
    caught += here;
    named += named_here;
  }
  if (all == 0) return;
  std::cout << fmt::format(
      "figure misread batches refused, %: {:.1f}\nfigure misread batches named, %: {:.1f}\n"
      "named before any other reading that fits as well, %: {:.1f}\n",
      100.0 * caught / all, 100.0 * named / all, 100.0 * first_named / all);
}

void run_good(const Arguments& arguments) {
  int refused = 0;
  double seconds = 0;
  for (int seed = 1; seed <= arguments.good; ++seed) {
    const FirstBatch first =
        test::first_batch(1000 + static_cast<std::uint64_t>(seed), test::Robots::kAll);
    const auto cell = test::new_cell(first);
    MeasurementBatch batch = test::measured_first(first, *cell);
    const auto begin = std::chrono::steady_clock::now();
    const auto said = test::said_of(std::move(batch), *cell);
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    refused += said ? 1 : 0;
    if (said && arguments.verbose)
      std::cout << "  " << described(first) << "\n    " << sentence(*said) << "\n";
  }
  std::cout << fmt::format("figure good first batches refused of {}: {}\nmean look: {:.3f} s\n",
                           arguments.good, refused, seconds / std::max(1, arguments.good));
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::Arguments arguments;
  CLI::App app("First batches that were read wrongly");
  app.add_option("--seeds", arguments.seeds, "of each mistake");
  app.add_option("--kind", arguments.kind, "mistakes whose name has this in it");
  app.add_option("--good", arguments.good, "good batches");
  app.add_option("--least-poses", arguments.least_poses, "of a batch with a mistake");
  app.add_option("--least-spread", arguments.least_spread,
                 "of its joints, as a share of their ranges");
  app.add_flag("--verbose", arguments.verbose, "say every miss");
  CLI11_PARSE(app, argc, argv);
  trammel::run_mistakes(arguments);
  trammel::run_good(arguments);
  return 0;
}
