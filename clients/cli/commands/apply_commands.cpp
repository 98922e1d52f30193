#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "clients/cli/commands/commands.h"
#include "clients/cli/commands/correct_program.h"
#include "clients/cli/commands/predict_program.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/program_files.h"
#include "clients/cli/files/target_file.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/service/lead_in_options.h"
#include "clients/cli/service/model_answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/notes_text.h"
#include "clients/cli/text/tolerance.h"
#include "clients/cli/work/choose_approach.h"
#include "clients/cli/work/in_parallel.h"
#include "server/base/plain_text.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/pose_columns.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

constexpr std::size_t kPosesTogether =
    1000;  // poses that a model predicts between two updates of the progress

/// The arguments that predict and correct share.
struct ApplyArguments {
  std::string model, input, tool, payload, output, json;
  ServiceOptions service;
  bool covariance = false;
  bool orientation = false;
};

/// Tool and payload of each pose: the file's, else the command line's.
void fill_in(JointList& list, const ApplyArguments& arguments) {
  for (CommandedPose& pose : list.poses) {
    if (pose.context.tool.empty()) pose.context.tool = arguments.tool;
    if (pose.context.payload.empty()) pose.context.payload = arguments.payload;
  }
}

Result<client::CallContext> call_context(const ApplyArguments& arguments) {
  const ModelReference model = TRY(parse_model_reference(arguments.model));
  client::CallContext context;
  context.cell = model.cell;
  context.tool = arguments.tool;
  context.payload = arguments.payload;
  if (model.version > 0) context.model = fmt::format("@{}", model.version);
  return context;
}

/// Converts the pose as a request to a service, so that the result has the same bytes as a
/// service's answer.
exchange::AskedJoints asked_of(const PoseContext& pose, const std::vector<JointType>& types) {
  return {exchange::asked_from_si(pose.q, exchange::rails_of(types)),
          {pose.direction, pose.temperature, pose.time}};
}

Result<Predictions> predict_here(JointList& list, const ApplyArguments& arguments) {
  const CompensatedModel model = TRY(load_model(arguments.model));
  JointList checked = TRY(check_against_cell(std::move(list), model.cell()));
  list = std::move(checked);
  std::vector<PoseContext> poses;
  for (const CommandedPose& pose : list.poses) {
    if (const Status known = model.check_trained_with(pose.context.tool, pose.context.payload);
        !known) {
      return Failure(known.error()).as(ErrorCode::kRefused).in(list.where).at_row(pose.row);
    }
    poses.push_back(context_of(asked_of(pose.context, list.joint_types), model.cell().robot,
                               pose.context.tool, pose.context.payload));
  }
  Predictions predictions{model.provenance().id, {}, notes_of(model)};
  ProgressLine progress;
  for (std::size_t from = 0; from < poses.size(); from += kPosesTogether) {
    progress.show("predicting", static_cast<double>(from) / static_cast<double>(poses.size()));
    const std::size_t to = std::min(from + kPosesTogether, poses.size());
    const auto place = [&](std::size_t i) {
      return poses.begin() + static_cast<std::ptrdiff_t>(i);
    };
    for (const ErrorPrediction& prediction : model.predict_all({place(from), place(to)})) {
      predictions.items.push_back(exchanged(prediction));
    }
  }
  return predictions;
}

Result<Predictions> predict_by_service(const JointList& list, const ApplyArguments& arguments) {
  client::CallContext context = TRY(call_context(arguments));
  context.tool = list.poses.front().context.tool;
  context.payload = list.poses.front().context.payload;
  std::vector<exchange::AskedJoints> poses;
  for (const CommandedPose& pose : list.poses) {
    if (pose.context.tool != context.tool || pose.context.payload != context.payload) {
      return refused("tool '{}' and payload '{}' after '{}' and '{}'", pose.context.tool,
                     pose.context.payload, context.tool, context.payload)
          .in(list.where)
          .at_row(pose.row)
          .of("tool_id")
          .with_text(pose.context.tool)
          .next("a service is asked for one of each");
    }
    poses.push_back(asked_of(pose.context, list.joint_types));
  }
  const auto session = TRY(open_session(arguments.service));
  ProgressLine progress;
  auto answer = TRY(session->predict_error_at(
      context, poses, [&](double share) { progress.show("predicting", share); }));
  return Predictions{answer.model.id, std::move(answer.items), std::move(answer.model.notes)};
}

/// Adds the columns of --covariance and --orientation. Refuses predictions of a model that did not
/// learn orientations.
Status add_uncertainties(Predictions& predictions, const ApplyArguments& arguments) {
  predictions.covariance = arguments.covariance;
  predictions.orientation = arguments.orientation;
  const bool learned =
      std::all_of(predictions.items.begin(), predictions.items.end(),
                  [](const auto& item) { return item.rotation_stddev_deg.has_value(); });
  if (!arguments.orientation || learned) return {};
  return refused(
             "the model learned no orientations: its training poses did not all have one, or its "
             "bias is none")
      .in(arguments.model);
}

Status predict(const ApplyArguments& arguments) {
  JointList list = TRY(read_joint_file(arguments.input));
  fill_in(list, arguments);
  Predictions predictions = TRY(arguments.service.service ? predict_by_service(list, arguments)
                                                          : predict_here(list, arguments));
  warn_of_notes(predictions.notes);
  TRY(add_uncertainties(predictions, arguments));
  return write_together(
      {{"--output", arguments.output, predictions_csv(list, predictions)},
       {"--json", arguments.json, json_text(predictions_json(list, predictions))}});
}

/// The arguments of correct, for a program or a table of targets.
struct CorrectArguments : ApplyArguments {
  std::vector<std::string> inputs;
  std::string receipt, report, format, frames, task;
  std::vector<std::string> idle_axes;
  std::vector<double> pulses_per_deg;
  bool allow_failed = false, strict = false, keep_digits = false, undo = false, again = false,
       split = false, keep_joints = false, lead_in = false;
  std::string free_turn;
  double tolerance_mm = 0;

  [[nodiscard]] CorrectProgramArguments of_program() const {
    return {inputs,      model,     tool,  payload,        format,       output,
            receipt,     report,    json,  frames,         allow_failed, strict,
            keep_digits, undo,      again, split,          keep_joints,  tolerance_mm,
            service,     idle_axes, task,  pulses_per_deg, lead_in,      free_turn};
  }

  /// True if the program chooses the approach to the targets. It needs the model for that.
  [[nodiscard]] bool chooses() const { return lead_in || !free_turn.empty(); }
};

/// Corrects a table with one tool and payload. `ask` requests the answers from `model`, here or at
/// a service.
Result<Corrections> correct_with(const CompensatedModel& model, const std::string& tool,
                                 const TargetFile& file, const CorrectArguments& arguments,
                                 const cam::AskTargets& ask) {
  const Chain& robot = model.cell().robot;
  Corrections corrections{model.provenance().id, joint_types(robot), {}, notes_of(model)};
  std::vector<exchange::AskedTarget> targets;
  for (const TargetRow& row : file.rows) targets.push_back(row.target);
  corrections.items = TRY(ask(targets));
  if (!arguments.free_turn.empty()) {
    TRY(turn_freely(ask, robot, targets, corrections));
  }
  if (arguments.lead_in) {
    const cam::LeadInOptions options = TRY(lead_in_options(model, arguments.tolerance_mm));
    TRY(lead_in_where_needed(ask, robot, model.parts().physics.tools.at(tool), options,
                             std::move(targets), corrections));
  }
  return corrections;
}

Result<Corrections> correct_here(const TargetFile& file, const CorrectArguments& arguments) {
  const CompensatedModel model = TRY(load_model(arguments.model));
  TRY(check_targets(file, model.cell().robot));
  const std::string tool = TRY(resolve_tool(model.cell(), arguments.tool));
  const std::string payload = TRY(resolve_payload(model.cell(), arguments.payload));
  TRY(model.check_trained_with(tool, payload));
  const exchange::Rails rails = exchange::rails_of(model.cell().robot);
  ProgressLine progress;
  const cam::AskTargets ask = [&](const std::vector<exchange::AskedTarget>& targets)
      -> Result<std::vector<exchange::CorrectedTarget>> {
    std::vector<exchange::CorrectedTarget> items(targets.size());
    in_parallel(
        targets.size(),
        [&](std::size_t i) {
          const Target target = target_of(targets[i], model.cell().robot);
          items[i] = exchanged(model.correct(target, tool, payload), rails);
        },
        [&](double share) { progress.show("correcting", share); });
    return items;
  };
  return correct_with(model, tool, file, arguments, ask);
}

/// The service answers. Its model states where gears have play, and the robot.
Result<Corrections> choose_by_service(const TargetFile& file, const CorrectArguments& arguments) {
  return with_served_model<Corrections>(
      arguments.model, arguments.service,
      [&](client::Session& session, const client::CallContext& of, const CompensatedModel& model,
          const SawModel& saw) -> Result<Corrections> {
        TRY(check_targets(file, model.cell().robot));
        const std::string tool = TRY(resolve_tool(model.cell(), arguments.tool));
        client::CallContext context = of;
        context.tool = arguments.tool;
        context.payload = arguments.payload;
        context.rails = exchange::rails_of(model.cell().robot);
        ProgressLine progress;
        const cam::AskTargets ask = [&](const std::vector<exchange::AskedTarget>& targets)
            -> Result<std::vector<exchange::CorrectedTarget>> {
          auto answer = TRY(session.correct_targets(
              context, targets, [&](double share) { progress.show("correcting", share); }));
          saw(answer.model);
          return std::move(answer.items);
        };
        return correct_with(model, tool, file, arguments, ask);
      });
}

Result<Corrections> correct_by_service(const TargetFile& file, const CorrectArguments& arguments) {
  if (arguments.chooses()) return choose_by_service(file, arguments);
  client::CallContext context = TRY(call_context(arguments));
  context.rails = exchange::rails_of(file.joint_types);
  std::vector<exchange::AskedTarget> targets;
  for (const TargetRow& row : file.rows) targets.push_back(row.target);
  const auto session = TRY(open_session(arguments.service));
  ProgressLine progress;
  auto answer = TRY(session->correct_targets(
      context, targets, [&](double share) { progress.show("correcting", share); }));
  const bool all_unreachable =
      std::all_of(answer.items.begin(), answer.items.end(),
                  [](const auto& item) { return item.status == "unreachable"; });
  if (all_unreachable && may_be_metres(file)) return tl::make_unexpected(looks_like_metres(file));
  return Corrections{answer.model.id, file.joint_types, std::move(answer.items),
                     std::move(answer.model.notes)};
}

/// Refuses options that are of programs alone.
Status check_table_usage(const CorrectArguments& arguments) {
  const std::pair<bool, const char*> of_programs[] = {
      {!arguments.report.empty(), "--report"},
      {!arguments.frames.empty(), "--frames"},
      {!arguments.idle_axes.empty(), "--idle-axis"},
      {!arguments.task.empty(), "--task"},
      {!arguments.pulses_per_deg.empty(), "--pulses-per-deg"},
      {arguments.split, "--split"},
      {arguments.keep_digits, "--keep-digits"},
      {arguments.keep_joints, "--keep-joints"},
      {arguments.undo, "--undo"},
      {arguments.again, "--again"}};
  for (const auto& [said, option] : of_programs) {
    if (said)
      return failure(ErrorCode::kUsage, "a table of targets, and {} is of programs", option)
          .in(arguments.inputs[0])
          .of(option);
  }
  return {};
}

Status check_usage(const CorrectArguments& arguments) {
  if (!arguments.undo && arguments.model.empty())
    return failure(ErrorCode::kUsage, "--model is required")
        .of("--model")
        .next(
            "name it first: trammel correct MODEL PROGRAM -o OUTPUT; it may be left out with "
            "--undo only");
  if (is_program(arguments.inputs, arguments.format)) return {};
  const std::string ending = std::filesystem::path(arguments.inputs[0]).extension().string();
  if (arguments.format.empty() && (ending == ".xlsx" || ending == ".xls" || ending == ".ods")) {
    return refused("not text but a spreadsheet ({})", ending)
        .in(arguments.inputs[0])
        .with_text(ending)
        .next("export it as text: Save As, \"CSV UTF-8\", in Excel; \"Text CSV\" in LibreOffice");
  }
  if (arguments.format.empty() && ending != ".csv") {
    return failure(ErrorCode::kUsage, "unknown kind of targets '{}'", ending)
        .in(arguments.inputs[0])
        .with_text(ending)
        .next("known: .csv and the endings of programs; --format says what it is");
  }
  return check_table_usage(arguments);
}

std::optional<ToleranceVerdict> verdict_of(const Corrections& corrections, double tolerance_mm) {
  if (tolerance_mm <= 0) return std::nullopt;
  std::vector<ExpectedError> errors;
  for (const exchange::CorrectedTarget& item : corrections.items)
    errors.push_back(
        {item.error_before_mm, item.error_after_mm, item.sigma_mm, item.status != "out_of_domain"});
  return tolerance_verdict(errors, tolerance_mm);
}

Result<Extent> correct(CorrectArguments arguments) {
  TRY(check_usage(arguments));
  if (is_program(arguments.inputs, arguments.format))
    return correct_program(arguments.of_program());
  arguments.input = arguments.inputs[0];
  const TargetFile file = TRY(read_targets_csv(arguments.input));
  const Corrections corrections =
      TRY(arguments.service.service ? correct_by_service(file, arguments)
                                    : correct_here(file, arguments));
  warn_of_notes(corrections.notes);
  const std::string left_alone = left_alone_text(file, corrections);
  const auto verdict = verdict_of(corrections, arguments.tolerance_mm);
  if (arguments.strict) {
    TRY(check_strictly(left_alone, verdict));
  }
  auto json = corrections_json(file, corrections);
  json["notes"] = notes_json(corrections.notes);
  if (verdict) json["tolerance"] = tolerance_json(*verdict);
  const std::string table = corrections_csv(file, corrections);
  if (const Status written = write_together({{"--output", arguments.output, table},
                                             {"--receipt", arguments.receipt, table},
                                             {"--json", arguments.json, json_text(json)}});
      !written)
    return tl::make_unexpected(written.error());
  fmt::print(stderr, "{}",
             shown_lines(corrections_summary(corrections) + left_alone +
                         (verdict ? verdict_text(*verdict) + "\n" : "")));
  return left_alone.empty() || arguments.allow_failed ? Extent::kAll : Extent::kPart;
}

CLI::Option* add_apply_options(CLI::App& command, ApplyArguments& arguments) {
  CLI::Option* model = command.add_option(
      "--model", arguments.model,
      "Model file; with --service a cell id (its model in force) or CELL@VERSION");
  add_tool_options(command, arguments.tool, arguments.payload);
  add_json_option(command, arguments.json);
  add_service_options(command, arguments.service);
  return model;
}

/// Adds the options for reading a program.
void add_reading_options(CLI::App& command, std::string& format, std::string& frames,
                         std::vector<std::string>& idle_axes, std::string& task,
                         std::vector<double>& pulses_per_deg) {
  const std::string group = "Programs";
  command
      .add_option("--format", format,
                  fmt::format("What the input is, where its ending does not say so: csv, {}",
                              cam::dialect_names()))
      ->group(group);
  command
      .add_option("--frames", frames,
                  "Values of tools and frames that the program leaves to the controller (CSV: "
                  "name,x_mm,y_mm,z_mm,qw,qx,qy,qz; UFRAME[1], BASE_DATA[2], ...; robot_base: "
                  "where the robot stands in the controller's world), or a controller's own list: "
                  "SYSFRAME.VA (FANUC), TOOL.CND, UFRAME.CND (Yaskawa)")
      ->group(group);
  command
      .add_option("--idle-axis", idle_axes,
                  "External axis that carries neither robot nor part, such as a servo gun, by the "
                  "name that messages give it: 'group 2, axis 1'; may be given several times")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--task", task,
                  "Of the backup of an ABB controller that moves several robots: the task whose "
                  "modules are taken, and whose robot (TASK2)")
      ->group(group);
  command
      .add_option("--pulses-per-deg", pulses_per_deg,
                  "Of a Yaskawa job whose positions are in pulses: how many make a degree of each "
                  "axis, six numbers with commas between; negative where the axis counts against "
                  "the robot file's sense")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->group(group);
}

/// The arguments of predict, for joints or a program.
struct PredictArguments : ApplyArguments {
  std::vector<std::string> inputs;
  std::string format, frames, task;
  std::vector<std::string> idle_axes;
  std::vector<double> pulses_per_deg;

  [[nodiscard]] PredictProgramArguments of_program() const {
    return {inputs, model,  tool,    payload,   format, output,
            json,   frames, service, idle_axes, task,   pulses_per_deg};
  }
};

Status check_usage(const PredictArguments& arguments) {
  const bool program = !arguments.inputs.empty();
  if (program == !arguments.input.empty()) {
    return failure(ErrorCode::kUsage, "{}",
                   program ? "a program and --joints at once" : "nothing to predict")
        .of("--joints")
        .next("name a program, or joints by --joints");
  }
  const std::pair<bool, const char*> of_programs[] = {
      {!arguments.format.empty(), "--format"},
      {!arguments.frames.empty(), "--frames"},
      {!arguments.idle_axes.empty(), "--idle-axis"},
      {!arguments.task.empty(), "--task"},
      {!arguments.pulses_per_deg.empty(), "--pulses-per-deg"}};
  for (const auto& [said, option] : of_programs) {
    if (said && !program)
      return failure(ErrorCode::kUsage, "{} is of programs, not of joints", option).of(option);
  }
  if (program && (arguments.covariance || arguments.orientation)) {
    return failure(ErrorCode::kUsage,
                   "--covariance and --orientation are of joints, not of programs")
        .of(arguments.covariance ? "--covariance" : "--orientation");
  }
  return {};
}

void add_predict(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<PredictArguments>();
  CLI::App* command =
      app.add_subcommand("predict", "Predict where the tool will be, and how sure that is");
  command->add_option("program", arguments->inputs,
                      "A robot program as it is, corrected or not: its files, its folder, or '-' "
                      "for standard input");
  command->add_option("--joints", arguments->input,
                      "Or commanded joints (CSV: joints in deg, rails in mm)");
  command
      ->add_option("-o,--output", arguments->output,
                   "Predicted errors, standard deviations and poses to write, in the robot's base "
                   "(CSV: mm); of a program a line for each of its targets")
      ->required();
  command->add_flag("--covariance", arguments->covariance,
                    "Append the covariances of the coordinates of one measurement (cxy_mm2 ...)");
  command->add_flag("--orientation", arguments->orientation,
                    "Append the standard deviations of one measured orientation about the base's "
                    "axes (srx_deg ...)");
  add_reading_options(*command, arguments->format, arguments->frames, arguments->idle_axes,
                      arguments->task, arguments->pulses_per_deg);
  add_apply_options(*command, *arguments)->required();
  command->callback([arguments, &chosen] {
    chosen = [arguments]() -> Result<Extent> {
      TRY(check_usage(*arguments));
      if (!arguments->inputs.empty()) return predict_program(arguments->of_program());
      TRY(predict(*arguments));
      return Extent::kAll;
    };
  });
}

void add_program_options(CLI::App& command, CorrectArguments& arguments) {
  const std::string group = "Programs";
  add_reading_options(command, arguments.format, arguments.frames, arguments.idle_axes,
                      arguments.task, arguments.pulses_per_deg);
  command
      .add_option("--report", arguments.report, "The receipt as a page, with the path in 3D (HTML)")
      ->group(group);
  command
      .add_flag("--keep-digits", arguments.keep_digits,
                "Write numbers with the decimals that they have, even where rounding takes more "
                "than a tenth of what is known")
      ->group(group);
  command
      .add_flag("--split", arguments.split,
                "Make a target of each use where one is used with several tools or frames")
      ->group(group);
  command
      .add_flag("--keep-joints", arguments.keep_joints, "Leave targets that are given as joints")
      ->group(group);
  CLI::Option* undo =
      command
          .add_flag(
              "--undo", arguments.undo,
              "Write the program as it was before, from what is kept beside the corrected one")
          ->group(group);
  command
      .add_flag("--again", arguments.again,
                "Correct a corrected program anew, from what is kept beside it of the time before")
      ->excludes(undo)
      ->group(group);
}

void add_correct(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<CorrectArguments>();
  CLI::App* command = app.add_subcommand(
      "correct", "Find what to command so that the tool lands where it is wanted");
  command
      ->add_option(
          "input", arguments->inputs,
          "A robot program: its files, its folder, or '-' for standard input; or targets in the "
          "robot's base (.csv: positions in mm, joints in deg, rails in mm). Programmed off line: "
          "a position that was taught by jogging the robot to it holds the robot's error already, "
          "and gets worse by all of it; so does one in a frame that was touched with the robot")
      ->required();
  command
      ->add_option("-o,--output", arguments->output,
                   "The corrected program: a file, or a folder for several; what each file was "
                   "before is kept beside it as FILE.original. Of a table the corrected targets "
                   "(CSV: mm, deg), behind the columns of the input; an input column that is named "
                   "as an output column comes as input_NAME")
      ->required();
  CLI::Option* allow_failed =
      command->add_flag("--allow-failed", arguments->allow_failed,
                        "Exit with 0, not 1, where targets are left as they were");
  command
      ->add_flag("--strict", arguments->strict,
                 "Write nothing and exit with 3 where any target would be left as it was or, with "
                 "--tolerance, is not inside it with 95 % or is out of domain")
      ->excludes(allow_failed);
  command->add_flag(
      "--lead-in", arguments->lead_in,
      "Where play or hysteresis would take a target out of the tolerance (--tolerance, or the "
      "cell's), insert points before it, so that each such joint arrives from one side: back along "
      "the tool's axis by 20 mm, and before that, where a joint hardly turns on this line, a turn "
      "of it there. See that nothing stands in the way");
  command
      ->add_option("--free", arguments->free_turn,
                   "rz: the tool may stand at any angle about its axis (a drill, a mill, a dot). "
                   "Each target is turned to where least is unknown, clear of limits and of a "
                   "singular wrist; targets of one path turn together")
      ->check(CLI::IsMember({"rz"}));
  command->add_option("--receipt", arguments->receipt, "What became of each target, as CSV");
  command
      ->add_option(
          "--tolerance", arguments->tolerance_mm,
          "Tell how many targets are expected this near to where they are wanted, mm, with 95 %")
      ->check(above_zero());
  add_apply_options(*command, *arguments);
  add_program_options(*command, *arguments);
  command->callback([arguments, &chosen] { chosen = [arguments] { return correct(*arguments); }; });
}

}  // namespace

void add_apply_commands(CLI::App& app, Action& chosen) {
  add_predict(app, chosen);
  add_correct(app, chosen);
}

}  // namespace trammel::cli
