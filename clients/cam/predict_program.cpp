#include "clients/cam/predict_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "clients/cam/configuration.h"
#include "clients/cam/mark.h"
#include "clients/cam/nominal_targets.h"
#include "clients/cam/short_names.h"
#include "server/base/plain_text.h"
#include "server/exchange/si.h"

namespace trammel::cam {

namespace {

PredictedTarget begun(const Program& program, std::size_t t) {
  const ProgramTarget& target = program.targets[t];
  PredictedTarget row;
  row.name = target.name;
  row.file = program.files[target.file].name;
  row.line = target.line;
  row.motion = target.motion;
  row.used_at = target.used_at;
  row.tool = program.tools[target.tool].name;
  row.frame = program.frames[target.frame].name;
  row.status = "refused";
  return row;
}

PredictedTarget left(const Program& program, const LeftAlone& left) {
  PredictedTarget row;
  row.name = left.name;
  row.file = program.files[left.file].name;
  row.line = left.line;
  row.motion = left.motion;
  row.status = "refused";
  row.message = left.why;
  return row;
}

void take(const exchange::Prediction& predicted, const Chain& robot, const JointVector& q,
          PredictedTarget& row) {
  row.predicted = predicted;
  row.status = predicted.in_domain ? "ok" : "out_of_domain";
  if (!predicted.in_domain)
    row.message =
        fmt::format("too far from the training poses: {:.0f} % of the learned bias are taken",
                    100 * predicted.bias_share);
  if (const auto joint = robot.joint_outside_limits(q)) {
    row.status = "joint_limit";
    row.message = fmt::format("joint {} is outside its limits", *joint + 1);
  }
}

}  // namespace

Result<PredictedProgram> predict_program(const Program& program, const Chain& robot,
                                         const CellTools& cell, const AskPredictions& ask,
                                         const std::string& tool, const std::string& payload) {
  const ArmOfProgram arm(robot);
  const NominalTargets nominal =
      TRY(nominal_targets(program, arm, cell, tool, payload, BareTools::kOfTheCell));
  PredictedProgram result;
  result.notes = nominal.notes;
  result.contradictions = nominal.contradictions;
  for (const SourceFile& file : program.files) {
    if (const auto mark = find_mark(file.text))
      result.corrected.push_back(fmt::format(
          "{}: {}. The error is that of the numbers in it, which are moved on purpose: the error "
          "that is left where the tool is wanted is in the receipt of the correction",
          shown(file.name), mark_text(*mark)));
  }
  for (std::size_t t = 0; t < program.targets.size(); ++t) {
    result.targets.push_back(begun(program, t));
    result.targets[t].message = nominal.targets[t].why_not;
    if (const auto X_BT = wanted_pose(program, robot, cell, nominal, t))
      result.targets[t].p_B = X_BT->translation();
  }
  for (const TargetGroup& group : groups_of(program, nominal)) {
    std::vector<std::size_t> found;
    std::vector<exchange::AskedJoints> poses;
    for (const std::size_t t : group.targets) {
      const auto& q = nominal.targets[t].q;
      if (!q) {
        result.targets[t].status = "unreachable";
        result.targets[t].message = "no joints bring the tool there";
        continue;
      }
      found.push_back(t);
      poses.push_back({exchange::asked_from_si(*q, exchange::rails_of(robot)), {}});
    }
    if (poses.empty()) continue;
    const auto answer = TRY(ask(group.tool, group.payload, poses));
    if (!result.model_id.empty() && result.model.hash != answer.model.hash)
      return failure(ErrorCode::kBusy, "the model changed while the program was predicted")
          .next("try again");
    result.model = answer.model;
    result.model_id = answer.model.id;
    for (std::size_t k = 0; k < found.size(); ++k)
      take(answer.items[k], robot, *nominal.targets[found[k]].q, result.targets[found[k]]);
  }
  for (const LeftAlone& one : program.left) {
    if (!one.motion.empty()) result.targets.push_back(left(program, one));
  }
  std::stable_sort(result.targets.begin(), result.targets.end(),
                   [](const PredictedTarget& a, const PredictedTarget& b) {
                     return std::tie(a.file, a.line) < std::tie(b.file, b.line);
                   });
  shorten_names(result.targets);
  return result;
}

}  // namespace trammel::cam
