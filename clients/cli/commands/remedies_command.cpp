#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "server/compensate/budget/error_budget.h"
#include "server/compensate/budget/remedies.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/joint_list.h"
#include "server/report/budget_json.h"
#include "server/report/note_json.h"
#include "server/report/pages_beside.h"
#include "server/report/remedies_page.h"

namespace trammel::cli {

namespace {

struct RemediesArguments {
  std::string model, targets, output, json;
};

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

nlohmann::ordered_json remedies_json(const CompensatedModel& model, const ErrorBudget& budget) {
  const MakersWords words = makers_words(model.cell().robot);
  nlohmann::ordered_json zeros = nlohmann::ordered_json::array();
  for (const ZeroRemedy& zero : zero_remedies(budget))
    zeros.push_back(
        {{"joint", zero.joint + 1}, {"add", zero.add}, {"u95", zero.u95}, {"unit", zero.unit}});
  return {{"model", model.provenance().id},
          {"cell", model.cell().name},
          {"zeros", std::move(zeros)},
          {"controller",
           {{"maker", words.maker},
            {"zeros", words.zeros},
            {"lengths", words.lengths},
            {"load", words.load}}},
          {"steps", remedy_steps_json(budget)},
          {"budget", budget_json(budget)},
          {"notes", notes_json(notes_of(model))}};
}

Status remedies(const RemediesArguments& arguments) {
  const CompensatedModel model = TRY(load_model(arguments.model));
  const ErrorBudget budget = TRY(budget_asked(model, arguments.targets));
  const std::string where = arguments.targets.empty()
                                ? fmt::format("{} training poses", budget.poses)
                                : fmt::format("{} targets of {}", budget.poses, arguments.targets);
  std::string text =
      fmt::format("{}, model {}, {}:\n", model.cell().robot.name(), model.provenance().id, where);
  for (const std::string& line : remedies_in_words(budget, model.cell().robot)) text += line + "\n";
  warn_of_notes(notes_of(model));
  tell(text, {arguments.output, arguments.json});
  if (!arguments.output.empty()) {
    const std::string page =
        with_pages_beside(remedies_page(model, budget, where), arguments.output);
    TRY(write_output(arguments.output, page));
  }
  return write_json(arguments.json, remedies_json(model, budget));
}

}  // namespace

void add_remedies_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<RemediesArguments>();
  CLI::App* command = app.add_subcommand(
      "remedies",
      "Tell what could be put right in the controller, step by step, and what each step leaves");
  command->add_option("--model", arguments->model, "Model file")->required();
  command->add_option(
      "--targets", arguments->targets,
      "Targets to say it of instead of the training poses (CSV: joints in deg, rails in mm)");
  command->add_option("-o,--output", arguments->output,
                      "Page to write (HTML); opens without a network");
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, &chosen] { chosen = [arguments] { return remedies(*arguments); }; });
}

}  // namespace trammel::cli
