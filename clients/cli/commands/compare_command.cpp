#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/evaluation_text.h"
#include "clients/cli/text/notes_text.h"
#include "server/base/units.h"
#include "server/compensate/budget/between.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/known_rows.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/paired_gain.h"
#include "server/compensate/world.h"
#include "server/measurement/gauges.h"
#include "server/measurement/pose_columns.h"
#include "server/plan/plan.h"
#include "server/report/budget_json.h"
#include "server/report/comparison_page.h"
#include "server/report/note_json.h"
#include "server/report/pages_beside.h"
#include "server/tasks/accept/fits_cell.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr int kDrawnPoses = 200;
constexpr std::size_t kShownPoses = 5;

struct CompareArguments {
  std::string before, now, batch, json, report;
  ServiceOptions service;
};

/// Both models on the same measurements.
struct Judged {
  Evaluation before, now;
  PairedGain gain;
};

struct Compared {
  std::vector<PoseContext> poses;
  std::string where;  ///< which poses, for people
  ModelDifference difference;
  std::optional<Judged> judged;
  std::size_t learned =
      0;  ///< poses of the batch that one of the models was trained on: they do not judge
};

/// Poses of the cell that both models know: a Latin hypercube, with a tool and a payload of the
/// newer model.
Result<std::vector<PoseContext>> drawn_poses(const CompensatedModel& model) {
  PlanOptions options;
  options.count = kDrawnPoses;
  const Eigen::MatrixXd q = TRY(plan_poses(model.cell(), options));
  std::vector<PoseContext> poses(static_cast<std::size_t>(q.rows()));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].q = q.row(static_cast<Eigen::Index>(i)).transpose();
    if (!model.parts().trained_with.empty())
      std::tie(poses[i].tool, poses[i].payload) = *model.parts().trained_with.begin();
  }
  return poses;
}

Status judge(const CompensatedModel& before, const CompensatedModel& now, const CheckedBatch& batch,
             Compared& all) {
  const LearnedFrom by_before(before, batch.hash()), by_now(now, batch.hash());
  const auto is_learned = [&](const Measurement& m) { return by_before(m) || by_now(m); };
  MeasurementBatch in_old = TRY(in_world_of(before, positions_of(batch.rows()))).batch;
  MeasurementBatch in_new = TRY(in_world_of(now, positions_of(batch.rows()))).batch;
  all.learned = std::erase_if(in_old.measurements, is_learned);
  std::erase_if(in_new.measurements, is_learned);
  if (in_old.measurements.empty()) return {};
  all.judged =
      Judged{before.evaluate(in_old), now.evaluate(in_new),
             paired_gain(before.errors_B(in_old).compensated, now.errors_B(in_new).compensated)};
  return {};
}

Result<Compared> compared(const CompensatedModel& before, const CompensatedModel& now,
                          const CompareArguments& asked) {
  TRY(asked.batch.empty() ? check_comparable(before, now)
                          : check_fits_cell(before, now.cell(), "model " + before.provenance().id));
  Compared all;
  std::optional<CheckedBatch> batch;
  if (asked.batch.empty()) {
    all.poses = TRY(drawn_poses(now));
    all.where = fmt::format("{} poses drawn over the cell", all.poses.size());
  } else {
    batch.emplace(TRY(read_checked_batches({asked.batch}, now.cell())));
    TRY(require_positions(batch->rows(), "compare --batch"));
    for (const Measurement& m : positions_of(batch->rows()).measurements)
      all.poses.push_back(m.context);
    all.where = fmt::format("{} poses of {}", all.poses.size(), batch->id());
  }
  for (const PoseContext& pose : all.poses) {
    TRY(before.check_trained_with(pose.tool, pose.payload));
    TRY(now.check_trained_with(pose.tool, pose.payload));
  }
  if (batch) {
    TRY(judge(before, now, *batch, all));
  }
  all.difference = difference_between(before, now, all.poses);
  return all;
}

double rms_of(const ModelDifference& difference) {
  double sum = 0;
  for (const Vector3& moved : difference.moved_B) sum += moved.squaredNorm();
  return std::sqrt(sum / static_cast<double>(difference.moved_B.size()));
}

/// Indices of the poses by falling motion.
std::vector<std::size_t> most_moved(const ModelDifference& difference) {
  std::vector<std::size_t> order(difference.moved_B.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return difference.moved_B[a].squaredNorm() > difference.moved_B[b].squaredNorm();
  });
  order.resize(std::min(order.size(), kShownPoses));
  return order;
}

std::string text_of(const Compared& all, const CompensatedModel& before,
                    const CompensatedModel& now) {
  const ModelDifference& found = all.difference;
  std::string text = fmt::format(
      "model {} predicts otherwise than model {} by {:.4f} mm rms, {:.4f} mm at most, at {};\n"
      "touching base and tool frames would leave {:.4f} mm of it\n",
      now.provenance().id, before.provenance().id, to_mm(rms_of(found)),
      to_mm(found.moved_B[most_moved(found).front()].norm()), all.where,
      to_mm(found.budget.beyond_frames.error_rms));
  for (const std::string& line : difference_in_words(found)) text += line + "\n";
  if (all.learned > 0)
    text += fmt::format(
        "note: {} of the {} poses do not judge the models, because one was trained on them\n",
        all.learned, all.poses.size());
  if (all.judged) text += fmt::format("on these poses: {}\n", to_string(all.judged->gain));
  return text;
}

std::string tables_of(const Compared& all, const CompensatedModel& before,
                      const CompensatedModel& now) {
  if (!all.judged) return "";
  return fmt::format("model {}:\n{}model {}:\n{}", before.provenance().id,
                     evaluation_table(all.judged->before), now.provenance().id,
                     evaluation_table(all.judged->now));
}

ordered_json model_of(const CompensatedModel& model) {
  const ModelProvenance& from = model.provenance();
  return {{"id", from.id},
          {"cell", model.cell().name},
          {"level", from.level},
          {"batch", from.batch_id},
          {"trained_at_unix_s", from.trained_at},
          {"notes", notes_json(notes_of(model))}};
}

ordered_json poses_json(const Compared& all, const std::vector<JointType>& types) {
  ordered_json poses = ordered_json::array();
  for (const std::size_t i : most_moved(all.difference)) {
    ordered_json joints = ordered_json::object();
    for (std::size_t j = 0; j < types.size(); ++j)
      joints[joint_column(static_cast<int>(j), types[j])] =
          joint_to_column(all.poses[i].q(static_cast<Eigen::Index>(j)), types[j]);
    const Vector3 moved = to_mm(1) * all.difference.moved_B[i];
    poses.push_back({{"pose", i + 1},
                     {"joints", std::move(joints)},
                     {"moved_mm", {moved.x(), moved.y(), moved.z()}}});
  }
  return poses;
}

ordered_json comparison_json(const Compared& all, const CompensatedModel& before,
                             const CompensatedModel& now) {
  const ModelDifference& found = all.difference;
  ordered_json parameters = ordered_json::array();
  for (const ParameterDifference& one : found.parameters)
    parameters.push_back({{"name", one.name},
                          {"unit", one.unit},
                          {"a", one.before},
                          {"b", one.now},
                          {"difference", one.difference()},
                          {"u95", one.u95},
                          {"beyond_u95", std::abs(one.difference()) > one.u95}});
  ordered_json budget = budget_json(found.budget);
  budget["sentences"] = difference_in_words(found);
  ordered_json json = {{"a", model_of(before)},
                       {"b", model_of(now)},
                       {"poses", all.poses.size()},
                       {"rms_mm", to_mm(rms_of(found))},
                       {"max_mm", to_mm(found.moved_B[most_moved(found).front()].norm())},
                       {"parameters", std::move(parameters)},
                       {"budget", std::move(budget)},
                       {"most_moved", poses_json(all, joint_types(now.cell().robot))},
                       {"notes", notes_json(notes_of(now))}};
  if (all.judged)
    json["batch"] = {{"a", evaluation_json(all.judged->before)},
                     {"b", evaluation_json(all.judged->now)},
                     {"gain_z", all.judged->gain.z()},
                     {"b_is_better", all.judged->gain.beyond_chance()}};
  if (all.learned > 0) json["trained_on"] = all.learned;
  return json;
}

Status compare(const CompareArguments& arguments) {
  Outputs outputs;
  outputs.add("--report", arguments.report);
  outputs.add("--json", arguments.json);
  std::vector<NamedFile> inputs = {{"A", arguments.before}, {"B", arguments.now}};
  if (!arguments.batch.empty()) inputs.push_back({"--batch", arguments.batch});
  TRY(outputs.check(inputs));
  const CompensatedModel before = TRY(model_named(arguments.before, arguments.service));
  const CompensatedModel now = TRY(model_named(arguments.now, arguments.service));
  const Compared all = TRY(compared(before, now, arguments));
  warn_of_notes(notes_of(now));
  const std::string text = text_of(all, before, now);
  tell(text + tables_of(all, before, now), {arguments.report, arguments.json});
  if (!arguments.report.empty())
    outputs.put("--report",
                with_pages_beside(comparison_page({before, now, all.difference, all.where, text}),
                                  arguments.report));
  if (!arguments.json.empty()) outputs.put("--json", json_text(comparison_json(all, before, now)));
  return outputs.write();
}

}  // namespace

void add_compare_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<CompareArguments>();
  CLI::App* command = app.add_subcommand("compare",
                                         "Compare two models of one robot: what changed in which "
                                         "parameter, and by how much at which poses");
  command->add_option("A", arguments->before, "Model file, or CELL@VERSION of a service")
      ->required();
  command->add_option("B", arguments->now, "Model to hold against it, named likewise")->required();
  command->add_option(
      "--batch", arguments->batch,
      "Measurements to judge both by (CSV: joints in deg, rails in mm; positions in mm)");
  command->add_option("--report", arguments->report,
                      "Page to write (HTML); opens without a network");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return compare(*arguments); }; });
}

}  // namespace trammel::cli
