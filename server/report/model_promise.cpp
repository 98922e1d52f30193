#include "server/report/model_promise.h"

#include <algorithm>
#include <cmath>

#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/file_doubts.h"
#include "server/compensate/model_notes.h"
#include "server/health/health_check.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/repeats.h"
#include "server/report/cell_needs.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/robot/cell_papers.h"
#include "server/robot/cell_rules.h"
#include "server/robot/robot_confirmation.h"

namespace trammel {

namespace {

constexpr int kFewestToPromise =
    10;  // fresh poses: with fewer, the statement gives the number of test poses
/// Degrees of freedom of the residuals. With fewer, their rms may be wrong by half or more (1 /
/// sqrt(2 k) is 22 % of it at 10), and nothing else shows the model's error.
constexpr double kFewestFreedom = 10;
constexpr int kFewestRepeats = 6;  // degrees of freedom
/// RP of ISO 9283 is the mean distance from the barycentre plus three of its standard deviations.
/// That is 3.615 standard deviations of an axis if the three axes are equal and normal.
constexpr double kRepeatability = 3.615;

std::string check_by(const NextCheck& next) {
  if (next.verdict == "changed")
    return "its last check says that the robot has changed since: measure it anew";
  if (next.due.empty()) return "when it was measured is not known, so check before use";
  return fmt::format("check again by {}{}", next.due, next.passed ? ", a day that has passed" : "");
}

/// The sentence for a check that is overdue; empty if it is not.
std::string overdue(const NextCheck& next) {
  if (!next.passed) return "";
  return fmt::format(
      "<p class=\"warning\">That day had passed when this page was written, on {}: check the robot "
      "before you rely on it.</p>\n",
      shown_day(unix_now()));
}

/// What the next check's date rests on.
std::string basis_of(const NextCheck& next) {
  return next.verdict.empty()
             ? fmt::format(
                   "That they hold for {} days is an assumption, until a check (<code>trammel "
                   "check</code>) tells how fast this robot changes.",
                   kUsualInterval / 86400)
             : "The day of the next check is that of the last one (" +
                   html_text(next.verdict == "cannot_tell" ? "cannot tell" : next.verdict) + ").";
}

std::string or_not_told(const std::string& text) {
  return text.empty() ? "not in the cell file" : text;
}

std::string joint_ranges(const CompensatedModel& model) {
  const ModelParts& parts = model.parts();
  std::string text;
  for (int j = 0; j < model.cell().robot.size(); ++j) {
    const JointType type = model.cell().robot.joint(j).type;
    text +=
        fmt::format("{}q{}\u00a0{:.1f}\u00a0to\u00a0{:.1f}\u00a0{}", j == 0 ? "" : ", ", j + 1,
                    joint_to_column(parts.q_min(j), type), joint_to_column(parts.q_max(j), type),
                    type == JointType::kRevolute ? "deg" : "mm");
  }
  return text;
}

std::string tools(const ModelParts& parts) {
  std::string text;
  for (const auto& [tool, payload] : parts.trained_with)
    text += (text.empty() ? "" : ", ") + tool + (payload.empty() ? "" : " with payload " + payload);
  return text;
}

std::string judged_by(const std::optional<PositionAccuracy>& accuracy) {
  if (!accuracy) return "nothing";
  return accuracy->judged_by() > 0
             ? fmt::format("{} pose{} that {} not trained on", accuracy->judged_by(),
                           accuracy->judged_by() == 1 ? "" : "s",
                           accuracy->judged_by() == 1 ? "was" : "were")
             : "the scatter of its own training poses; none was held out, so it is believed, not "
               "tested";
}

/// `1ee9e442-3fa1c07b`: of the model and of what is certified of it, so that two pages with one
/// number say the same.
std::string certificate_number(const CompensatedModel& model, const std::string& certified) {
  return fmt::format("{:.8}-{:.8}", model.provenance().hash,
                     sha256_hex(model.provenance().hash + "\n" + certified));
}

std::string papers_table(const CompensatedModel& model,
                         const std::optional<PositionAccuracy>& accuracy,
                         const std::string& number) {
  const CellPapers papers = papers_of(model.cell()).value_or(CellPapers{});
  const ModelProvenance& made = model.provenance();
  const MeasuredWords measured = words_of(model.parts().measured, model.cell());
  std::vector<HtmlRow> rows;
  const auto add = [&](const char* name, const std::string& value) {
    rows.push_back({{name, html_text(value)}});
  };
  add("certificate", number);
  add("robot", model.cell().robot.name());
  add("serial number", or_not_told(papers.serial_number));
  add("cell", model.cell().name);
  const auto confirmed = confirmation_of(model.cell());
  add("robot file", confirmed
                        ? fmt::format("compared with {} poses of the controller on {}: {:.3f} mm "
                                      "and {:.3f} deg at the most",
                                      confirmed->poses, confirmed->day, confirmed->position_mm,
                                      confirmed->orientation_deg)
                        : std::string("not compared with the controller (trammel confirm-robot)"));
  add("tool", tools(model.parts()));
  add("instrument", measured.instrument);
  add("instrument's certificate", or_not_told(papers.instrument_certificate));
  add("operator", or_not_told(papers.operator_name));
  // A batch without times has the date of its file, and the model does not distinguish the two.
  add("measured", made.measured_at
                      ? shown_day(*made.measured_at) + " (by time_s, else the date of the file)"
                      : std::string("not recorded"));
  add("model", fmt::format("{}, trained {} on {} poses of {}", made.id, shown_day(made.trained_at),
                           made.training_poses, made.batch_id));
  add("this volume", measured.volume);
  add("joints", joint_ranges(model));
  add("sides of approach", measured.sides);
  add("temperature", measured.temperature);
  add("judged by", judged_by(accuracy));
  return html_table({"provenance", {}, rows});
}

std::string repeatability(const std::optional<MeasurementBatch>& batch, double sigma) {
  if (!batch) return "not measured";
  const RepeatStatistics repeats = merge_repeats(*batch, sigma).statistics;
  if (repeats.degrees_of_freedom < kFewestRepeats) return "not measured";
  return fmt::format("{} mm, instrument included ({} measurements of {} poses)",
                     rounded_up_mm(kRepeatability * repeats.sigma), repeats.measurements,
                     repeats.groups);
}

std::string iso_table(const CompensatedModel& model, const PositionAccuracy& accuracy,
                      const std::optional<MeasurementBatch>& batch) {
  std::vector<HtmlRow> rows;
  rows.push_back(
      {{"positioning accuracy AP", rounded_up_mm(accuracy.at(PositionAccuracy::kShare)) + " mm",
        fmt::format("95 % of positions; between {} and {} mm, as few poses judged it and the "
                    "instrument is known to 10 %",
                    rounded_up_mm(accuracy.least()), rounded_up_mm(accuracy.most()))}});
  rows.push_back(
      {{"distance accuracy AD", "at most " + rounded_up_mm(accuracy.of_distances()) + " mm",
        "95 % of distances between two positions"}});
  rows.push_back({{"repeatability RP", repeatability(batch, model.cell().tracker.sigma),
                   "from repeats of a pose only"}});
  if (const auto& held_out = model.parts().validation; held_out && held_out->orientation)
    rows.push_back({{"orientation accuracy",
                     fmt::format("{:.4f} deg", to_deg(held_out->orientation->compensated)),
                     fmt::format("rms of {} poses held out, instrument included",
                                 held_out->orientation->poses)}});
  return html_table({"iso", {"as ISO 9283 names it", "value", "of what"}, rows});
}

/// Says whether a tolerance is met; yes or no only if the whole interval of the accuracy agrees.
std::string held(const PositionAccuracy& accuracy, double tolerance) {
  if (accuracy.most() <= tolerance) return "yes";
  return accuracy.least() <= tolerance ? "cannot tell" : "no";
}

/// Rounded down, and never 100 %, since nobody knows that.
std::string share_text(double share) {
  const double percent = 100 * std::floor(1000 * share) / 1000;
  return percent > 99.9 ? "over 99.9 %" : fmt::format("{:.1f} %", percent);
}

std::string tolerance_table(const PositionAccuracy& accuracy,
                            const std::optional<double>& of_cell) {
  std::vector<double> tolerances = {0.05e-3, 0.1e-3, 0.2e-3, 0.5e-3, 1e-3};
  if (of_cell) tolerances.push_back(*of_cell);
  std::sort(tolerances.begin(), tolerances.end());
  tolerances.erase(std::unique(tolerances.begin(), tolerances.end()), tolerances.end());
  std::vector<HtmlRow> rows;
  for (const double tolerance : tolerances) {
    const bool asked = of_cell && tolerance == *of_cell;
    rows.push_back({{fmt::format("{:.4g} mm{}", to_mm(tolerance), asked ? " (the cell's)" : ""),
                     held(accuracy, tolerance), share_text(accuracy.within(tolerance))},
                    asked ? "asked" : ""});
  }
  return html_table({"tolerances",
                     {"may I ask for", "at 95 % of positions?", "positions that near the target"},
                     rows});
}

std::string tolerance_sentence(const PositionAccuracy& accuracy,
                               const std::optional<double>& of_cell) {
  if (!of_cell) return "";
  const double promised = accuracy.at(PositionAccuracy::kShare);
  return fmt::format(
      "<p class=\"against\">The cell must hold {:.4g} mm: <b>{}</b> ({} mm at 95 %, between {} and "
      "{}).</p>\n",
      to_mm(*of_cell), held(accuracy, *of_cell), rounded_up_mm(promised),
      rounded_up_mm(accuracy.least()), rounded_up_mm(accuracy.most()));
}

/// States the basis of the accuracy if it is weak; the text follows "in this volume".
std::string hardly_judged(const PositionAccuracy& accuracy) {
  if (accuracy.judged_by() >= kFewestToPromise) return "";
  if (accuracy.judged_by() == 0) return ", by its training poses alone";
  return fmt::format(", tested by {} fresh pose{} only", accuracy.judged_by(),
                     accuracy.judged_by() == 1 ? "" : "s");
}

/// States the side from which poses must come, if all were measured from one; the text follows "in
/// this volume".
std::string from_that_side(const ModelParts& parts) {
  const std::string side = one_sided(parts.measured);
  return side.empty() ? "" : ", for poses that the arm comes to " + side;
}

/// The number of parameters that the measurements determine: P - tr(prior^-1 posterior) (MacKay,
/// Bayesian Interpolation, 1992), and where the instrument stood in each further session.
double determined(const ModelParts& parts) {
  double sum = parts.sessions.empty() ? 0 : 6 * (static_cast<double>(parts.sessions.size()) - 1);
  for (const IdentifiedParameter& one : parts.parameters)
    sum += 1 - std::min(1.0, std::pow(one.stddev / one.parameter.prior_scale, 2));
  return sum;
}

/// Degrees of freedom: the coordinates of the training positions (and distances), less their share
/// of the parameters that they and the orientations determined; plus three for every pose that was
/// not trained on.
double freedom_left(const CompensatedModel& model, const PositionAccuracy& accuracy) {
  const ModelParts& parts = model.parts();
  const double gauges = parts.training.gauges ? parts.training.gauges->rows : 0;
  const double positions =
      std::max<double>(parts.training.poses, parts.provenance.training_poses - gauges);
  const double told = 3 * positions + gauges;
  const bool oriented = parts.training.orientation && parts.oriented_poses == 0;
  const double all = told + (oriented ? 3 * parts.training.orientation->poses : 0);
  const double left = all > 0 ? told * std::max(0.0, 1 - determined(parts) / all) : 0;
  return left + 3 * accuracy.judged_by();
}

}  // namespace

std::optional<std::string> why_no_promise(const CompensatedModel& model,
                                          const std::optional<PositionAccuracy>& accuracy,
                                          const std::optional<MeasurementBatch>& batch) {
  if (batch) {
    if (const auto foreign = foreign_poses(model, *batch))
      return "Nothing can be promised by these measurements: " + *foreign;
  }
  if (const auto stop = stop_of(model); stop && stop->code == kOffDrawing)
    return "Nothing is promised of corrected poses: " + stop->text + ".";
  if (!accuracy || freedom_left(model, *accuracy) >= kFewestFreedom) return std::nullopt;
  const int poses = model.provenance().training_poses;
  return fmt::format(
      "How good this model is cannot be said from so few poses: it was trained on {} for {} "
      "parameters, and {}. Measure more (trammel plan chooses the poses), train again, and give "
      "trammel report --batch at least {} that were not trained on.",
      poses, model.parts().parameters.size(),
      accuracy->judged_by() == 0
          ? std::string("none was held out")
          : fmt::format("{} that {} not trained on are too few", accuracy->judged_by(),
                        accuracy->judged_by() == 1 ? "was" : "were"),
      kFewestToPromise);
}

std::string rounded_up_mm(double length) {
  const double mm = to_mm(length);
  if (!(mm > 0)) return "0.0001";
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(mm))), 0, 4);
  const double step = std::pow(10, -decimals);
  return fmt::format("{:.{}f}", std::ceil(mm / step - 1e-9) * step, decimals);
}

std::string promise_sentence(const CompensatedModel& model,
                             const std::optional<PositionAccuracy>& accuracy,
                             const NextCheck& next) {
  if (!accuracy)
    return "How good this model is cannot be said: it knows no pose that this cell can ask for.";
  return fmt::format("Good to {} mm at 95 % in this volume{}{}; not known beyond; {}.",
                     rounded_up_mm(accuracy->at(PositionAccuracy::kShare)),
                     from_that_side(model.parts()), hardly_judged(*accuracy), check_by(next));
}

std::string volume_table(const CompensatedModel& model, const nlohmann::ordered_json& scene) {
  const auto span = [](const Vector3& lower, const Vector3& upper) {
    std::string text;
    for (int k = 0; k < 3; ++k)
      text += fmt::format("{}{}\u00a0{:.0f}\u00a0to\u00a0{:.0f}", k == 0 ? "" : ", ", "xyz"[k],
                          lower(k), upper(k));
    return text + " mm";
  };
  const auto corner = [](const nlohmann::ordered_json& p) {
    return Vector3(p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>());
  };
  std::vector<HtmlRow> rows;
  if (const auto& measured = model.parts().measured) {
    const Vector3 sides = measured->upper - measured->lower;
    rows.push_back(
        {{"measured (green)", span(to_mm(1) * measured->lower, to_mm(1) * measured->upper),
          fmt::format("{:.3g} m³", sides.prod()),
          fmt::format("the box that the tool was in at {} poses", measured->poses)}});
  }
  if (scene.is_object() && scene.contains("promised")) {
    const auto& promised = scene["promised"];
    rows.push_back(
        {{"promised (blue)", span(corner(promised.at("lower")), corner(promised.at("upper"))),
          fmt::format("{:.3g} m³", promised.at("volume_m3").get<double>()),
          fmt::format("inside the rings, up to {:.0f} mm from the first axis; trammel "
                      "correct says of each target whether it is",
                      promised.at("radius_mm").get<double>())}});
  }
  if (rows.empty()) return "<p>Not on record.</p>\n";
  return html_table(
             {"volumes flows", {"volume", "of the tool, in the robot's base", "size", ""}, rows}) +
         "\n";
}

std::string certificate(const CompensatedModel& model,
                        const std::optional<PositionAccuracy>& accuracy,
                        const std::optional<MeasurementBatch>& batch, const NextCheck& next) {
  // A day that passes changes nothing of what is certified.
  const std::string number = certificate_number(
      model, promise_sentence(model, accuracy, {next.due, false, next.verdict, next.why}) +
                 (batch ? batch->id : ""));
  const std::string papers = papers_table(model, accuracy, number);
  const std::string about = "<p class=\"about\">It rests on " +
                            html_text(in_words(model.parts().measured, model.cell())) + ".</p>\n";
  if (!accuracy) return about + papers;
  const std::string late = overdue(next);
  const std::optional<double> tolerance = rules_of(model.cell()).value_or(CellRules{}).tolerance;
  return about + late + tolerance_sentence(*accuracy, tolerance) +
         tolerance_table(*accuracy, tolerance) +
         "\n<p>Distances are from the wanted position (half of a true position's diameter). This "
         "holds in the volume and with the tool and payload named below, for targets that "
         "<code>trammel correct</code> has corrected; it says of each target whether it is inside "
         "that volume and what error to expect. Not counted: how well the part is located, forces "
         "of the process, wear of the tool, and a robot that has changed since.</p>\n<h3>In "
         "numbers</h3>\n" +
         iso_table(model, *accuracy, batch) + "\n<h3>Of what</h3>\n" + papers +
         fmt::format(
             "\n<p class=\"note\">The figures are of the tool's true position after correction by "
             "this model, at any fresh pose of the volume, not at ISO's five poses; the "
             "instrument's noise is taken out. {} A lasting error of up to {} mm an axis would not "
             "show, as nobody knows the instrument's sigma "
             "better than to 10 %.</p>\n",
             basis_of(next), rounded_up_mm(accuracy->hidden()));
}

}  // namespace trammel
