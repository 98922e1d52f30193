#include "server/compensate/model_notes.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/frames/frames.h"
#include "server/compensate/file_doubts.h"
#include "server/compensate/hidden_error.h"
#include "server/compensate/paired_gain.h"
#include "server/compensate/session_changes.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/computed_positions.h"
#include "server/robot/cell_doubts.h"
#include "server/robot/gauge.h"
#include "server/robot/robot_confirmation.h"

namespace trammel {

namespace {

using Severity = Note::Severity;

constexpr double kNothing =
    1e-9;  // m, rad: a parameter whose prior moves the tool by less has no effect
constexpr double kElsewhere = 1e-3;  // m: a smaller move of the tool needs no note
constexpr double kSameRms = 1e-9;    // relative
constexpr int kAskedPoses = 5;       // enough that each source acts at one of them
constexpr const char* kAsWithout = "so the model is what it would be without it";
constexpr int kAfterEverything =
    1 << 20;  // index of a pose after any batch: all that begins at a pose has begun

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
  for (std::size_t i = 0; i < parameters.size(); ++i)
    most(static_cast<Eigen::Index>(i)) *= parameters[i].prior_scale;
  return most;
}

bool carries_nothing(const CompensatedModel::Parts& parts) {
  const Cell& cell = *parts.physics.cell;
  const bool loaded =
      std::any_of(parts.trained_with.begin(), parts.trained_with.end(), [&](const auto& used) {
        const auto payload = cell.payloads.find(used.second);
        return payload != cell.payloads.end() && payload->second.mass > 0;
      });
  return !loaded && !cell.robot.has_link_masses();
}

/// Describes, for people, the model without a source that has no effect.
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
    if (record->gives_way)
      text += fmt::format("{}no {}", text.empty() ? "" : ", ", record->plain_name);
  }
  return text;
}

/// Adds notes on sources that training added automatically.
void add_what_data_added(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const auto& added = source->cause().added_by_data;
    // One session shows no warmth that training adds.
    if (source->cause().needs.temperature && parts.sessions.empty()) continue;
    if (added && !added->is_known(*parts.physics.cell))
      notes.push_back({"added_by_data", Severity::kInfo, std::string(added->note)});
  }
}

std::string idle_sentence(const CompensatedModel::Parts& parts, const ErrorSource& source) {
  const CauseRecord& cause = source.cause();
  const std::string name = in_words(source.name());
  if (cause.needs.payload && !cause.gives_way)
    return fmt::format("{} does nothing here: nothing gives way under a load ({})", name,
                       what_would_give_way());
  if (cause.gives_way && carries_nothing(parts)) {
    return fmt::format(
        "{} does nothing here: neither link masses nor a payload with a mass are given, {}; give "
        "payloads: {{NAME: {{mass_kg: ..., cog_mm: [x, y, z]}}}} in the cell file",
        name, so_it_is(parts, source));
  }
  return fmt::format("{} does nothing here: at these poses it has nothing to act on", name);
}

void add_idle_sources(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  if (parts.physics.parameter_count() == 0 || parts.trained_with.empty()) return;
  const Eigen::VectorXd effect = effects(parts);
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (count > 0 && !is_of_instruments(*source) &&
        effect.segment(first, count).maxCoeff() < kNothing)
      notes.push_back({"idle_source", Severity::kInfo, idle_sentence(parts, *source)});
    first += count;
  }
}

void add_confirmation(const Cell& cell, std::vector<Note>& notes) {
  if (confirmation_of(cell)) return;
  notes.push_back(
      {kNotConfirmed, Severity::kInfo,
       "nobody has compared the robot file with the controller (trammel confirm-robot): where a "
       "length in it is not the controller's, corrected poses land off by the difference"});
}

/// m: the residual of one axis of a training pose, or of a gauge, and the stated sigma.
struct LeftOver {
  double left = 0, stated = 0;
  bool is_of_gauges = false;
};

/// `rms` is that of all rows. The discrepancy excludes the effect of the rows' own sigmas and of
/// single bad poses, and the rms excludes the bias.
LeftOver left_over(const CompensatedModel::Parts& parts, double rms, double stated) {
  return {std::min(rms, std::hypot(parts.discrepancy, stated)), stated};
}

/// m, of one value of the least exact instrument of the cell.
double stated_of_gauges(const Cell& cell) {
  double stated = 0;
  if (const Result<Anchors> anchors = anchors_of(cell)) {
    for (const auto& [id, anchor] : *anchors)
      stated = std::max(stated, anchor.sigma.value_or(cell.tracker.sigma));
  }
  return stated > 0 ? stated : cell.tracker.sigma;
}

/// The residuals of positions or of gauges, whichever exceed their stated sigma more.
LeftOver worst_left_over(const CompensatedModel::Parts& parts) {
  const Cell& cell = *parts.physics.cell;
  const double stated =
      parts.measured ? parts.measured->stated.value_or(cell.tracker.sigma) : cell.tracker.sigma;
  LeftOver worst{0, stated};
  if (parts.training.poses > 0)
    worst = left_over(parts, parts.training.compensated.rms / std::sqrt(3.0), stated);
  if (!parts.training.gauges) return worst;
  LeftOver gauges = left_over(parts, parts.training.gauges->compensated, stated_of_gauges(cell));
  gauges.is_of_gauges = true;
  return gauges.left * worst.stated > worst.left * gauges.stated ? gauges : worst;
}

void add_left_over(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  constexpr double kLeads = 3, kStops = 30;  // times the stated sigma
  constexpr double kRounded = 0.3;           // of the remainder: rounding may be a large part of it
  const LeftOver worst = worst_left_over(parts);
  const double times = worst.left / worst.stated;
  if (!(times >= kLeads)) return;
  std::string what = "trammel diagnose";
  if (worst.is_of_gauges)
    what =
        "are the anchors where the cell file says, and their planes not askew? is the tool the one "
        "that was used?";
  else if (parts.measured && parts.measured->joint_rounding &&
           parts.measured->joint_rounding->stddev > kRounded * worst.left)
    what = fmt::format(
        "all joints are whole multiples of {:g} deg: where a display rounded them, that alone "
        "makes "
        "{:.3f} mm; else trammel diagnose",
        to_deg(parts.measured->joint_rounding->step),
        to_mm(parts.measured->joint_rounding->stddev));
  notes.push_back(
      {"left_over_sigma", times >= kStops ? Severity::kStop : Severity::kWarning,
       fmt::format("{:.0f} times the stated sigma is left at the training poses ({:.3f} mm {}, "
                   "stated {:.3f} mm): the intervals were widened to fit, so their coverage does "
                   "not show that the model is right ({})",
                   times, to_mm(worst.left), worst.is_of_gauges ? "a distance or touch" : "an axis",
                   to_mm(worst.stated), what)});
}

/// Compares orientations with their own sigma, which is often not stated. The note says so if they
/// are far above it.
void add_left_of_orientations(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  constexpr double kFar = 10;  // times the stated sigma
  const double stated = parts.physics.cell->tracker.sigma_rotation;
  if (!parts.training.orientation) return;
  const double left = parts.training.orientation->compensated / std::sqrt(3.0);
  if (!(left >= kFar * stated)) return;
  notes.push_back(
      {"orientations_left_over", Severity::kWarning,
       fmt::format(
           "{:.0f} times the stated sigma is left of the orientations ({:.4f} deg an axis, "
           "stated {:.5f} deg): is sigma_deg of the cell file in degrees, and q_wxyz of the "
           "tool the one that was measured?",
           left / stated, to_deg(left), to_deg(stated))});
}

/// The instrument's own error is at most the residual of the physics. If the stated sigma is
/// larger, an error of the arm passes for the instrument's. The note appears if that changes a
/// stated accuracy: without a bias the accuracy includes the hidden part (hidden_by_sigma()), and
/// the note is information.
void add_overstated(const CompensatedModel& model, std::vector<Note>& notes) {
  const CompensatedModel::Parts& parts = model.parts();
  const bool counted = parts.discrepancy > 0;
  const double left =
      !parts.bias ? (counted ? left_within_sigma(parts) : 0) : hidden_by_sigma(model);
  if (left == 0) return;
  notes.push_back(
      {"sigma_overstated", parts.bias ? Severity::kWarning : Severity::kInfo,
       fmt::format(
           "{:.3f} mm an axis is left at the training poses, and a sigma of {:.3f} mm is stated: "
           "{}; state the instrument's own sigma (tracker: sigma_mm) and train again",
           to_mm(left), to_mm(parts.physics.cell->tracker.sigma),
           parts.bias
               ? "what the arm errs may be taken for the instrument's error, and is not promised"
               : "all that is left is taken for the arm's error, which makes what is promised "
                 "larger")});
}

/// Adds the note on a base that the cell leaves open and whose turn the poses do not determine.
void add_untold_turn(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  if (parts.physics.cell->X_WB) return;
  for (const UnidentifiableCombination& one : parts.unidentifiable)
    if (one.singular_value == 0 && one.parameters == turn_of_base())
      notes.push_back({"base_turn_untold", Severity::kStop, one.sentence});
}

/// About one point with a base that is told, the tool, the zeros of the last joints and the lengths
/// pass for each other. An arm that was identified there is wrong elsewhere.
void add_one_place(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  const auto& sources = parts.physics.sources;
  const bool is_of_arm = std::any_of(sources.begin(), sources.end(), [](const auto& source) {
    return source->cause().part == causes::Part::kLinks;
  });
  if (!parts.measured || !parts.measured->one_place || !parts.provenance.refits.empty()) return;
  if (!parts.physics.cell->X_WB || !is_of_arm) return;
  notes.push_back(
      {"one_place", Severity::kStop,
       "every tool was measured at one place: tool, zeros of the last joints and lengths cannot be "
       "told apart there, so an error of one may stand under the name of another, and poses "
       "elsewhere may be far off; measure poses all over the workspace and train again"});
}

void add_cell_doubts(const Cell& cell, std::vector<Note>& notes) {
  for (const CellDoubt& doubt : doubts_of(cell))
    notes.push_back({doubt.code, Severity::kWarning, doubt.text});
}

/// The base by the measurements, unless it was to be found anew. Several set-ups of the instrument
/// say themselves that it stood elsewhere.
void add_base_elsewhere(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  const auto is_anew = [](const RefitRecord& refit) {
    const auto& base = cause_correcting(causes::Part::kBase).spelling;
    return std::find(refit.sources.begin(), refit.sources.end(), base) != refit.sources.end();
  };
  const auto& refits = parts.provenance.refits;
  if (!parts.sessions.empty() || std::any_of(refits.begin(), refits.end(), is_anew)) return;
  if (auto note = base_elsewhere(parts.physics)) notes.push_back(*std::move(note));
}

/// The doubts of the robot file, by the geometry of the model or by what training asked beside it.
void add_off_drawing(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  if (auto off = robot_off_drawing(parts.physics, parts.parameters, parts.discrepancy))
    notes.push_back(*std::move(off));
  if (auto scaled = lengths_scaled(parts.physics, parts.parameters, parts.covariance))
    notes.push_back(*std::move(scaled));
  if (parts.measured && parts.measured->off_drawing)
    notes.push_back({kOffDrawing, Severity::kStop, *parts.measured->off_drawing});
}

void add_moved_tools(const CompensatedModel& model, std::vector<Note>& notes) {
  const CompensatedModel::Parts& parts = model.parts();
  if (!parts.bias_origin) return;
  const PhysicalModel& then = parts.bias_origin->physics;
  for (const auto& [name, X_FT] : parts.physics.tools) {
    const double moved =
        (served_tool(parts.physics, name).translation() - served_tool(then, name).translation())
            .norm();
    if (moved < kElsewhere) continue;
    notes.push_back({"tool_moved", Severity::kInfo,
                     fmt::format("the bias was learned with tool '{}' {:.1f} mm from where it is "
                                 "now: its kernel does not follow what turns the flange to the new "
                                 "point; learn it anew (--bias) where that matters",
                                 name, to_mm(moved))});
  }
}

void add_changes(const CompensatedModel& model, std::vector<Note>& notes) {
  for (const SessionChange& change : session_changes(model))
    notes.push_back({"changed_between_sessions", Severity::kInfo, sentence(change)});
  if (const auto order = note_on_order(model.parts().sessions, model.parts().sessions_as_given))
    notes.push_back({"order_of_sessions", Severity::kInfo, *order});
}

void add_sessions(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  for (const LeftOutSession& session : parts.sessions_left_out)
    notes.push_back(
        {"session_left_out", Severity::kWarning,
         fmt::format("nothing was learned from session {}: {}", session.id, session.why)});
  for (const SessionSetting& session : parts.sessions) {
    if (session.scale != 0) {
      notes.push_back(
          {"session_scale", Severity::kInfo,
           fmt::format("session {} measured lengths {:.1f} ppm {} than session {}: it has a scale "
                       "of its own",
                       session.id, 1e6 * std::abs(session.scale),
                       session.scale < 0 ? "longer" : "shorter", parts.sessions.back().id)});
    }
    if (session.own_noise == 0 && session.own_noise_rotation == 0) continue;
    notes.push_back(
        {"session_noisier", Severity::kInfo,
         fmt::format("session {} is noisier than the others, by {:.4f} mm and {:.4f} deg an axis: "
                     "it counts for less",
                     session.id, to_mm(session.own_noise), to_deg(session.own_noise_rotation))});
  }
}

/// The number of values that the training measured: coordinates, turns and distances.
long measured_numbers(const Evaluation& training) {
  const long turns = training.orientation ? 3L * training.orientation->poses : 0;
  return 3L * training.poses + turns + (training.gauges ? training.gauges->rows : 0);
}

/// The drawing was not fitted to the batch, so its errors are small only if the positions were
/// computed from it. An identified arm may have small errors because its numbers are few.
void add_computed_positions(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  const Evaluation& training = parts.training;
  auto text = computed_not_measured(training.nominal.rms, parts.physics.cell->tracker.sigma,
                                    training.poses);
  if (!text && !training.gauges && measured_numbers(training) >= 2L * parts.rank)
    text = computed_by_its_arm(training.calibrated.rms, training.poses);
  if (text) notes.push_back({"computed_positions", Severity::kWarning, *std::move(text)});
}

/// A fit of r combinations to n numbers leaves sqrt(1 - r/n) of their rms: below n = 2 r more than
/// a third is hidden.
void add_too_few_poses(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  const long numbers = measured_numbers(parts.training);
  if (!parts.provenance.refits.empty() || parts.training.poses == 0 || numbers >= 2L * parts.rank)
    return;
  const double each = static_cast<double>(numbers) / parts.training.poses;
  const double enough = std::ceil(2.0 * static_cast<double>(parts.parameters.size()) / each);
  notes.push_back(
      {"too_few_poses", Severity::kWarning,
       fmt::format("{} combinations of parameters were fitted to {} measured numbers of {} poses: "
                   "what is left at these poses is small by that alone and does not tell how well "
                   "others are met; train on {:.0f} poses or more",
                   parts.rank, numbers, parts.training.poses, enough)});
}

void add_sides(const CompensatedModel::Parts& parts, std::vector<Note>& notes) {
  const std::string side = one_sided(parts.measured);
  if (side.empty()) return;
  notes.push_back({kOneSide, Severity::kWarning,
                   fmt::format("the arm came to the training poses {} only: nothing is promised of "
                               "poses that it comes to from the other side, where the play of the "
                               "gears puts the tool elsewhere (trammel plan goes both ways)",
                               side)});
}

}  // namespace

std::vector<Note> notes_of(const CompensatedModel& model) {
  std::vector<Note> notes;
  add_off_drawing(model.parts(), notes);
  add_base_elsewhere(model.parts(), notes);
  if (model.parts().measured && model.parts().measured->rounding)
    notes.push_back(measurements_rounded(*model.parts().measured->rounding));
  add_too_few_poses(model.parts(), notes);
  add_changes(model, notes);
  add_sessions(model.parts(), notes);
  add_what_data_added(model.parts(), notes);
  add_idle_sources(model.parts(), notes);
  add_left_over(model.parts(), notes);
  add_left_of_orientations(model.parts(), notes);
  add_overstated(model, notes);
  add_computed_positions(model.parts(), notes);
  if (auto rows =
          rows_that_do_not_fit(model.parts().suspects, model.parts().provenance.training_poses))
    notes.push_back(*std::move(rows));
  add_untold_turn(model.parts(), notes);
  add_one_place(model.parts(), notes);
  add_sides(model.parts(), notes);
  add_cell_doubts(model.cell(), notes);
  add_moved_tools(model, notes);
  add_confirmation(model.cell(), notes);
  return gravest_first(std::move(notes));
}

std::vector<Note> notes_of(const Cell& cell) {
  std::vector<Note> notes;
  add_cell_doubts(cell, notes);
  add_confirmation(cell, notes);
  return gravest_first(std::move(notes));
}

std::optional<Note> stop_of(const CompensatedModel& model) {
  std::vector<Note> notes = notes_of(model);
  if (notes.empty() || notes.front().severity != Severity::kStop) return std::nullopt;
  return std::move(notes.front());
}

std::vector<Note> warnings_of(const CompensatedModel& model,
                              const std::optional<Evaluation>& evaluation) {
  std::vector<Note> all = notes_of(model);
  const std::optional<std::string> doubt = evaluation ? doubt_of_bias(*evaluation) : std::nullopt;
  if (doubt) all.push_back({"bias_doubtful", Severity::kWarning, *doubt});
  return gravest_first(std::move(all));
}

std::optional<std::string> doubt_of_bias(const Evaluation& evaluation) {
  const double with = evaluation.compensated.rms;
  const double without = evaluation.calibrated.rms;
  // Without a bias the two are the same up to rounding.
  const bool worse = with > without * (1 + kSameRms) || (evaluation.bias_gain_z && with >= without);
  const bool by_chance =
      evaluation.bias_gain_z && *evaluation.bias_gain_z <= PairedGain::kBeyondChance;
  if (!worse && !by_chance) return std::nullopt;
  return fmt::format("the bias {} here: {:.4f} mm with it, {:.4f} mm without on {} poses{}",
                     worse ? "does not help" : "is not shown to help", to_mm(with), to_mm(without),
                     evaluation.poses, worse ? "" : ", no more than chance would make of it");
}

}  // namespace trammel
