#include "server/compensate/model_notes.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/compensate/model_guards.h"
#include "server/compensate/paired_gain.h"
#include "server/compensate/session_changes.h"
#include "server/error_sources/anchors.h"

namespace trammel {

namespace {

constexpr double kNothing = 1e-9;      // m, rad: a parameter whose prior moves the tool by less has no effect
constexpr double kFarFromDrawing = 5;  // standard deviations of the prior
constexpr double kElsewhere = 1e-3;    // m: a tool that moved by more turns through other errors of the arm
constexpr double kSameRms = 1e-9;      // relative
constexpr int kAskedPoses = 5;         // enough that each source acts at one of them
constexpr const char* kAsWithout = "so the model is what it would be without it";
constexpr int kAfterEverything = 1 << 20;  // index of a pose after any batch: all that begins at a pose has begun

/// A pose with everything recorded that a source may need.
PoseContext eventful(const CompensatedModel::Parts& parts, int k) {
  PoseContext context;
  const auto joints = parts.q_min.size();
  context.q = parts.q_min;
  for (Eigen::Index j = 0; j < joints; ++j) {
    // Each joint is at another share of its range, so that no axes are parallel by chance.
    const double share = 0.37 + 0.61 * static_cast<double>(k) + 0.29 * static_cast<double>(j);
    context.q(j) += (share - std::floor(share)) * (parts.q_max(j) - parts.q_min(j));
  }
  context.time = 1;
  context.temperature = 50;
  context.velocity = JointVector::Ones(joints);
  context.direction.assign(static_cast<std::size_t>(joints), 1);
  context.before = parts.q_min;
  context.index = kAfterEverything;
  return context;
}

/// For each parameter the most that one prior standard deviation moves the tool, m or rad.
Eigen::VectorXd effects(const CompensatedModel::Parts& parts) {
  const std::vector<Parameter> parameters = parts.physics.parameters();
  Eigen::VectorXd most = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(parameters.size()));
  for (const auto& [tool, payload] : parts.trained_with) {
    for (int k = 0; k < kAskedPoses; ++k) {
      PoseContext context = eventful(parts, k);
      context.tool = tool;
      context.payload = payload;
      Eigen::MatrixXd J;
      parts.physics.pose_W(context, parts.physics.values, &J);
      most = most.cwiseMax(J.colwise().lpNorm<Eigen::Infinity>().transpose());
    }
  }
  for (std::size_t i = 0; i < parameters.size(); ++i) most(static_cast<Eigen::Index>(i)) *= parameters[i].prior_scale;
  return most;
}

bool carries_nothing(const CompensatedModel::Parts& parts) {
  const Cell& cell = *parts.physics.cell;
  const bool loaded = std::any_of(parts.trained_with.begin(), parts.trained_with.end(), [&](const auto& used) {
    const auto payload = cell.payloads.find(used.second);
    return payload != cell.payloads.end() && payload->second.mass > 0;
  });
  return !loaded && !cell.robot.has_link_masses();
}

/// What the model is without a source that does nothing, for people.
std::string so_it_is(const CompensatedModel::Parts& parts, const ErrorSource& idle) {
  std::vector<std::string> others;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    if (source.get() != &idle) others.push_back(source->name());
  }
  std::vector<std::string> all = others;
  all.emplace_back(idle.cause().spelling);
  return all == standard_sources() && others == *parse_level("M2") ? "so M3 is M2" : kAsWithout;
}

/// `no gearbox compliance, no link bending`
std::string what_would_give_way() {
  std::string text;
  for (const CauseRecord* record : all_causes()) {
    if (record->gives_way) text += fmt::format("{}no {}", text.empty() ? "" : ", ", record->plain_name);
  }
  return text;
}

/// What training added by itself.
void add_what_data_added(const CompensatedModel::Parts& parts, std::vector<std::string>& notes) {
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const auto& added = source->cause().added_by_data;
    // One session shows no warmth that training adds.
    if (source->cause().needs.temperature && parts.sessions.empty()) continue;
    if (added && !added->is_known(*parts.physics.cell)) notes.emplace_back(added->note);
  }
}

std::string idle_sentence(const CompensatedModel::Parts& parts, const ErrorSource& source) {
  const CauseRecord& cause = source.cause();
  const std::string name = in_words(source.name());
  if (cause.needs.payload && !cause.gives_way)
    return fmt::format("{} does nothing here: nothing gives way under a load ({})", name, what_would_give_way());
  if (cause.gives_way && carries_nothing(parts)) {
    return fmt::format(
        "{} does nothing here: neither link masses nor a payload with a mass are given, {}; give payloads: {{NAME: "
        "{{mass_kg: ..., cog_mm: [x, y, z]}}}} in the cell file",
        name, so_it_is(parts, source));
  }
  return fmt::format("{} does nothing here: at these poses it has nothing to act on", name);
}

void add_idle_sources(const CompensatedModel::Parts& parts, std::vector<std::string>& notes) {
  if (parts.physics.parameter_count() == 0 || parts.trained_with.empty()) return;
  const Eigen::VectorXd effect = effects(parts);
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (count > 0 && !is_of_instruments(*source) && effect.segment(first, count).maxCoeff() < kNothing)
      notes.push_back(idle_sentence(parts, *source));
    first += count;
  }
}

/// What no arm is off its drawing by: something else than the arm is not as the files have it.
void add_far_parameters(const CompensatedModel::Parts& parts, std::vector<std::string>& notes) {
  std::string far;
  std::size_t first = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const std::size_t count = source->parameters().size();
    for (std::size_t i = first; i < first + count && source->cause().scope == causes::Scope::kArm; ++i) {
      const IdentifiedParameter& one = parts.parameters[i];
      const Parameter& parameter = one.parameter;
      if (!one.identified || std::abs(one.value - parameter.prior) < kFarFromDrawing * parameter.prior_scale) continue;
      far += fmt::format("{}{} {:.4g} {}", far.empty() ? "" : ", ", parameter.name, parameter.scale * one.value,
                         parameter.unit);
    }
    first += count;
  }
  if (far.empty()) return;
  notes.push_back(
      fmt::format("no arm is usually so far from its drawing: {}; is it this robot's file, and is the tool in the cell "
                  "file the one "
                  "that was measured (null in its place finds it)?",
                  far));
}

void add_moved_tools(const CompensatedModel& model, std::vector<std::string>& notes) {
  const CompensatedModel::Parts& parts = model.parts();
  if (!parts.bias_origin) return;
  const PhysicalModel& then = parts.bias_origin->physics;
  for (const auto& [name, X_FT] : parts.physics.tools) {
    const double moved =
        (served_tool(parts.physics, name).translation() - served_tool(then, name).translation()).norm();
    if (moved < kElsewhere) continue;
    notes.push_back(fmt::format(
        "the bias was learned with tool '{}' {:.1f} mm from where it is now: its kernel does not follow what turns the "
        "flange to the new point; learn it anew (--bias) where that matters",
        name, to_mm(moved)));
  }
}

void add_changes(const CompensatedModel& model, std::vector<std::string>& notes) {
  for (const SessionChange& change : session_changes(model)) notes.push_back(sentence(change));
  if (const auto order = note_on_order(model.parts().sessions, model.parts().sessions_as_given))
    notes.push_back(*order);
}

void add_sessions(const CompensatedModel::Parts& parts, std::vector<std::string>& notes) {
  for (const LeftOutSession& session : parts.sessions_left_out)
    notes.push_back(fmt::format("nothing was learned from session {}: {}", session.id, session.why));
  for (const SessionSetting& session : parts.sessions) {
    if (session.scale != 0) {
      notes.push_back(fmt::format(
          "session {} measured lengths {:.1f} ppm {} than session {}: it has a scale of its own", session.id,
          1e6 * std::abs(session.scale), session.scale < 0 ? "longer" : "shorter", parts.sessions.back().id));
    }
    if (session.own_noise == 0 && session.own_noise_rotation == 0) continue;
    notes.push_back(
        fmt::format("session {} is noisier than the others, by {:.4f} mm and {:.4f} deg an axis: it counts "
                    "for less",
                    session.id, to_mm(session.own_noise), to_deg(session.own_noise_rotation)));
  }
}

/// How many numbers the training measured: coordinates, turns and distances.
long measured_numbers(const Evaluation& training) {
  const long turns = training.orientation ? 3L * training.orientation->poses : 0;
  return 3L * training.poses + turns + (training.gauges ? training.gauges->rows : 0);
}

/// A fit of r combinations to n numbers leaves sqrt(1 - r/n) of their rms: below n = 2 r more than a third is hidden.
void add_too_few_poses(const CompensatedModel::Parts& parts, std::vector<std::string>& notes) {
  const long numbers = measured_numbers(parts.training);
  if (!parts.provenance.refits.empty() || parts.training.poses == 0 || numbers >= 2L * parts.rank) return;
  const double each = static_cast<double>(numbers) / parts.training.poses;
  const double enough = std::ceil(2.0 * static_cast<double>(parts.parameters.size()) / each);
  notes.push_back(fmt::format(
      "{} combinations of parameters were fitted to {} measured numbers of {} poses: what is left at these poses is "
      "small by that alone and does not tell how well others are met; train on {:.0f} poses or more",
      parts.rank, numbers, parts.training.poses, enough));
}

}  // namespace

std::vector<std::string> notes_of(const CompensatedModel& model) {
  std::vector<std::string> notes;
  for (const Note& guard : guards_of(model)) notes.push_back(guard.text);
  add_too_few_poses(model.parts(), notes);
  add_changes(model, notes);
  add_sessions(model.parts(), notes);
  add_what_data_added(model.parts(), notes);
  add_idle_sources(model.parts(), notes);
  add_far_parameters(model.parts(), notes);
  add_moved_tools(model, notes);
  return notes;
}

std::vector<std::string> warnings_of(const CompensatedModel& model, const std::optional<Evaluation>& evaluation) {
  std::vector<std::string> all = notes_of(model);
  const std::optional<std::string> doubt = evaluation ? doubt_of_bias(*evaluation) : std::nullopt;
  if (doubt) all.push_back(*doubt);
  return all;
}

std::optional<std::string> doubt_of_bias(const Evaluation& evaluation) {
  const double with = evaluation.compensated.rms;
  const double without = evaluation.calibrated.rms;
  // Without a bias the two are the same up to rounding.
  const bool worse = with > without * (1 + kSameRms) || (evaluation.bias_gain_z && with >= without);
  const bool by_chance = evaluation.bias_gain_z && *evaluation.bias_gain_z <= PairedGain::kBeyondChance;
  if (!worse && !by_chance) return std::nullopt;
  return fmt::format("the bias {} here: {:.4f} mm with it, {:.4f} mm without on {} poses{}",
                     worse ? "does not help" : "is not shown to help", to_mm(with), to_mm(without), evaluation.poses,
                     worse ? "" : ", no more than chance would make of it");
}

}  // namespace trammel
