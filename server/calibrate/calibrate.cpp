#include "server/calibrate/calibrate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "server/calibrate/frames/frames.h"
#include "server/calibrate/gauges/campaign_limits.h"
#include "server/calibrate/gauges/locate_anchors.h"
#include "server/calibrate/identify/check_needs.h"
#include "server/calibrate/identify/identify.h"
#include "server/calibrate/identify/order_search.h"
#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/sessions/locate_sessions.h"
#include "server/error_sources/anchors.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"
#include "server/measurement/warmth.h"

namespace trammel {

namespace {

constexpr double kWeighed = 20;  // nat: a cause that the data add must make them likelier by this
constexpr double kInsteadOfScales =
    3;  // likewise, for a cause that makes scales of the sessions superfluous
constexpr double kOfMetal = 0.2;  // of the prior scale: 4 um per m and K
constexpr std::size_t kSessionsOfWarmth =
    3;  // with two sessions, a scale of the instrument explains the same
constexpr double kStretched =
    10;  // nat: so much more likely must the data be with scales of the sessions,
constexpr double kStretchedOfSession = 3;  // in addition for each of them
constexpr double kPerhapsStretched =
    0.25;  // share of that price; if scales alone would gain more, a trial is worthwhile
constexpr double kZeroed = 10;  // the same with zero errors of the instruments
constexpr double kZeroedOfInstrument = 3;

/// The first value of the model's `base`; -1: it has none.
Eigen::Index place_of_base(const PhysicalModel& model) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    if (source->cause().part == causes::Part::kBase) return first;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  return -1;
}

bool has_unknown_frame(const Cell& cell) { return !cell.X_WB || has_unknown_tool(cell); }

/// Refines the unknown frames together, starting from their closed forms, and sets them in the
/// model. With an unknown tool, a known base that is to be identified is free as well, since the
/// instrument may stand elsewhere.
Status refine_frames(PhysicalModel& model, const MeasurementBatch& batch,
                     const CalibrateOptions& options) {
  const bool base_known = model.cell->X_WB.has_value();
  const bool tool_unknown = has_unknown_tool(*model.cell);
  std::vector<std::string> free;
  if (!base_known || (tool_unknown && place_of_base(model) >= 0))
    free.emplace_back(cause_correcting(causes::Part::kBase).spelling);
  if (tool_unknown) free.emplace_back(cause_correcting(causes::Part::kTool).spelling);
  if (free.empty()) return {};
  PhysicalModel frames = TRY(make_physical_model(model.cell, free));
  frames.X_WB = model.X_WB;
  frames.tools = model.tools;
  if (base_known) localise_base(frames, batch);
  const CalibrationResult refined = TRY(identify({frames, positions_of(batch)}, options));
  for (auto& [tool, X_FT] : model.tools) {
    PoseContext anywhere;
    anywhere.q = JointVector::Zero(model.cell->robot.size());
    anywhere.tool = tool;
    const ArmState arm = refined.model.state(anywhere);
    X_FT = arm.X_FT;
    if (!base_known) model.X_WB = arm.X_WB;
  }
  return {};
}

/// nat, that scales of the sessions must explain more.
double price_of_scales(std::size_t sessions) {
  return kStretched + kStretchedOfSession * static_cast<double>(sessions - 1);
}

/// True if the residuals of a session grow with the distance from its middle. It only justifies a
/// trial, since the parameters have absorbed a part of that growth.
bool perhaps_stretched(const CalibrationResult& found, const MeasurementBatch& located) {
  const Tracker& tracker = found.model.cell->tracker;
  const MeasurementBatch here =
      moved(located, found.sessions, tracker.sigma, tracker.sigma_rotation);
  const Residuals r = residuals_of(found.model, here, found.model.values);
  const std::size_t S = found.sessions.size();
  std::vector<Vector3> middle(S, Vector3::Zero());
  for (const Measurement& m : here.measurements) {
    const auto s = static_cast<std::size_t>(m.session);
    middle[s] += m.p_W / found.sessions[s].poses;
  }
  std::vector<double> along(S, 0.0), square(S, 0.0);
  for (std::size_t i = 0; i < here.measurements.size(); ++i) {
    const auto s = static_cast<std::size_t>(here.measurements[i].session);
    const auto at = static_cast<Eigen::Index>(i);
    const Vector3 from_middle = here.measurements[i].p_W - middle[s];
    const double variance = std::pow(r.sigma(at), 2) + std::pow(found.discrepancy, 2);
    along[s] += r.position.col(at).dot(from_middle) / variance;
    square[s] += from_middle.squaredNorm() / variance;
  }
  double gain = 0;
  for (std::size_t s = 0; s < S; ++s)
    gain += square[s] > 0 ? 0.5 * along[s] * along[s] / square[s] : 0;
  return gain > kPerhapsStretched * price_of_scales(S);
}

/// Calls identify(), and repeats it with a scale for each session if the data ask for scales.
Result<CalibrationResult> identify_with_sessions(const CalibrationProblem& problem,
                                                 const CalibrateOptions& options) {
  Result<CalibrationResult> rigid = identify(problem, options);
  if (!rigid || rigid->sessions.size() < 2 || !perhaps_stretched(*rigid, problem.batch))
    return rigid;
  CalibrationProblem with = problem;
  with.stretched = true;
  Result<CalibrationResult> stretched = identify(with, options);
  const double price = price_of_scales(rigid->sessions.size());
  return stretched && stretched->log_likelihood > rigid->log_likelihood + price ? stretched : rigid;
}

/// Places the anchors by the nominal arm. If known anchors determine the base, all gauges together
/// place base and anchors. The priors are centred there.
Status place_instruments(PhysicalModel& model, const MeasurementBatch& batch,
                         const CalibrateOptions& options) {
  if (!has_gauges(batch)) return {};
  TRY(locate_anchors(model, batch));
  const Eigen::Index base = place_of_base(model);
  if (base < 0 || has_positions(batch) || untold_motions(model, batch) > 0) return {};
  auto anywhere = std::make_shared<Cell>(*model.cell);
  anywhere->X_WB.reset();
  PhysicalModel frames = TRY(make_physical_model(anywhere, {"base", std::string(kAnchors)}));
  frames.X_WB = model.X_WB;
  frames.tools = model.tools;
  TRY(locate_anchors(frames, batch));
  CalibrateOptions free = options;
  free.held.clear();
  const CalibrationResult found = TRY(identify({frames, batch}, free));
  model.values.segment<6>(base) = found.model.values.segment<6>(place_of_base(found.model));
  return locate_anchors(model, batch);
}

/// Calibrates everything but the frames. The frames keep their places in the model.
Result<CalibrationResult> calibrate_placed(CalibrationProblem problem,
                                           const CalibrateOptions& options) {
  TRY(check_needs(problem));
  localise_base(problem.model, problem.batch);
  TRY(place_instruments(problem.model, problem.batch, options));
  TRY(search_orders(problem, options));
  return identify_with_sessions(problem, options);
}

/// Calibrates from a start at the model's base.
Result<CalibrationResult> calibrate_from(CalibrationProblem placed,
                                         const CalibrateOptions& options) {
  if (has_unknown_frame(*placed.model.cell)) {
    if (Status refined = refine_frames(placed.model, placed.batch, options); !refined)
      return Failure(refined.error()).in("batch " + placed.batch.id);
  }
  return calibrate_placed(std::move(placed), options);
}

/// Finds how the base is turned with the tool set free, and keeps the base alone. With a known
/// tool, positions at one place fit any turn of the base: only the difference between the real tool
/// and the drawn one shows the turn.
Status turn_by_free_tool(PhysicalModel& model, const MeasurementBatch& batch,
                         const CalibrateOptions& options) {
  PhysicalModel frames = TRY(make_physical_model(
      model.cell, {std::string(cause_correcting(causes::Part::kBase).spelling),
                   std::string(cause_correcting(causes::Part::kTool).spelling)}));
  const std::vector<Pose> bases = likely_bases(model, batch);
  double best = -std::numeric_limits<double>::infinity();
  for (const Pose& X_WB : bases) {
    frames.X_WB = X_WB;
    const auto found = identify({frames, positions_of(batch)}, options);
    if (!found || found->log_evidence <= best) continue;
    best = found->log_evidence;
    model.X_WB = found->model.state(batch.measurements.front().context).X_WB;
  }
  return {};
}

/// The most likely of the results that start from each likely base.
Result<CalibrationResult> calibrate_located(const CalibrationProblem& problem,
                                            const CalibrateOptions& options) {
  std::vector<Pose> bases = likely_bases(problem.model, problem.batch);
  if (bases.size() > 1 && !has_unknown_tool(*problem.model.cell)) {
    PhysicalModel turned = problem.model;
    TRY(turn_by_free_tool(turned, problem.batch, options));
    bases = {turned.X_WB};
  }
  std::optional<Result<CalibrationResult>> best;
  for (const Pose& X_WB : bases) {
    CalibrationProblem placed = problem;
    placed.model.X_WB = X_WB;
    Result<CalibrationResult> found = calibrate_from(std::move(placed), options);
    if (!best || (found && (!*best || found->log_evidence > (*best)->log_evidence)))
      best = std::move(found);
  }
  if (const std::string untold = untold_turn(*problem.model.cell, problem.batch);
      *best && !untold.empty())
    (*best)->unidentifiable.insert((*best)->unidentifiable.begin(),
                                   UnidentifiableCombination{0, turn_of_base(), untold});
  return std::move(*best);
}

/// The batch as if each session had been measured as `sessions` say; without sessions as it is.
MeasurementBatch moved_there(const CalibrationProblem& problem,
                             const std::vector<SessionSetting>& sessions) {
  const Tracker& tracker = problem.model.cell->tracker;
  return sessions.empty() ? problem.batch
                          : moved(problem.batch, sessions, tracker.sigma, tracker.sigma_rotation);
}

/// Composes into `found` the motions by which `sessions` had moved the batch before.
CalibrationResult told_of(CalibrationResult found, const std::vector<SessionSetting>& sessions) {
  for (std::size_t s = 0; s < sessions.size(); ++s)
    found.sessions[s].set_into_W(found.sessions[s].into_W() * sessions[s].into_W());
  return found;
}

/// In the world of the last session.
Result<CalibrationResult> calibrate_there(const CalibrationProblem& problem,
                                          const CalibrateOptions& options) {
  CalibrationProblem complete = problem;
  std::vector<SessionSetting> sessions;
  if (has_sessions(problem.batch)) {
    std::vector<SessionSetting> located = TRY(locate_sessions(problem.model, problem.batch));
    sessions = std::move(located);
    complete.batch = moved_there(problem, sessions);
  }
  if (has_unknown_frame(*problem.model.cell)) {
    if (Status located = locate_unknown_frames(complete.model, complete.batch); !located)
      return Failure(located.error()).in("batch " + problem.batch.id);
  }
  return calibrate_located(complete, options).map([&](CalibrationResult found) {
    return told_of(std::move(found), sessions);
  });
}

/// The session with the most poses, in any order of sessions. Of equal ones it is the first by
/// name.
std::size_t largest_session(const MeasurementBatch& batch) {
  const std::vector<SessionSetting> settings = settings_of(batch);
  const auto largest =
      std::min_element(settings.begin(), settings.end(), [](const auto& a, const auto& b) {
        return a.poses != b.poses ? a.poses > b.poses : a.id < b.id;
      });
  return static_cast<std::size_t>(largest - settings.begin());
}

/// The batch in which the last session and `session` have changed places.
MeasurementBatch exchanged(MeasurementBatch batch, std::size_t session) {
  const auto one = static_cast<int>(session);
  const auto last = static_cast<int>(batch.sessions.size()) - 1;
  std::swap(batch.sessions[session], batch.sessions.back());
  for (Measurement& m : batch.measurements) {
    if (m.session == one || m.session == last) m.session = one + last - m.session;
  }
  return batch;
}

/// Identifies again in the lengths of the newest session, from the values of `found`, which is in
/// the lengths of another session.
Result<CalibrationResult> calibrate_in_newest_lengths(const CalibrationResult& found,
                                                      const CalibrationProblem& problem,
                                                      const CalibrateOptions& options) {
  const double longer = 1 + found.sessions.back().scale;
  std::vector<SessionSetting> sessions = settings_of(problem.batch);
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    Similarity into_W = found.sessions[s].into_W();
    into_W.X.translation() /= longer;
    into_W.scale = (1 + into_W.scale) / longer - 1;
    sessions[s].set_into_W(into_W);
  }
  CalibrationProblem there = problem;
  there.batch = moved_there(problem, sessions);
  there.model.tools = found.model.tools;
  there.model.X_WB = found.model.X_WB;
  there.model.X_WB.translation() /= longer;
  return calibrate_placed(std::move(there), options).map([&](CalibrationResult again) {
    return told_of(std::move(again), sessions);
  });
}

/// Calibrates in the world of that session and expresses the result in the world of the newest.
Result<CalibrationResult> calibrate_by(std::size_t session, const CalibrationProblem& problem,
                                       const CalibrateOptions& options) {
  CalibrationProblem there = problem;
  there.batch = exchanged(problem.batch, session);
  Result<CalibrationResult> found =
      calibrate_there(there, options).map([&](CalibrationResult by_session) {
        std::swap(by_session.sessions[session], by_session.sessions.back());
        const Pose back = by_session.sessions.back().X_WS.inverse();
        for (SessionSetting& setting : by_session.sessions) setting.X_WS = back * setting.X_WS;
        by_session.sessions.back().X_WS = Pose::Identity();
        by_session.model.X_WB = back * by_session.model.X_WB;
        return by_session;
      });
  return found && found->sessions.back().scale != 0
             ? calibrate_in_newest_lengths(*found, problem, options)
             : std::move(found);
}

/// True if no parameter depends on the choice of the world frame, as the drift of an instrument
/// would.
bool is_of_the_robot(const PhysicalModel& model) {
  return std::all_of(model.sources.begin(), model.sources.end(), [](const ErrorSourcePtr& source) {
    return source->cause().scope != causes::Scope::kSession &&
           source->cause().scope != causes::Scope::kPose;
  });
}

}  // namespace

Result<CalibrationResult> calibrate(const CalibrationProblem& problem,
                                    const CalibrateOptions& options) {
  if (problem.batch.measurements.empty())
    return refused("no measurements to calibrate with")
        .in("batch " + problem.batch.id)
        .beyond(0, 1);
  TRY(check_gauges(problem.model, problem.batch));
  // No file states the base. The session with the most poses finds it, since the newest may have
  // few.
  if (has_sessions(problem.batch) && !problem.model.cell->X_WB && is_of_the_robot(problem.model))
    return calibrate_by(largest_session(problem.batch), problem, options);
  return calibrate_there(problem, options).map([&](CalibrationResult found) {
    if (has_gauges(problem.batch)) add_campaign_limits(problem.batch, found);
    return found;
  });
}

namespace {

/// Every combination of the forms that the causes in `specs` have.
std::vector<std::vector<std::string>> combinations(const std::vector<std::string>& specs,
                                                   const Cell& cell) {
  std::vector<std::vector<std::string>> all = {{}};
  for (const std::string& spec : specs) {
    std::vector<std::vector<std::string>> longer;
    for (const auto& one : all) {
      for (const std::string& form : alternatives(spec, cell)) {
        longer.push_back(one);
        longer.back().push_back(form);
      }
    }
    all = std::move(longer);
  }
  return all;
}

/// The most likely of the calibrations with the sources of each candidate.
Result<CalibrationResult> most_likely(const std::shared_ptr<const Cell>& cell,
                                      std::vector<std::vector<std::string>> candidates,
                                      const MeasurementBatch& batch,
                                      const CalibrateOptions& options) {
  Result<CalibrationResult> best = tl::make_unexpected(Error{});
  std::map<std::string, std::string>
      found;  // sources with searched values, and the values that the first form found
  for (std::vector<std::string>& candidate : candidates) {
    for (std::string& spec : candidate) {
      if (const auto order = found.find(spec); order != found.end()) spec = order->second;
    }
    PhysicalModel model = TRY(make_physical_model(cell, candidate));
    Result<CalibrationResult> result = calibrate({std::move(model), batch}, options);
    if (!result) return result;
    for (const auto& [name, spec] : found_orders(result->model)) found[name] = spec;
    if (!best || result->log_likelihood > best->log_likelihood) best = std::move(result);
  }
  return best;
}

/// Lists of sources with `added` in each of its forms beside the cause that shows it; the other
/// sources keep their found values.
std::vector<std::vector<std::string>> with_added(const CalibrationResult& without,
                                                 const CauseRecord& added) {
  const CauseRecord& beside = cause_spelled(added.added_by_data->beside);
  std::vector<std::vector<std::string>> candidates;
  for (const causes::Form& form : beside.forms) {
    std::vector<std::string>& names = candidates.emplace_back();
    for (const ErrorSourcePtr& source : without.model.sources)
      names.emplace_back(&source->cause() == &beside ? std::string(form.spelling) : source->name());
    names.emplace_back(added.spelling);
  }
  return candidates;
}

/// The causes that the data may add to `specs`. The list of sources must contain the source to
/// which the cause is an addition. The files must not state the cause, and the batch must be able
/// to show it.
std::vector<const CauseRecord*> may_be_added(const Cell& cell,
                                             const std::vector<std::string>& specs,
                                             const MeasurementBatch& batch) {
  const auto has = [&](std::string_view cause) {
    return std::find(specs.begin(), specs.end(), cause) != specs.end();
  };
  const bool shows_days = batch.sessions.size() >= kSessionsOfWarmth && shows_warmth(batch);
  std::vector<const CauseRecord*> records;
  for (const CauseRecord* record : all_causes()) {
    const auto& added = record->added_by_data;
    if (!added || !has(added->beside) || has(record->spelling) || added->is_known(cell)) continue;
    if (!record->needs.temperature || shows_days) records.push_back(record);
  }
  return records;
}

}  // namespace

namespace {

/// True if the effect of the temperature has the size and the sign that metal arms have. A smaller
/// effect is wear that went with the seasons, or an instrument.
bool is_of_metal(const CalibrationResult& with, const CauseRecord& added) {
  if (!added.needs.temperature) return true;
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : with.model.sources) {
    const Parameter& growth = source->parameters().front();
    if (&source->cause() == &added) return with.model.values(first) > kOfMetal * growth.prior_scale;
    first += static_cast<Eigen::Index>(source->parameters().size());
  }
  return false;
}

/// True if the data justify the added cause. If scales of the sessions are the alternative
/// explanation, the cause only has to be likelier than the scales at their price.
bool is_worth_adding(const CalibrationResult& without, const CalibrationResult& with) {
  if (!are_stretched(without.sessions) || are_stretched(with.sessions))
    return with.log_evidence > without.log_evidence + kWeighed;
  const double price = price_of_scales(without.sessions.size());
  return with.log_likelihood > without.log_likelihood - price + kInsteadOfScales;
}

/// Calibrates, adding the links' weights and the thermal growth if the data justify them.
Result<CalibrationResult> calibrate_weighed(const std::shared_ptr<const Cell>& cell,
                                            const std::vector<std::string>& specs,
                                            const MeasurementBatch& batch,
                                            const CalibrateOptions& options) {
  Result<CalibrationResult> best = most_likely(cell, combinations(specs, *cell), batch, options);
  if (!best || !options.weigh_links) return best;
  for (const CauseRecord* added : may_be_added(*cell, specs, batch)) {
    Result<CalibrationResult> with = most_likely(cell, with_added(*best, *added), batch, options);
    if (with && is_of_metal(*with, *added) && is_worth_adding(*best, *with)) best = std::move(with);
  }
  return best;
}

/// Calibrates with the instrument errors at zero and the other sources unchanged.
Result<CalibrationResult> calibrate_zeroed(const CalibrationResult& without,
                                           const MeasurementBatch& batch,
                                           const CalibrateOptions& options) {
  std::vector<std::string> names;
  for (const ErrorSourcePtr& source : without.model.sources) names.push_back(source->name());
  names.emplace_back(kInstrumentZero);
  return most_likely(without.model.cell, {names}, batch, options);
}

}  // namespace

Result<CalibrationResult> calibrate(const std::shared_ptr<const Cell>& cell,
                                    const std::vector<std::string>& specs,
                                    const MeasurementBatch& batch,
                                    const CalibrateOptions& options) {
  const std::vector<std::string> sources = TRY(with_instruments(specs, *cell, batch));
  Result<CalibrationResult> exact = calibrate_weighed(cell, sources, batch, options);
  const bool zeros_asked =
      std::find(sources.begin(), sources.end(), kInstrumentZero) != sources.end();
  if (!has_gauges(batch) || zeros_asked) return exact;
  std::vector<std::string> with_zeros = sources;
  with_zeros.emplace_back(kInstrumentZero);
  // Without a zero, a model fits no values that are far too long.
  Result<CalibrationResult> zeroed = exact ? calibrate_zeroed(*exact, batch, options)
                                           : calibrate_weighed(cell, with_zeros, batch, options);
  if (!zeroed || !exact) return zeroed ? zeroed : exact;
  const auto zeros = static_cast<double>(zeroed->parameters.size() - exact->parameters.size());
  const double price = kZeroed + kZeroedOfInstrument * zeros;
  return zeroed->log_likelihood > exact->log_likelihood + price ? zeroed : exact;
}

}  // namespace trammel
