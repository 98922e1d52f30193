#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <set>

#include "clients/cli/commands/commands.h"
#include "clients/cli/commands/recent_work.h"
#include "clients/cli/files/recorded_calls.h"
#include "clients/cli/service/answers.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/base/units.h"
#include "server/compensate/exchanged.h"
#include "server/compensate/model_file.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kTold = 10;        // listed differences, the largest first
constexpr double kAnotherBranch = 1e-3;  // rad, the largest difference of a joint within one branch

struct ReplayArguments {
  std::string model, json, next_poses;
  std::vector<std::string> inputs;
  double tolerance_mm = 1e-6;
  bool strict = false;
  ServiceOptions service;
};

/// The difference between an item's answer now and then.
struct Different {
  double by_mm =
      0;  ///< infinite where one has a number or a pose to command and the other has none
  bool is_of_another_kind = false;  ///< however small that is: status, domain, branch
  std::string what;
};

/// The results of all replayed items.
struct Replayed {
  std::size_t requests = 0, items = 0, different = 0;
  double largest_mm = 0;
  std::vector<Different> told;        ///< the largest first
  std::set<std::string> models;       ///< the models that answered the recorded requests
  std::set<std::string> models_now;   ///< likewise, by hash
  std::size_t of_other_models = 0;    ///< requests that another model answered then
  std::set<std::string> other_cells;  ///< cells of the records other than the model's
  std::vector<DamagedLines> damaged;  ///< by the given file or folder
  std::vector<std::string> half;      ///< last lines that were not written to their ends
};

double distance(const exchange::Pose& a, const exchange::Pose& b) {
  const auto &p = a.xyz_mm, &r = b.xyz_mm;
  return std::hypot(p[0] - r[0], p[1] - r[1], p[2] - r[2]);
}

bool has_command(const exchange::CorrectedTarget& target) {
  return target.status == "ok" || target.status == "out_of_domain";
}

/// The difference of two numbers; none where both are unknown.
double apart(double a, double b) {
  if (std::isfinite(a) && std::isfinite(b)) return std::abs(a - b);
  return std::isfinite(a) == std::isfinite(b) ? 0 : INFINITY;
}

double apart(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(apart(a[0], b[0]), apart(a[1], b[1]), apart(a[2], b[2]));
}

const char* domain_word(bool in_domain) { return in_domain ? "in domain" : "out of domain"; }

Different compared(const exchange::Prediction& then, const exchange::Prediction& now) {
  const double error = apart(then.error_mm, now.error_mm);
  const double spread = apart(then.true_stddev_mm, now.true_stddev_mm);
  if (then.in_domain != now.in_domain)
    return {
        std::max(error, spread), true,
        fmt::format("{} then, {} now", domain_word(then.in_domain), domain_word(now.in_domain))};
  return {
      std::max(error, spread), false,
      fmt::format("the error by {:.3g} mm, its standard deviation by {:.3g} mm", error, spread)};
}

/// rad, of a rail mm.
std::vector<double> in_radians(std::vector<double> joints_deg, const exchange::Rails& rails) {
  for (std::size_t j = 0; j < joints_deg.size(); ++j)
    if (!exchange::is_rail(rails, j)) joints_deg[j] = from_deg(joints_deg[j]);
  return joints_deg;
}

/// rad; infinite for different numbers of joints.
double joints_apart(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return INFINITY;
  double most = 0;
  for (std::size_t j = 0; j < a.size(); ++j) most = std::max(most, apart(a[j], b[j]));
  return most;
}

/// `now` with the joints of a robot with these rails.
Different compared(const RecordedTarget& recorded, const exchange::CorrectedTarget& now,
                   const exchange::Rails& rails) {
  const exchange::CorrectedTarget& then = recorded.answer;
  if (then.status != now.status)
    return {
        has_command(then) == has_command(now) ? distance(then.commanded, now.commanded) : INFINITY,
        true, fmt::format("{} then, {} now", then.status, now.status)};
  if (!has_command(then)) return {};
  const double moved = distance(then.commanded, now.commanded);
  const double expected = std::max({apart(then.error_before_mm, now.error_before_mm),
                                    apart(then.error_after_mm, now.error_after_mm),
                                    apart(then.sigma_mm, now.sigma_mm)});
  const double turned =
      joints_apart(recorded.commanded_joints_rad, in_radians(now.joints_deg, rails));
  return {std::max(moved, expected), turned > kAnotherBranch,
          fmt::format("the commanded pose by {:.3g} mm, its joints by {:.3g} rad, the errors "
                      "expected by {:.3g} mm",
                      moved, turned, expected)};
}

void note(Replayed& all, const RecordedCall& call, std::size_t item, Different different,
          double tolerance_mm) {
  ++all.items;
  const bool is_same = different.by_mm <= tolerance_mm && !different.is_of_another_kind;
  if (is_same) return void(all.largest_mm = std::max(all.largest_mm, different.by_mm));
  ++all.different;
  all.largest_mm = std::max(all.largest_mm, different.by_mm);
  different.what =
      fmt::format("{} row {} item {}{}: {}", call.file, call.line, item + 1,
                  call.trace.empty() ? "" : " (trace " + call.trace + ")", different.what);
  all.told.push_back(std::move(different));
  std::stable_sort(all.told.begin(), all.told.end(),
                   [](const Different& a, const Different& b) { return a.by_mm > b.by_mm; });
  if (all.told.size() > kTold) all.told.pop_back();
}

/// The present answers: predictions and corrections for one recorded request, and the hash of the
/// model.
struct Answers {
  std::string hash;
  std::vector<exchange::Prediction> predictions;
  std::vector<exchange::CorrectedTarget> corrections;
  exchange::Rails rails = {};  ///< for the joints of the corrections
};
using Ask = std::function<Result<Answers>(const RecordedCall&)>;

Result<Answers> answered_here(const CompensatedModel& model, const RecordedCall& call) {
  const Cell& cell = model.cell();
  const auto at_line = [&](const Error& error) {
    return Failure(error).as(ErrorCode::kRefused).in(call.file).at_row(call.line);
  };
  const auto tool = resolve_tool(cell, call.tool), payload = resolve_payload(cell, call.payload);
  if (!tool) return at_line(tool.error());
  if (!payload) return at_line(payload.error());
  if (const Status known = model.check_trained_with(*tool, *payload); !known)
    return at_line(known.error());
  const auto joints = static_cast<std::size_t>(cell.robot.size());
  Answers answers{model.provenance().hash, {}, {}, exchange::rails_of(cell.robot)};
  const auto of_another_robot = [&] {
    return refused("joints of another robot").in(call.file).at_row(call.line).of("joints_rad");
  };
  for (const RecordedPose& pose : call.poses) {
    if (pose.asked.q_rad.size() != joints) return of_another_robot();
    const PoseContext asked = context_of(pose.asked, cell.robot, *tool, *payload);
    answers.predictions.push_back(exchanged(model.predict_all({asked}).front()));
  }
  for (const RecordedTarget& target : call.targets) {
    if (!target.asked.conf && target.asked.seed_rad.size() != joints) return of_another_robot();
    answers.corrections.push_back(exchanged(
        model.correct(target_of(target.asked, cell.robot), *tool, *payload), answers.rails));
  }
  return answers;
}

Result<Answers> answered_by(client::Session& session, const ModelReference& model,
                            const RecordedCall& call) {
  client::CallContext context;
  context.cell = call.cell;
  context.tool = call.tool;
  context.payload = call.payload;
  if (model.version > 0) context.model = fmt::format("@{}", model.version);
  if (!call.poses.empty()) {
    std::vector<exchange::AskedJoints> poses;
    for (const RecordedPose& pose : call.poses) poses.push_back(pose.asked);
    return session.predict_error_at(context, poses)
        .map([](exchange::Answer<exchange::Prediction> answer) {
          return Answers{answer.model.hash, std::move(answer.items), {}};
        });
  }
  std::vector<exchange::AskedTarget> targets;
  for (const RecordedTarget& target : call.targets) targets.push_back(target.asked);
  return session.correct_targets(context, targets)
      .map([](exchange::Answer<exchange::CorrectedTarget> answer) {
        return Answers{answer.model.hash, {}, std::move(answer.items)};
      });
}

Status compare(const RecordedCall& call, const Ask& ask, double tolerance_mm, Replayed& all) {
  const Answers now = TRY(ask(call));
  ++all.requests;
  all.models.insert(
      fmt::format("{}@{} ({})", call.cell, call.model_version, call.model_hash.substr(0, 8)));
  all.models_now.insert(now.hash.substr(0, 8));
  if (now.hash != call.model_hash) ++all.of_other_models;
  for (std::size_t i = 0; i < call.poses.size(); ++i)
    note(all, call, i, compared(call.poses[i].answer, now.predictions.at(i)), tolerance_mm);
  for (std::size_t i = 0; i < call.targets.size(); ++i)
    note(all, call, i, compared(call.targets[i], now.corrections.at(i), now.rails), tolerance_mm);
  return {};
}

std::string replayed_text(const Replayed& all, double tolerance_mm) {
  std::string text = fmt::format(
      "{} requests, {} items: {} differ by more than {:g} mm, the largest by {:.3g} mm\n",
      all.requests, all.items, all.different, tolerance_mm, all.largest_mm);
  if (all.requests == 0) text = "no requests recorded there\n";
  if (all.requests > 0)
    text += fmt::format("answered then by {}, now by {}\n", fmt::join(all.models, ", "),
                        fmt::join(all.models_now, ", "));
  if (all.of_other_models > 0)
    text += fmt::format("{} of the requests were answered by another model than now\n",
                        all.of_other_models);
  if (!all.other_cells.empty())
    text += fmt::format("requests of other cells were left out: {}\n",
                        fmt::join(all.other_cells, ", "));
  for (const Different& one : all.told) text += one.what + "\n";
  for (const DamagedLines& damaged : all.damaged)
    text += fmt::format("{} damaged {} left out, the first: {}\n", damaged.count,
                        damaged.count == 1 ? "line was" : "lines were", sentence(damaged.first));
  for (const std::string& half : all.half)
    text += fmt::format("{}: the last line is half and is left out\n", half);
  return text;
}

std::size_t damaged_lines(const Replayed& all) {
  std::size_t count = 0;
  for (const DamagedLines& damaged : all.damaged) count += damaged.count;
  return count;
}

ordered_json replayed_json(const Replayed& all, double tolerance_mm) {
  ordered_json told = ordered_json::array();
  for (const Different& one : all.told)
    told.push_back(
        {{"by_mm", std::isfinite(one.by_mm) ? ordered_json(one.by_mm) : ordered_json(nullptr)},
         {"what", one.what}});
  return {
      {"requests", all.requests},
      {"items", all.items},
      {"different", all.different},
      {"tolerance_mm", tolerance_mm},
      {"largest_mm",
       std::isfinite(all.largest_mm) ? ordered_json(all.largest_mm) : ordered_json(nullptr)},
      {"answered_by_another_model", all.of_other_models},
      {"other_cells", all.other_cells},
      {"damaged_lines", damaged_lines(all)},
      {"half_lines", all.half},
      {"first_damaged", all.damaged.empty() ? ordered_json(nullptr)
                                            : ordered_json(sentence(all.damaged.front().first))},
      {"largest", told}};
}

/// Without records: replays the recent requests of the service.
Result<Extent> replay_recent(const ReplayArguments& arguments) {
  if (!arguments.service.service)
    return failure(ErrorCode::kUsage, "either files of recorded requests, or --service")
        .of("records");
  return tell_recent_work({arguments.model, arguments.json, arguments.next_poses},
                          arguments.service)
      .map([&](double differs_mm) {
        return arguments.strict && differs_mm > arguments.tolerance_mm ? Extent::kPart
                                                                       : Extent::kAll;
      });
}

Result<Extent> replay(const ReplayArguments& arguments) {
  if (arguments.inputs.empty()) return replay_recent(arguments);
  if (!arguments.next_poses.empty())
    return failure(ErrorCode::kUsage,
                   "--next-poses is of what a service was lately asked, not of records")
        .of("--next-poses");
  std::string cell;
  std::optional<CompensatedModel> here;
  std::unique_ptr<client::Session> session;
  Ask ask;
  if (arguments.service.service) {
    const Result<ModelReference> model = parse_model_reference(arguments.model);
    if (!model) return tl::make_unexpected(model.error());
    auto opened = TRY(open_session(arguments.service));
    session = std::move(opened);
    cell = model->cell;
    ask = [&session, model = *model](const RecordedCall& call) {
      return answered_by(*session, model, call);
    };
  } else {
    auto model = TRY(load_model(arguments.model));
    here = std::move(model);
    cell = here->cell().name;
    ask = [&here](const RecordedCall& call) { return answered_here(*here, call); };
  }
  Replayed all;
  for (const std::string& input : arguments.inputs) {
    const auto read = TRY(read_records(input, [&](const RecordedCall& call) -> Status {
      if (call.cell == cell) return compare(call, ask, arguments.tolerance_mm, all);
      all.other_cells.insert(call.cell);
      return {};
    }));
    if (read.count > 0) all.damaged.push_back(read);
    all.half.insert(all.half.end(), read.half.begin(), read.half.end());
  }
  if (all.requests == 0 && !all.other_cells.empty())
    return refused("no request of cell {}, only of {}", cell, fmt::join(all.other_cells, ", "))
        .of("cell");
  tell(replayed_text(all, arguments.tolerance_mm), {arguments.json});
  TRY(write_json(arguments.json, replayed_json(all, arguments.tolerance_mm)));
  return !all.damaged.empty() || (arguments.strict && all.different > 0) ? Extent::kPart
                                                                         : Extent::kAll;
}

}  // namespace

void add_replay_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand("replay",
                                         "Ask again what a service has recorded, or was lately "
                                         "asked, and tell how the answers differ");
  command->add_option("records", arguments->inputs,
                      "Files of recorded requests (record: in server.yaml), or folders of them; "
                      "none: with --service the last poses that the cell was asked for, by its "
                      "model in force and by --model cell@version");
  command
      ->add_option("--model", arguments->model, "Model file; with --service a cell or cell@version")
      ->required();
  command->add_option("--tolerance", arguments->tolerance_mm, "Differences up to this are none, mm")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--strict", arguments->strict, "Exit 1 where an answer is another one");
  command->add_option("--next-poses", arguments->next_poses,
                      "Of what a service was lately asked: the poses where it is least sure (CSV; "
                      "plan --from reads it)");
  add_json_option(*command, arguments->json);
  add_service_options(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return replay(*arguments); }; });
}

}  // namespace trammel::cli
