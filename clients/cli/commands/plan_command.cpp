#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <limits>

#include "clients/cli/commands/commands.h"
#include "clients/cli/files/batch_files.h"
#include "clients/cli/files/cell_to_train.h"
#include "clients/cli/files/plan_csv.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/near_miss.h"
#include "server/base/units.h"
#include "server/measurement/files/joint_list.h"
#include "server/plan/measuring_program.h"
#include "server/plan/plan.h"
#include "server/plan/travel.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

struct PlanArguments {
  std::string cell, from, criterion = "lhs", output, rapid, krl, fanuc, urscript, json;
  PlanOptions options;
  ProgramOptions program;
  bool positions_only = false, keep_order = false;
  int check = 0;                   // poses of a check; 0: no check is planned
  std::vector<double> contact_mm;  // in B; empty: none

  [[nodiscard]] bool writes_program() const {
    return !(rapid.empty() && krl.empty() && fanuc.empty() && urscript.empty());
  }
};

const std::vector<std::string> kCriteria = {"lhs", "observability", "separate"};

/// `lhs`, `observability`, or `separate:CAUSE,CAUSE`; a cause may hold a colon of its own.
Status read_criterion(const std::string& text, PlanOptions& options) {
  const std::string separate = "separate:";
  if (text == "lhs") return {};
  if (text == "observability") {
    options.criterion = PlanCriterion::kObservability;
    return {};
  }
  const std::size_t comma = text.find(',');
  if (!text.starts_with(separate) || comma == std::string::npos) {
    return failure(ErrorCode::kUsage,
                   "--criterion '{}': expected lhs, observability or separate:CAUSE,CAUSE{}", text,
                   did_you_mean(text.substr(0, text.find(':')), kCriteria))
        .of("--criterion")
        .with_text(text);
  }
  options.criterion = PlanCriterion::kSeparation;
  options.cause = text.substr(separate.size(), comma - separate.size());
  options.other = text.substr(comma + 1);
  return {};
}

ProgramOptions program_called_after(const std::string& path, ProgramOptions options) {
  if (path != "-") options.name = std::filesystem::path(path).stem().string();
  return options;
}

/// The plan and its programs as text, by the options that name their files. All are written
/// together, or none is.
Result<Outputs> outputs_of(const Cell& cell, const PlanArguments& arguments, const Plan& plan) {
  Outputs outputs;
  outputs.add("--output", arguments.output);
  outputs.put("--output", plan_csv(cell, arguments.output, plan));
  const auto add = [&](const char* option, const std::string& path, const auto& writer) -> Status {
    if (path.empty()) return {};
    Result<std::string> text =
        writer(cell.robot, plan, program_called_after(path, arguments.program));
    if (!text) return Failure(text.error()).as(ErrorCode::kRefused).in(path);
    outputs.add(option, path);
    outputs.put(option, std::move(*text));
    return {};
  };
  for (const Status& added :
       {add("--rapid", arguments.rapid, to_rapid), add("--krl", arguments.krl, to_krl),
        add("--fanuc", arguments.fanuc, to_fanuc),
        add("--urscript", arguments.urscript, to_urscript)}) {
    if (!added) return tl::make_unexpected(added.error());
  }
  outputs.add("--json", arguments.json);
  return outputs;
}

std::string separation_text(const PlanArguments& arguments, const Plan::Separation& separation) {
  const PlanOptions& options = arguments.options;
  std::string text = fmt::format("{} beside {}: strength {:.3g}, of a Latin hypercube {:.3g}\n",
                                 in_words(options.cause), in_words(options.other),
                                 separation.plan.strength, separation.latin_hypercube.strength);
  for (std::size_t i = 0; i < separation.plan.parameters.size(); ++i) {
    const ParameterSeparation& after = separation.plan.parameters[i];
    const ParameterSeparation& before = separation.latin_hypercube.parameters[i];
    text += fmt::format(
        "  {}: {:.1f} % of its effect is its own ({:.1f} %), strength {:.3g} ({:.3g})\n",
        after.parameter, 100 * after.share, 100 * before.share, after.strength, before.strength);
  }
  if (separation.hopeless.empty()) return text;
  const bool all = separation.hopeless.size() == separation.plan.parameters.size();
  return text +
         fmt::format(
             "No pose of this cell separates {} from {} and the cell's other sources; {} would\n",
             all ? in_words(options.cause)
                 : fmt::format("{} of {}", fmt::join(separation.hopeless, ", "),
                               in_words(options.cause)),
             in_words(options.other), separation.needs);
}

/// The change that this check shows worst.
const SmallestEffect* hardest_seen(const Plan& plan) {
  const auto rms = [](const SmallestEffect& one) {
    return one.rms.value_or(std::numeric_limits<double>::infinity());
  };
  const auto worst =
      std::max_element(plan.smallest.begin(), plan.smallest.end(),
                       [&](const auto& one, const auto& other) { return rms(one) < rms(other); });
  return worst == plan.smallest.end() ? nullptr : &*worst;
}

std::string check_text(const Plan& plan) {
  const SmallestEffect* hardest = hardest_seen(plan);
  if (hardest == nullptr) return "";
  if (!hardest->rms)
    return fmt::format("No change of {} would be seen\n", in_words(hardest->cause));
  return fmt::format(
      "Counting the instrument's noise alone, every single change of {:.3f} mm rms is seen with 95 "
      "%, hardest {}; what a model leaves over makes that larger: trammel check says how large\n",
      to_mm(*hardest->rms), in_words(hardest->cause));
}

/// What the poses keep clear of, and what nobody looked at.
std::string clear_text(const Plan& plan) {
  return plan.clear_of.empty()
             ? "Nothing that the arm could touch is stated (obstacles of the cell file): look at "
               "the "
               "poses with trammel view before they run\n"
             : fmt::format(
                   "Every pose and its approach is clear of {}; the ways between poses were "
                   "not looked at\n",
                   plan.clear_of);
}

std::string in_words(const Cell& cell, const PlanArguments& arguments, const Plan& plan) {
  const DrawCount& draw = plan.draw;
  if (!arguments.from.empty()) {
    return fmt::format("{} poses for cell {} in {}\n", plan.poses.size(), cell.name,
                       arguments.output) +
           clear_text(plan);
  }
  std::string text = fmt::format(
      "{} poses for cell {} in {}\n{} drawn, {} kept: {} outside the workspace, {}{} out of sight, "
      "{} too near to a joint limit\n",
      plan.poses.size(), cell.name, arguments.output, draw.drawn, draw.kept, draw.outside,
      plan.clear_of.empty() ? "" : fmt::format("{} touching an obstacle, ", draw.touching),
      draw.unseen, draw.no_way);
  if (arguments.options.criterion == PlanCriterion::kObservability) {
    text += fmt::format("log det of the information: {:.2f}, of a Latin hypercube {:.2f}\n",
                        plan.criterion, plan.criterion_of_latin_hypercube);
  }
  if (plan.separation) text += separation_text(arguments, *plan.separation);
  return text + clear_text(plan) + check_text(plan);
}

ordered_json as_json(const Separability& separability) {
  ordered_json parameters = ordered_json::array();
  for (const ParameterSeparation& p : separability.parameters) {
    parameters.push_back(
        {{"parameter", p.parameter}, {"strength", p.strength}, {"share", p.share}});
  }
  return {{"strength", separability.strength}, {"parameters", parameters}};
}

ordered_json as_json(const Cell& cell, const PlanArguments& arguments, const Plan& plan) {
  const DrawCount& draw = plan.draw;
  ordered_json json = {{"cell", cell.name},
                       {"poses", plan.poses.size()},
                       {"seed", arguments.options.seed},
                       {"criterion", arguments.criterion},
                       {"drawn", draw.drawn},
                       {"kept", draw.kept},
                       {"outside_workspace", draw.outside},
                       {"touching_obstacle", draw.touching},
                       {"clear_of", plan.clear_of},
                       {"out_of_sight", draw.unseen},
                       {"near_joint_limit", draw.no_way}};
  if (arguments.check > 0) {
    const SmallestEffect* hardest = hardest_seen(plan);
    const bool seen = hardest != nullptr && hardest->rms.has_value();
    json["would_have_seen_mm"] = seen ? ordered_json(to_mm(*hardest->rms)) : ordered_json(nullptr);
  } else if (arguments.options.criterion != PlanCriterion::kLatinHypercube) {
    json["log_det"] = plan.criterion;
    json["log_det_lhs"] = plan.criterion_of_latin_hypercube;
  }
  if (plan.separation) {
    json["separability"] = {{"plan", as_json(plan.separation->plan)},
                            {"lhs", as_json(plan.separation->latin_hypercube)},
                            {"all_candidates", as_json(plan.separation->candidates)},
                            {"not_separable", plan.separation->hopeless},
                            {"needs", plan.separation->needs}};
  }
  return json;
}

/// A plan of given poses, for example those of `diagnose --next-poses`.
Result<Plan> plan_from(const Cell& cell, const std::string& path) {
  return read_joint_file(path)
      .and_then([&](JointList list) { return check_against_cell(std::move(list), cell); })
      .and_then([&](const JointList& list) { return plan_of(cell, list); });
}

Status plan(PlanArguments arguments) {
  if (arguments.options.count == 0 && arguments.check == 0 && arguments.from.empty()) {
    return failure(ErrorCode::kUsage, "--count, --check or --from is required").of("--count");
  }
  TRY(read_criterion(arguments.criterion, arguments.options));
  if (arguments.check > 0) {
    arguments.criterion = "check";
    arguments.options.criterion = PlanCriterion::kCheck;
    arguments.options.count = arguments.check;
  }
  const std::vector<double>& contact = arguments.contact_mm;
  if (!contact.empty())
    arguments.options.contact_B = from_mm(1) * Vector3(contact[0], contact[1], contact[2]);
  arguments.options.orientation = !arguments.positions_only && contact.empty();
  Cell read = TRY(read_cell_to_train(arguments.cell, {.bias = false}));
  const auto cell = std::make_shared<const Cell>(std::move(read));
  Result<Plan> planned = arguments.from.empty() ? make_plan(cell, arguments.options)
                                                : plan_from(*cell, arguments.from);
  if (!planned) return tl::make_unexpected(planned.error());
  // A batch is measured in the order of the program, so the plan gets the same order.
  if (arguments.writes_program() && !arguments.keep_order)
    planned = ordered_for_travel(cell->robot, std::move(*planned));
  Outputs outputs = TRY(outputs_of(*cell, arguments, *planned));
  outputs.put("--json", json_text(as_json(*cell, arguments, *planned)));
  TRY(outputs.write());
  tell(in_words(*cell, arguments, *planned), {arguments.output, arguments.rapid, arguments.krl,
                                              arguments.fanuc, arguments.urscript, arguments.json});
  return {};
}

void add_program_options(CLI::App& command, PlanArguments& arguments) {
  command.add_option("--rapid", arguments.rapid, "Program to write for an ABB controller (.mod)")
      ->type_name("FILE");
  command.add_option("--krl", arguments.krl, "Program to write for a KUKA controller (.src)")
      ->type_name("FILE");
  command.add_option("--fanuc", arguments.fanuc, "Program to write for a FANUC controller (.ls)")
      ->type_name("FILE");
  command
      .add_option("--urscript", arguments.urscript,
                  "Program to write for a Universal Robots controller (.script)")
      ->type_name("FILE");
  command.add_flag("--keep-order", arguments.keep_order,
                   "Leave the poses of programs, and of the plan beside them, in the order of "
                   "their choice, not in one in which the arm travels little");
  command
      .add_option("--fanuc-tool", arguments.program.fanuc_tool,
                  "Number of the tool frame in the FANUC controller that the program names")
      ->capture_default_str();
  command
      .add_option("--rapid-tool", arguments.program.rapid_tool,
                  "Tooldata of the ABB controller that the program names")
      ->capture_default_str();
  command
      .add_option("--krl-tool", arguments.program.krl_tool,
                  "Number of the tool in the KUKA controller that the program names")
      ->capture_default_str();
  command
      .add_option("--wait", arguments.program.wait_s, "How long a program waits at each pose, s")
      ->capture_default_str();
}

/// How the poses are chosen, and for what.
void add_choice_options(CLI::App& command, PlanArguments& arguments) {
  command
      .add_option("--criterion", arguments.criterion,
                  "How poses are chosen: lhs, spread evenly over the joint ranges (Latin "
                  "hypercube); observability, so that the parameters of the cell's error sources "
                  "become certain; separate:CAUSE,CAUSE, to tell the first cause from the second")
      ->capture_default_str();
  CLI::Option* twice = command.add_flag(
      "--bidirectional", arguments.options.bidirectional,
      "Every pose twice, once with all joints from above and once from below (else once, each "
      "joint from above at one half of the poses and from below at the other)");
  command
      .add_flag("--one-way", arguments.options.one_way,
                "Every pose once, all joints from below: a model of such poses promises nothing "
                "of poses that are approached from above")
      ->excludes(twice)
      ->excludes("--from");
  command.add_flag("--positions-only", arguments.positions_only,
                   "Choose for a single reflector, which shows no orientations");
  command
      .add_option("--contact-mm", arguments.contact_mm,
                  "Point x,y,z in the robot's base, mm, that the tip meets in all poses (a "
                  "spike): approach it by hand, these poses keep no distance from it")
      ->delimiter(',')
      ->expected(3)
      ->excludes("--from");
  command
      .add_option("--tool", arguments.options.tools,
                  "Tool id of the cell; several, joined by commas, are planned for in turn")
      ->delimiter(',');
  command
      .add_option("--payload", arguments.options.payloads,
                  "Payload id of the cell; several, joined by commas, are planned for in turn")
      ->delimiter(',');
}

}  // namespace

void add_plan_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<PlanArguments>();
  PlanOptions& options = arguments->options;
  CLI::App* command = app.add_subcommand(
      "plan", "Plan measuring poses for a cell, and write them as robot programs");
  command->add_option("--cell", arguments->cell, "Cell file (YAML)")->required();
  CLI::Option* count = command
                           ->add_option("--count", options.count,
                                        "Number of poses; this, --check or --from is required")
                           ->check(CLI::Range(1, 1000000));
  CLI::Option* check = command
                           ->add_option("--check", arguments->check,
                                        "Number of poses of a health check (command check): those "
                                        "that show most of what may have changed")
                           ->check(CLI::Range(1, 1000))
                           ->excludes(count);
  command
      ->add_option("--from", arguments->from,
                   "Poses chosen already (CSV: joints in deg, rails in mm), as diagnose "
                   "--next-poses writes them, to write programs of")
      ->excludes(count)
      ->excludes(check);
  add_seed_option(*command, options.seed, "Seed of the draw");
  add_choice_options(*command, *arguments);
  command
      ->add_option("-o,--output", arguments->output,
                   "Plan to write (CSV: joints in deg, rails in mm)")
      ->required();
  add_program_options(*command, *arguments);
  add_json_option(*command, arguments->json);
  command->callback([arguments, &chosen] { chosen = [arguments] { return plan(*arguments); }; });
}

}  // namespace trammel::cli
