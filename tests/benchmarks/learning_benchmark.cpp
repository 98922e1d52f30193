// The damage to a model in force when bad batches are submitted, and the gains that
// go in force by themselves. A line a case: true error after over before (the virtual robot's,
// which the trainer never sees), over all seeds. --seeds N, --cases a,b: less of it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <iostream>

#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"

namespace trammel {
namespace {

using test::Day;
using test::LearningCell;
using test::measured_on;
using test::true_error;

struct World {
  std::shared_ptr<const Cell> cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
};

struct Outcome {
  double before = 0, after = 0;  ///< m
  bool changed = false;
  std::string what;
};

/// The result of `attack` on a model of a good first day.
Outcome outcome_of(const World& world, std::uint64_t seed,
                   const std::function<std::string(LearningCell&)>& attack) {
  LearningCell cell(world.cell);
  cell.submit(measured_on(world.robot, {.seed = seed}));
  Outcome outcome;
  outcome.before = true_error(cell.model(), world.robot);
  const int version = cell.in_force();
  outcome.what = "\n      " + attack(cell);
  outcome.after = true_error(cell.model(), world.robot);
  outcome.changed = cell.in_force() != version;
  return outcome;
}

/// A batch that comes with the question what is wrong, to be applied.
std::string applied_inline(LearningCell& cell, MeasurementBatch batch) {
  batch.source_text.clear();
  const auto job = cell.trainer().diagnose("cell-7", "", to_csv(batch), true);
  return job ? cell.finished(*job).what : sentence(job.error());
}

/// A model that was trained elsewhere, from few and noisy poses.
std::string imported(LearningCell& cell, const World& world, std::uint64_t seed) {
  LearningCell elsewhere(world.cell);
  elsewhere.submit(measured_on(world.robot, {.poses = 40, .seed = seed, .noise = 3}));
  const auto version = cell.trainer().import_model("cell-7", serialize(elsewhere.model()));
  if (!version) return sentence(version.error());
  const Status activated = cell.trainer().activate("cell-7", *version);
  return activated ? "activated" : sentence(activated.error());
}

/// The result of `days` for a model from `first`; judged by the robot as it is at the end.
Outcome outcome(const World& world, const VirtualRobot& at_the_end,
                const std::vector<MeasurementBatch>& days, const std::string& tool = {}) {
  LearningCell cell(world.cell);
  cell.submit(days.front());
  Outcome outcome;
  outcome.before = true_error(cell.model(), at_the_end, tool);
  const int version = cell.in_force();
  for (std::size_t i = 1; i < days.size(); ++i)
    outcome.what += "\n      " + cell.submit(days[i]).what;
  outcome.after = true_error(cell.model(), at_the_end, tool);
  outcome.changed = cell.in_force() != version;
  return outcome;
}

MeasurementBatch judged_by_copies(MeasurementBatch batch) {
  const std::size_t n = batch.measurements.size();
  for (std::size_t i = 0; i < n; ++i) {
    batch.measurements[i].set = MeasurementSet::kTrain;
    Measurement copy = batch.measurements[i];
    copy.pose_id = "copy-" + copy.pose_id;
    copy.set = MeasurementSet::kValidation;
    batch.measurements.push_back(std::move(copy));
  }
  return batch;
}

World with_two_tools() {
  World world;
  auto cell = std::make_shared<Cell>(*world.cell);
  Pose probe = *cell->tools.at("spindle");
  probe.translation() += Vector3(0.03, 0.05, 0.12);
  cell->tools["probe"] = probe;
  world.cell = cell;
  world.robot = test::chapter_5_robot(cell);
  return world;
}

using Case = std::function<Outcome(std::uint64_t seed)>;

std::vector<std::pair<std::string, Case>> attacks() {
  const auto second = [](Day day) {
    return [day](std::uint64_t seed) mutable {
      const World world;
      day.seed = seed + 500;
      return outcome(world, world.robot,
                     {measured_on(world.robot, {.seed = seed}), measured_on(world.robot, day)});
    };
  };
  return {
      {"corner, tracker set up anew, 25 poses",
       second({.poses = 25, .corner = 0.3, .set_up_anew = true})},
      {"corner, 100 poses", second({.poses = 100, .corner = 0.3})},
      {"half the ranges, tracker set up anew, 60 poses",
       second({.poses = 60, .corner = 0.6, .set_up_anew = true})},
      {"noise 1.45, 100 poses", second({.poses = 100, .noise = 1.45})},
      {"noise 1.45, tracker set up anew, 100 poses",
       second({.poses = 100, .noise = 1.45, .set_up_anew = true})},
      {"noise 1, 100 poses", second({.poses = 100})},
      {"noise 1, 20 poses", second({.poses = 20})},
      {"corner judged by copies, 40 poses",
       [](std::uint64_t seed) {
         const World world;
         return outcome(world, world.robot,
                        {measured_on(world.robot, {.seed = seed}),
                         judged_by_copies(measured_on(
                             world.robot, {.poses = 40, .seed = seed + 500, .corner = 0.3}))});
       }},
      {"ten batches of 60, noise 1.2 to 3",
       [](std::uint64_t seed) {
         const World world;
         std::vector<MeasurementBatch> days{measured_on(world.robot, {.seed = seed})};
         for (int k = 1; k <= 10; ++k) {
           days.push_back(measured_on(world.robot, {.poses = 60,
                                                    .seed = seed + 37 * days.size(),
                                                    .noise = 1 + 0.2 * k,
                                                    .set_up_anew = true}));
         }
         return outcome(world, world.robot, days);
       }},
      {"inline apply of a corner, tracker set up anew, 40 poses",
       [](std::uint64_t seed) {
         const World world;
         const Day day{.poses = 40, .seed = seed + 500, .corner = 0.3, .set_up_anew = true};
         return outcome_of(world, seed, [&](LearningCell& cell) {
           return applied_inline(cell, measured_on(world.robot, day));
         });
       }},
      {"import of a model of 40 noisy poses",
       [](std::uint64_t seed) {
         const World world;
         return outcome_of(world, seed,
                           [&](LearningCell& cell) { return imported(cell, world, seed + 500); });
       }},
      {"80 poses of another tool alone, for the first tool",
       [](std::uint64_t seed) {
         const World world = with_two_tools();
         return outcome(
             world, world.robot,
             {measured_on(world.robot, {.seed = seed, .tool = "spindle"}),
              measured_on(world.robot, {.poses = 80, .seed = seed + 500, .tool = "probe"})},
             "spindle");
       }},
  };
}

std::vector<std::pair<std::string, Case>> gains() {
  const auto more_poses = [](bool anew) {
    return [anew](std::uint64_t seed) {
      const World world;
      return outcome(
          world, world.robot,
          {measured_on(world.robot, {.poses = 40, .seed = seed, .noise = 2}),
           measured_on(world.robot, {.poses = 400, .seed = seed + 500, .set_up_anew = anew})});
    };
  };
  const auto joint_2 = [](int poses, bool anew) {
    return [poses, anew](std::uint64_t seed) {
      const World world;
      const VirtualRobot changed = test::with_zero_off(world.robot, 2, 1e-3);
      return outcome(
          world, changed,
          {measured_on(world.robot, {.seed = seed}),
           measured_on(changed, {.poses = poses, .seed = seed + 500, .set_up_anew = anew})});
    };
  };
  const auto better_noise = [](std::uint64_t seed) {
    const World world;
    return outcome(world, world.robot,
                   {measured_on(world.robot, {.seed = seed, .noise = 3}),
                    measured_on(world.robot, {.seed = seed + 500, .set_up_anew = true})});
  };
  return {{"200 poses after 200 with three times the noise, tracker set up anew", better_noise},
          {"400 good poses after 40 noisy ones", more_poses(false)},
          {"the same, tracker set up anew", more_poses(true)},
          {"joint 2 changed by 1 mrad, 200 poses", joint_2(200, false)},
          {"the same, 120 poses", joint_2(120, false)},
          {"the same, 200 poses, tracker set up anew", joint_2(200, true)}};
}

void run(const std::vector<std::pair<std::string, Case>>& cases, int seeds, const std::string& only,
         bool talk) {
  for (const auto& [name, ask] : cases) {
    if (name.find(only) == std::string::npos) continue;
    std::vector<double> ratios;
    int changed = 0, worse = 0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const Outcome one = ask(static_cast<std::uint64_t>(100 * seed));
      ratios.push_back(one.after / one.before);
      changed += one.changed ? 1 : 0;
      worse += one.after > std::max(1.15 * one.before, one.before + 1e-6) ? 1 : 0;
      if (talk)
        fmt::print("    {:.4f} -> {:.4f} mm{}\n", to_mm(one.before), to_mm(one.after), one.what);
    }
    std::sort(ratios.begin(), ratios.end());
    fmt::print(
        "{:58} median {:.3f}, worst {:.3f}; another version in force {}/{}; worse than allowed "
        "{}\n",
        name, ratios[ratios.size() / 2], ratios.back(), changed, seeds, worse);
    std::cout.flush();
  }
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What batches do to the model in force");
  int seeds = 20;
  std::string only;
  bool talk = false;
  app.add_option("--seeds", seeds, "of each case");
  app.add_option("--only", only, "cases whose name has this in it");
  app.add_flag("--talk", talk, "every seed, with what the trainer said");
  CLI11_PARSE(app, argc, argv);
  fmt::print("attacks: true error after / before (aim: median <= 1, each <= 1.15 or 1 um more)\n");
  trammel::run(trammel::attacks(), seeds, only, talk);
  fmt::print("gains: (aim: in force by themselves in 95 %)\n");
  trammel::run(trammel::gains(), seeds, only, talk);
}
