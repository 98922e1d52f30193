#include "clients/cli/text/evaluation_text.h"

#include <algorithm>
#include <cmath>

#include "clients/cli/text/notes_text.h"
#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/compensate/budget/budget_words.h"
#include "server/compensate/model_notes.h"
#include "server/compensate/residual_structure.h"
#include "server/error_sources/cause_words.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/budget_json.h"
#include "server/report/figures_json.h"
#include "server/report/measured_json.h"
#include "server/report/note_json.h"
#include "server/report/session_changes_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

std::string figures_line(const char* level, const ErrorFigures& figures) {
  return fmt::format("  {:<12}{:>10.4f}{:>10.4f}{:>10.4f}{:>10.4f}\n", level, to_mm(figures.rms),
                     to_mm(figures.mean), to_mm(figures.p997), to_mm(figures.max));
}

std::string nlpd_line(const Evaluation& evaluation) {
  if (!evaluation.nlpd) return "";
  return fmt::format(
      "  {:.3f} nat: mean negative log predictive density of a coordinate, mm, compensated\n",
      nlpd_in_mm(*evaluation.nlpd));
}

std::string doubt_line(const Evaluation& evaluation) {
  const std::optional<std::string> doubt = doubt_of_bias(evaluation);
  return doubt ? "  " + *doubt + "\n" : "";
}

std::string orientation_lines(const std::optional<OrientationFigures>& orientation) {
  if (!orientation) return "";
  std::string text = fmt::format(
      "  orientation, deg rms of {} poses: nominal {:.4f}, calibrated {:.4f}, compensated {:.4f}",
      orientation->poses, to_deg(orientation->nominal), to_deg(orientation->calibrated),
      to_deg(orientation->compensated));
  if (orientation->coverage_95)
    text += fmt::format("; {:.1f} % of rotations inside their 95 % interval",
                        100 * *orientation->coverage_95);
  return text + "\n";
}

/// The line for a coverage that differs from that of a model as good as its instrument.
std::string stated_coverage_line(std::optional<double> share) {
  constexpr double kFar = 0.5;  // a model with 1.5 times the instrument's error has a coverage of
                                // 0.83
  if (!share || *share >= kFar) return "";
  return fmt::format("  {:.1f} % are inside the 95 % interval of the stated sigma alone\n",
                     100 * *share);
}

std::string gauge_lines(const std::optional<GaugeFigures>& gauges) {
  if (!gauges) return "";
  const std::string text = fmt::format(
      "  distances and touches, mm rms of {} values (of the value, not of a position): nominal "
      "{:.4f}, calibrated {:.4f}, compensated {:.4f}, max {:.4f}; {} in domain; {:.1f} % inside "
      "their 95 % interval\n",
      gauges->rows, to_mm(gauges->nominal), to_mm(gauges->calibrated), to_mm(gauges->compensated),
      to_mm(gauges->max), gauges->in_domain, 100 * gauges->coverage_95);
  return text + stated_coverage_line(gauges->coverage_95_stated);
}

ordered_json gauges_json(const GaugeFigures& gauges) {
  const auto level = [](double rms) { return ordered_json{{"rms_mm", to_mm(rms)}}; };
  ordered_json json = {{"rows", gauges.rows},
                       {"rms_mm", to_mm(gauges.compensated)},
                       {"max_mm", to_mm(gauges.max)},
                       {"levels",
                        {{"nominal", level(gauges.nominal)},
                         {"calibrated", level(gauges.calibrated)},
                         {"compensated", level(gauges.compensated)}}},
                       {"coverage_95", gauges.coverage_95},
                       {"in_domain", gauges.in_domain}};
  if (gauges.coverage_95_stated) json["coverage_95_stated"] = *gauges.coverage_95_stated;
  return json;
}

ordered_json orientation_json(const OrientationFigures& orientation) {
  ordered_json json = {{"poses", orientation.poses}};
  const auto level = [](double rms) { return ordered_json{{"rms_deg", to_deg(rms)}}; };
  json["nominal"] = level(orientation.nominal);
  json["calibrated"] = level(orientation.calibrated);
  json["compensated"] = level(orientation.compensated);
  if (orientation.coverage_95) json["coverage_95"] = *orientation.coverage_95;
  return json;
}

}  // namespace

std::string evaluation_table(const Evaluation& evaluation) {
  if (evaluation.poses == 0 && evaluation.gauges) return gauge_lines(evaluation.gauges);
  return fmt::format("  {:<12}{:>10}{:>10}{:>10}{:>10}\n", "error, mm", "rms", "mean", "99.7 %",
                     "max") +
         figures_line("nominal", evaluation.nominal) +
         figures_line("calibrated", evaluation.calibrated) +
         figures_line("compensated", evaluation.compensated) +
         fmt::format(
             "  {} of {} poses in domain; {:.1f} % of coordinates inside their 95 % interval\n",
             evaluation.in_domain, evaluation.poses, 100 * evaluation.coverage_95) +
         stated_coverage_line(evaluation.coverage_95_stated) + nlpd_line(evaluation) +
         orientation_lines(evaluation.orientation) + gauge_lines(evaluation.gauges) +
         doubt_line(evaluation);
}

std::string residuals_csv(const MeasurementBatch& batch,
                          const CompensatedModel::LevelErrors& errors) {
  constexpr double kSuspect = 5.5;  // norm of 3 axes that 1 in 10^6 good poses exceeds
  std::string text =
      "pose_id,row,error_mm,ex_mm,ey_mm,ez_mm,sx_mm,sy_mm,sz_mm,zx,zy,zz,calibrated_mm,cx_mm,cy_mm,"
      "cz_mm,nominal_mm,in_domain,suspect\n";
  const auto rounded = [](double value) { return fmt::format("{:.6g}", value); };
  const auto three = [&](const Vector3& v) {
    return fmt::format("{},{},{}", rounded(v.x()), rounded(v.y()), rounded(v.z()));
  };
  for (Eigen::Index i = 0; i < errors.compensated.cols(); ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    const Vector3 e = errors.compensated.col(i);
    const Vector3 z = e.cwiseQuotient(Vector3(errors.stddev.col(i)));
    const Vector3 calibrated = errors.calibrated.col(i);
    text += fmt::format(
        "{},{},{},{},{},{},{},{},{},{},{}\n", csv_field(m.pose_id), m.row, rounded(to_mm(e.norm())),
        three(to_mm(1) * e), three(to_mm(1) * errors.stddev.col(i)), three(z),
        rounded(to_mm(calibrated.norm())), three(to_mm(1) * calibrated),
        rounded(to_mm(errors.nominal.col(i).norm())),
        errors.in_domain[static_cast<std::size_t>(i)] ? 1 : 0, z.norm() > kSuspect ? 1 : 0);
  }
  return text;
}

std::string gauge_residuals_csv(const MeasurementBatch& batch,
                                const CompensatedModel::GaugeErrors& errors) {
  constexpr double kSuspect = 4.89;  // of one number, exceeded by 1 in 10^6 good ones
  std::string text =
      "pose_id,row,anchor_id,value_mm,error_mm,s_mm,z,calibrated_mm,nominal_mm,in_domain,suspect\n";
  const auto rounded = [](double value) { return fmt::format("{:.6g}", value); };
  for (std::size_t i = 0; i < errors.rows.size(); ++i) {
    const Measurement& m = batch.measurements[errors.rows[i]];
    const auto at = static_cast<Eigen::Index>(i);
    const double z = errors.compensated(at) / errors.stddev(at);
    text += fmt::format("{},{},{},{:.6f},{},{},{},{},{},{},{}\n", csv_field(m.pose_id), m.row,
                        csv_field(m.gauge->anchor), to_mm(m.gauge->value),
                        rounded(to_mm(errors.compensated(at))), rounded(to_mm(errors.stddev(at))),
                        rounded(z), rounded(to_mm(errors.calibrated(at))),
                        rounded(to_mm(errors.nominal(at))), errors.in_domain[i] ? 1 : 0,
                        std::abs(z) > kSuspect ? 1 : 0);
  }
  return text;
}

std::string structure_note(const CompensatedModel& model, const MeasurementBatch& batch,
                           const CompensatedModel::LevelErrors& errors) {
  const auto structured = most_structured(residual_orders(model, batch, errors.calibrated));
  return structured ? in_words(*structured) : "";
}

ordered_json evaluation_json(const Evaluation& evaluation) {
  ordered_json json = {{"poses", evaluation.poses}};
  if (evaluation.gauges) json["gauges"] = gauges_json(*evaluation.gauges);
  if (evaluation.poses == 0 && evaluation.gauges)
    return json;  // figures of positions would be of nothing
  json.update(figures_json(evaluation.compensated));
  json["levels"] = {{"nominal", figures_json(evaluation.nominal)},
                    {"calibrated", figures_json(evaluation.calibrated)},
                    {"compensated", figures_json(evaluation.compensated)}};
  json["coverage_95"] = evaluation.coverage_95;
  if (evaluation.coverage_95_stated) json["coverage_95_stated"] = *evaluation.coverage_95_stated;
  json["in_domain"] = evaluation.in_domain;
  if (evaluation.nlpd) json["nlpd"] = nlpd_in_mm(*evaluation.nlpd);
  if (evaluation.orientation) json["orientation"] = orientation_json(*evaluation.orientation);
  if (const auto doubt = doubt_of_bias(evaluation)) json["doubt_of_bias"] = *doubt;
  return json;
}

namespace {

std::string rotation_text(const CompensatedModel::Parts& parts) {
  if (parts.rotation_bias) return "the bias corrects orientations too\n";
  if (!parts.bias || parts.oriented_poses == 0) return "";
  return fmt::format(
      "the bias corrects positions only: {} of its {} poses have an orientation, all must\n",
      parts.oriented_poses, parts.bias->q.rows());
}

std::string candidate_line(const BiasCandidate& c) {
  if (c.skipped)
    return fmt::format("  {:<34}{:>12}{:>12}{:>12}{:>14}  {}\n", c.kernel, "-", "-", "-", "-",
                       c.verdict);
  return fmt::format("  {:<34}{:>12.4f}{:>12.4f}{:>12.4f}{:>14.3f}  {}\n", c.kernel,
                     to_mm(c.leave_one_out_rms), to_mm(c.time_block_rms), to_mm(c.joint_block_rms),
                     nlpd_in_mm(c.leave_one_out_nlpd), c.verdict);
}

std::string choice_text(const BiasChoice& choice) {
  std::string text = choice.sentence + "\n";
  if (choice.candidates.empty()) return text;
  text += fmt::format("  {:<34}{:>12}{:>12}{:>12}{:>14}\n", "bias asked; missed, mm", "one by one",
                      "in time", "in space", "nlpd (mm)");
  for (const BiasCandidate& candidate : choice.candidates) text += candidate_line(candidate);
  return text +
         "  one by one, nlpd: each pose left out of the bias, not of the physics (so `none` is its "
         "residual); in time, in space: eighths left out of both\n";
}

std::string choice_text(const CauseChoice& choice) {
  std::string text = fmt::format(
      "error sources chosen by these poses: eighths left out in joint space are predicted to "
      "{:.4f} "
      "mm\n  {:<42}{:>10}{:>10}{:>10}  {}\n",
      to_mm(choice.held_out), "cause tried; left out, mm", "before", "after", "nat", "taken");
  std::vector<std::string> without_effect;
  for (const TriedCause& one : choice.tried) {
    if (one.not_shown()) {
      without_effect.push_back(causes_in_words(one.sources));
      continue;
    }
    text += fmt::format("  {:<42}{:>10.4f}{:>10.4f}{:>10.1f}  {}\n", causes_in_words(one.sources),
                        to_mm(one.held_out_before), to_mm(one.held_out_after), one.gain,
                        one.taken ? "yes" : "no: " + one.why);
  }
  if (!without_effect.empty())
    text += fmt::format("  not shown by these poses: {}\n", fmt::join(without_effect, ", "));
  return text;
}

ordered_json choice_json(const CauseChoice& choice) {
  ordered_json tried = ordered_json::array();
  for (const TriedCause& one : choice.tried)
    tried.push_back({{"sources", one.sources},
                     {"cause", causes_in_words(one.sources)},
                     {"held_out_before_mm", to_mm(one.held_out_before)},
                     {"held_out_after_mm", to_mm(one.held_out_after)},
                     {"gain_nat", one.gain},
                     {"freedom", one.freedom},
                     {"taken", one.taken},
                     {"why", one.why}});
  return {{"held_out_mm", to_mm(choice.held_out)}, {"tried", std::move(tried)}};
}

ordered_json choice_json(const BiasChoice& choice) {
  ordered_json candidates = ordered_json::array();
  for (const BiasCandidate& c : choice.candidates) {
    if (c.skipped) {
      candidates.push_back({{"kernel", c.kernel}, {"verdict", c.verdict}});
      continue;
    }
    candidates.push_back({{"kernel", c.kernel},
                          {"leave_one_out_rms_mm", to_mm(c.leave_one_out_rms)},
                          {"leave_one_out_nlpd", nlpd_in_mm(c.leave_one_out_nlpd)},
                          {"time_block_rms_mm", to_mm(c.time_block_rms)},
                          {"joint_block_rms_mm", to_mm(c.joint_block_rms)},
                          {"gain_mm2", to_mm(to_mm(c.gain))},
                          {"gain_stddev_mm2", to_mm(to_mm(c.gain_stddev))},
                          {"verdict", c.verdict}});
  }
  return {{"kernel", choice.kernel}, {"sentence", choice.sentence}, {"candidates", candidates}};
}

/// Play that came out negative, beyond its uncertainty.
std::string negative_play_text(const CompensatedModel::Parts& parts) {
  std::string text;
  std::size_t next = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    const std::size_t first = next;
    next += source->parameters().size();
    if (source->cause().search != causes::SearchFamily::kPlay || next > parts.parameters.size())
      continue;
    const IdentifiedParameter& play = parts.parameters[first];
    const double expanded = kExpanded * play.stddev;
    if (play.value + expanded >= 0) continue;
    text += fmt::format(
        "{} is {:.0f} urad (U {:.0f}), but play is positive by definition: joints read or measured "
        "before they stood still, a servo that overshoots or lags, or a dir{} column of the wrong "
        "sign?\n",
        play.parameter.name, 1e6 * play.value, 1e6 * expanded, source->joint() + 1);
  }
  return text;
}

std::string provenance_text(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  const ModelProvenance& provenance = parts.provenance;
  const auto identified = std::count_if(parts.parameters.begin(), parts.parameters.end(),
                                        [](const IdentifiedParameter& p) { return p.identified; });
  std::string text = fmt::format(
      "model {} of cell {}: error sources: {}; bias {}\ntrained on {} poses of batch {}; {} of {} "
      "parameters identified (rank {})\n",
      provenance.id, model.cell().name, level_in_words(provenance.level),
      parts.bias ? parts.bias->kernel : "none", provenance.training_poses, provenance.batch_id,
      identified, parts.parameters.size(), parts.rank);
  for (const RefitRecord& refit : provenance.refits) {
    text += fmt::format("{} identified anew on {} poses of batch {}, all else as in model {}\n",
                        causes_in_words(refit.sources), refit.poses, refit.batch_id, refit.model);
  }
  return text + "it rests on " + in_words(parts.measured, model.cell()) + "\n";
}

std::string unidentifiable_text(const std::vector<UnidentifiableCombination>& combinations) {
  if (combinations.empty()) return "";
  constexpr std::size_t kMostTold = 8;  // of the waves of maps there can be hundreds
  std::string text = "not identifiable from these poses:\n";
  for (std::size_t i = 0; i < std::min(kMostTold, combinations.size()); ++i)
    text += fmt::format("  {}\n", combinations[i].sentence);
  if (combinations.size() > kMostTold)
    text += fmt::format("  and {} more (--json lists them)\n", combinations.size() - kMostTold);
  return text;
}

std::string suspects_text(const std::vector<SuspectPose>& suspects) {
  if (suspects.empty()) return "";
  std::string text =
      "poses that do not fit the others (bounded in their pull; measure them again):\n";
  for (const SuspectPose& pose : suspects) {
    text += fmt::format("  pose {} (row {}): {:.3f} mm off, {:.0f} sigma\n", pose.pose_id, pose.row,
                        to_mm(pose.distance), pose.sigmas);
  }
  return text;
}

/// The error budget.
std::string budget_text(const ModelParts& parts) {
  if (!parts.budget) return "";
  std::string text;
  for (const std::string& line : in_words(*parts.budget))
    text += (text.empty() ? "" : "  ") + line + "\n";
  return text;
}

}  // namespace

std::string model_text(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  const std::vector<Note> notes = notes_of(model);
  std::string text =
      notes_text(grave(notes)) + provenance_text(model) + notes_text(for_information(notes));
  text += rotation_text(parts) + negative_play_text(parts);
  if (parts.cause_choice) text += choice_text(*parts.cause_choice);
  if (parts.bias_choice) text += choice_text(*parts.bias_choice);
  return text + budget_text(parts) + unidentifiable_text(parts.unidentifiable) +
         suspects_text(parts.suspects);
}

namespace {

/// From this correlation on the text names two parameters as correlated.
constexpr double kWorthTelling = 0.9;

/// Pairs of parameters whose estimates are correlated.
ordered_json correlations_json(const CompensatedModel::Parts& parts) {
  ordered_json pairs = ordered_json::array();
  for (std::size_t i = 0; i < parts.parameters.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const auto a = static_cast<Eigen::Index>(i);
      const auto b = static_cast<Eigen::Index>(j);
      const double correlation =
          parts.covariance(a, b) / std::sqrt(parts.covariance(a, a) * parts.covariance(b, b));
      if (std::abs(correlation) < kWorthTelling) continue;
      pairs.push_back(
          {{"parameters", {parts.parameters[j].parameter.name, parts.parameters[i].parameter.name}},
           {"correlation", correlation}});
    }
  }
  return pairs;
}

ordered_json parameters_json(const std::vector<IdentifiedParameter>& parameters) {
  ordered_json list = ordered_json::array();
  for (const IdentifiedParameter& identified : parameters) {
    const Parameter& parameter = identified.parameter;
    list.push_back({{"name", parameter.name},
                    {"unit", parameter.unit},
                    {"value", parameter.scale * identified.value},
                    {"u95", kExpanded * parameter.scale * identified.stddev},
                    {"identified", identified.identified}});
  }
  return list;
}

ordered_json sessions_json(const CompensatedModel::Parts& parts) {
  ordered_json list = ordered_json::array();
  for (const SessionSetting& session : parts.sessions) {
    list.push_back({{"session_id", session.id},
                    {"poses", session.poses},
                    {"first_pose_id", session.first_pose},
                    {"scale_ppm", 1e6 * session.scale},
                    {"own_noise_mm", to_mm(session.own_noise)},
                    {"own_noise_deg", to_deg(session.own_noise_rotation)}});
  }
  for (const LeftOutSession& session : parts.sessions_left_out)
    list.push_back({{"session_id", session.id}, {"left_out", session.why}});
  return list;
}

ordered_json unidentifiable_json(const std::vector<UnidentifiableCombination>& combinations) {
  ordered_json list = ordered_json::array();
  for (const UnidentifiableCombination& one : combinations) {
    list.push_back({{"parameters", one.parameters},
                    {"singular_value", one.singular_value},
                    {"sentence", one.sentence}});
  }
  return list;
}

ordered_json suspects_json(const std::vector<SuspectPose>& suspects) {
  ordered_json list = ordered_json::array();
  for (const SuspectPose& pose : suspects) {
    list.push_back({{"pose_id", pose.pose_id},
                    {"row", pose.row},
                    {"distance_mm", to_mm(pose.distance)},
                    {"sigmas", pose.sigmas}});
  }
  return list;
}

ordered_json refits_json(const std::vector<RefitRecord>& refits) {
  ordered_json list = ordered_json::array();
  for (const RefitRecord& refit : refits) {
    list.push_back({{"sources", refit.sources},
                    {"batch", refit.batch_id},
                    {"batch_hash", refit.batch_hash},
                    {"poses", refit.poses},
                    {"model", refit.model}});
  }
  return list;
}

ordered_json provenance_json(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  const ModelProvenance& provenance = parts.provenance;
  return {{"model", provenance.id},
          {"hash", provenance.hash},
          {"cell", model.cell().name},
          {"level", provenance.level},
          {"bias", parts.bias ? parts.bias->kernel : "none"},
          {"batch", provenance.batch_id},
          {"batch_hash", provenance.batch_hash},
          {"trained_at_unix_s", provenance.trained_at},
          {"measured_at_unix_s",
           provenance.measured_at ? ordered_json(*provenance.measured_at) : ordered_json(nullptr)},
          {"training_poses", provenance.training_poses},
          {"seed", provenance.seed}};
}

}  // namespace

ordered_json model_json(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  ordered_json json = provenance_json(model);
  json["rank"] = parts.rank;
  json["condition_number"] = parts.condition_number;
  json["observability_index"] = parts.observability_index;
  json["cost_record"] = parts.cost_record;
  json["suspect_poses"] = suspects_json(parts.suspects);
  json["correlations"] = correlations_json(parts);
  json["parameters"] = parameters_json(parts.parameters);
  json["not_identifiable"] = unidentifiable_json(parts.unidentifiable);
  json["measured"] = measured_json(model);
  json["training"] = evaluation_json(parts.training);
  json["budget"] = parts.budget ? budget_json(*parts.budget) : ordered_json(nullptr);
  json["notes"] = notes_json(notes_of(model));
  if (!parts.sessions.empty()) json["sessions"] = sessions_json(parts);
  if (!parts.sessions.empty())
    json["order_of_sessions"] = parts.sessions_as_given ? "as_given" : "by_time";
  if (!parts.sessions.empty())
    json["between_sessions"] = session_changes_json(session_changes(model));
  if (!parts.sessions.empty())
    json["changes"] = json["between_sessions"];  // the former name of this member
  if (!parts.provenance.refits.empty()) json["refits"] = refits_json(parts.provenance.refits);
  if (parts.rotation_bias) json["bias_of_orientation"] = true;
  if (parts.oriented_poses > 0) json["oriented_poses"] = parts.oriented_poses;
  if (parts.cause_choice) json["cause_choice"] = choice_json(*parts.cause_choice);
  if (parts.bias_choice) json["bias_choice"] = choice_json(*parts.bias_choice);
  if (parts.validation) json["validation"] = evaluation_json(*parts.validation);
  return json;
}

}  // namespace trammel::cli
