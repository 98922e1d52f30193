#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/budget/remedies.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/joint_list.h"
#include "server/measurement/pose_columns.h"
#include "server/plan/plan.h"
#include "server/report/budget_json.h"
#include "server/report/note_json.h"
#include "server/report/pages_beside.h"
#include "server/report/remedies_page.h"

namespace trammel::cli {

namespace {

constexpr int kCheckPoses = 30;  // enough to identify the arm's lines anew

struct RemediesArguments {
  std::string model, targets, output, json, check_poses;
  ServiceOptions service;
};

/// The poses that prove afterwards whether a remedy helped; empty where the cell cannot be planned.
Result<JointList> poses_to_prove(const CompensatedModel& model) {
  PlanOptions options;
  options.count = kCheckPoses;
  options.criterion = PlanCriterion::kObservability;
  if (!model.parts().trained_with.empty()) {
    options.tools = {model.parts().trained_with.begin()->first};
    options.payloads = {model.parts().trained_with.begin()->second};
  }
  const Plan plan = TRY(make_plan(model.parts().physics.cell, options));
  JointList list{"", joint_types(model.cell().robot), {}};
  for (const PlannedPose& planned : plan.poses) {
    CommandedPose pose;
    pose.pose_id = planned.id;
    pose.context = planned.context;
    if (model.cell().tools.size() == 1) pose.context.tool.clear();
    if (model.cell().payloads.size() == 1) pose.context.payload.clear();
    list.poses.push_back(std::move(pose));
  }
  return list;
}

nlohmann::ordered_json poses_json(const JointList& list) {
  nlohmann::ordered_json columns = nlohmann::ordered_json::array(), poses = columns;
  for (std::size_t j = 0; j < list.joint_types.size(); ++j)
    columns.push_back(joint_column(static_cast<int>(j), list.joint_types[j]));
  for (const CommandedPose& pose : list.poses) {
    nlohmann::ordered_json row = nlohmann::ordered_json::array();
    for (std::size_t j = 0; j < list.joint_types.size(); ++j)
      row.push_back(
          joint_to_column(pose.context.q(static_cast<Eigen::Index>(j)), list.joint_types[j]));
    poses.push_back(std::move(row));
  }
  return {{"columns", std::move(columns)}, {"poses", std::move(poses)}};
}

/// Explains how to verify the repair afterwards.
std::string proof_text(const RemediesArguments& arguments) {
  return fmt::format(
      "afterwards: measure the poses of {}, then trammel diagnose --cell CELL --batch AFTER "
      "--since "
      "{}\n",
      arguments.check_poses.empty() ? "--check-poses FILE" : arguments.check_poses,
      arguments.model);
}

/// The budget that the model has of its training poses, or one at the targets of a file.
Result<ErrorBudget> budget_asked(const CompensatedModel& model, const std::string& targets) {
  if (targets.empty()) {
    if (model.parts().budget) return *model.parts().budget;
    return refused(
               "the model has no error budget: no training pose has a position, or it is older "
               "than budgets")
        .in("model " + model.provenance().id)
        .of("--model")
        .next("train it again, or give --targets");
  }
  Result<JointList> list = read_joint_csv(targets);
  if (list) list = check_against_cell(std::move(*list), model.cell());
  if (!list) return tl::make_unexpected(list.error());
  std::vector<PoseContext> poses;
  for (const CommandedPose& pose : list->poses) {
    TRY(model.check_trained_with(pose.context.tool, pose.context.payload));
    poses.push_back(pose.context);
  }
  return error_budget(model, poses);
}

nlohmann::ordered_json remedies_json(const CompensatedModel& model, const ErrorBudget& budget,
                                     const Result<JointList>& prove) {
  const MakersWords words = makers_words(model.cell().robot);
  nlohmann::ordered_json zeros = nlohmann::ordered_json::array();
  for (const ZeroRemedy& zero : zero_remedies(budget))
    zeros.push_back({{"joint", zero.joint + 1},
                     {"axis", words.axis(zero.joint)},
                     {"add", zero.add},
                     {"u95", zero.u95},
                     {"unit", zero.unit}});
  return {{"model", model.provenance().id},
          {"cell", model.cell().name},
          {"zeros", std::move(zeros)},
          {"controller",
           {{"maker", words.maker},
            {"zeros", words.zeros},
            {"lengths", words.lengths},
            {"load", words.load}}},
          {"steps", remedy_steps_json(budget)},
          {"check_poses", prove ? poses_json(*prove) : nlohmann::ordered_json(nullptr)},
          {"budget", budget_json(budget)},
          {"notes", notes_json(notes_of(model))}};
}

Status remedies(const RemediesArguments& arguments) {
  Outputs outputs;
  outputs.add("--output", arguments.output);
  outputs.add("--json", arguments.json);
  outputs.add("--check-poses", arguments.check_poses);
  std::vector<NamedFile> inputs = {{"--model", arguments.model}};
  if (!arguments.targets.empty()) inputs.push_back({"--targets", arguments.targets});
  TRY(outputs.check(inputs));
  const CompensatedModel model = TRY(model_named(arguments.model, arguments.service));
  const ErrorBudget budget = TRY(budget_asked(model, arguments.targets));
  const std::string where = arguments.targets.empty()
                                ? fmt::format("{} training poses", budget.poses)
                                : fmt::format("{} targets of {}", budget.poses, arguments.targets);
  std::string text =
      fmt::format("{}, model {}, {}:\n", model.cell().robot.name(), model.provenance().id, where);
  for (const std::string& line : remedies_in_words(budget, model.cell().robot)) text += line + "\n";
  warn_of_notes(notes_of(model));
  tell(text + proof_text(arguments), {arguments.output, arguments.json, arguments.check_poses});
  if (!arguments.output.empty())
    outputs.put("--output",
                with_pages_beside(remedies_page(model, budget, where), arguments.output));
  if (!arguments.json.empty() || !arguments.check_poses.empty()) {
    const Result<JointList> prove = poses_to_prove(model);
    if (!prove && !arguments.check_poses.empty()) return tl::make_unexpected(prove.error());
    if (!arguments.check_poses.empty()) outputs.put("--check-poses", to_csv(*prove));
    if (!arguments.json.empty())
      outputs.put("--json", json_text(remedies_json(model, budget, prove)));
  }
  return outputs.write();
}

}  // namespace

void add_remedies_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<RemediesArguments>();
  CLI::App* command = app.add_subcommand(
      "remedies",
      "Tell what could be put right in the controller, step by step, and what each step leaves");
  add_model_option(*command, arguments->model);
  command->add_option(
      "--targets", arguments->targets,
      "Targets to say it of instead of the training poses (CSV: joints in deg, rails in mm)");
  command->add_option("-o,--output", arguments->output,
                      "Page to write (HTML); opens without a network");
  command
      ->add_option("--check-poses", arguments->check_poses,
                   "Plan to write (CSV: joints in deg, rails in mm) of the poses that prove "
                   "afterwards whether it helped: measure them, then diagnose --since")
      ->type_name("FILE");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return remedies(*arguments); }; });
}

}  // namespace trammel::cli
