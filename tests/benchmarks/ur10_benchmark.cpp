// The measured UR10 (../shared/data), base and tool unknown, each series held out at the poses
// whose ids end in 7, 8 and 9. `ur10_benchmark [c|d|maps|maps200|coupled]`; without a word all of
// them.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "server/base/units.h"
#include "server/robot/cell_file.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/ur10.h"

namespace trammel {
namespace {

using test::demand;
using test::tell_figure;
using test::ur10_cell;
using test::ur10_series;

constexpr const char* kJointMaps =
    "M3,joint_map:1,joint_map:2,joint_map:3,joint_map:4,joint_map:5,joint_map:6";

TrainOptions with(const std::string& level, const std::string& bias) {
  TrainOptions options;
  options.level = level;
  options.bias = bias;
  return options;
}

Evaluation held_out(const CompensatedModel& model) { return model.parts().validation.value(); }

void matern(const std::string& name) {
  const Evaluation evaluation =
      held_out(demand(train(ur10_cell(), ur10_series(name), with("M3", "matern52"))));
  tell_figure("UR10 " + name + " nominal, mm", to_mm(evaluation.nominal.rms));
  tell_figure("UR10 " + name + " geometry and compliance, mm", to_mm(evaluation.calibrated.rms));
  tell_figure("UR10 " + name + " with matern52, mm", to_mm(evaluation.compensated.rms));
}

/// The other series was measured months later: base and tool are taken from 60 of its poses, all
/// else from the first.
void maps() {
  const CompensatedModel c = demand(train(ur10_cell(), ur10_series("c"), with(kJointMaps, "none")));
  tell_figure("UR10 c joint maps, mm", to_mm(held_out(c).calibrated.rms));
  TrainOptions refit = with(kJointMaps, "none");
  refit.from = c;
  const CompensatedModel d = demand(train(ur10_cell(), ur10_series("d", 60, 7), refit));
  tell_figure("UR10 d from c, joint maps, mm", to_mm(held_out(d).calibrated.rms));
  refit.from = demand(train(ur10_cell(), ur10_series("c"), with("M3", "none")));
  const CompensatedModel without = demand(train(ur10_cell(), ur10_series("d", 60, 7), refit));
  tell_figure("UR10 d from c, without maps, mm", to_mm(held_out(without).calibrated.rms));
}

void maps_of_200_poses() {
  const CompensatedModel c =
      demand(train(ur10_cell(), ur10_series("c", 200), with(kJointMaps, "se")));
  tell_figure("UR10 c joint maps, 200 poses, mm", to_mm(held_out(c).calibrated.rms));
}

void coupled(const std::string& name) {
  const Evaluation evaluation = held_out(demand(
      train(ur10_cell(), ur10_series(name), with("M3", "matern52 + joint_map + parameters"))));
  const OrientationFigures& turned = evaluation.orientation.value();
  const auto tell = [&](const char* what, double value) {
    tell_figure("UR10 " + name + " coupled bias, " + what, value);
  };
  tell("mm", to_mm(evaluation.compensated.rms));
  tell("inside 95 %", 100 * evaluation.coverage_95);
  tell("calibrated, deg", to_deg(turned.calibrated));
  tell("deg", to_deg(turned.compensated));
  tell("orientations inside 95 %", 100 * turned.coverage_95.value());
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  if (!trammel::test::has_ur10())
    return std::puts("the measured UR10 is not at hand (../shared/data)"), 0;
  const std::string only = argc > 1 ? argv[1] : "";
  for (const char* name : {"c", "d"}) {
    if (only.empty() || only == name) trammel::matern(name);
  }
  if (only.empty() || only == "maps") trammel::maps();
  if (only.empty() || only == "maps200") trammel::maps_of_200_poses();
  for (const char* name : {"c", "d"}) {
    if (only.empty() || only == "coupled") trammel::coupled(name);
  }
}
