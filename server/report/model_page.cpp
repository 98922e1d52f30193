#include "server/report/model_page.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_notes.h"
#include "server/error_sources/cause_words.h"
#include "server/measurement/pose_columns.h"
#include "server/report/budget_page.h"
#include "server/report/cell_needs.h"
#include "server/report/embedded.h"
#include "server/report/html.h"
#include "server/report/model_parameters.h"
#include "server/report/model_poses.h"
#include "server/report/model_promise.h"
#include "server/report/model_scene.h"
#include "server/report/page_parts.h"
#include "server/report/pages_beside.h"
#include "server/report/session_changes_json.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

/// The models and batches that the page compares the model with.
struct Compared {
  Evaluation evaluation;
  std::string text;  ///< the poses that it is about
};

/// Rows that were compared, with a position or without.
int rows_of(const Evaluation& evaluation) {
  return evaluation.poses + (evaluation.gauges ? evaluation.gauges->rows : 0);
}

Compared compared_with(const CompensatedModel& model,
                       const std::optional<MeasurementBatch>& batch) {
  const CompensatedModel::Parts& parts = model.parts();
  if (batch) {
    Evaluation evaluation = model.evaluate(*batch);
    return {evaluation,
            fmt::format("On the {} poses of batch {}.", rows_of(evaluation), batch->id)};
  }
  if (parts.validation) {
    return {*parts.validation,
            fmt::format("On {} poses of batch {} that were held out from training.",
                        rows_of(*parts.validation), parts.provenance.figures_batch_id())};
  }
  return {parts.training,
          fmt::format("On the {} poses of batch {} that the model was trained on: the compensated "
                      "error is smaller here than on new poses.",
                      rows_of(parts.training), parts.provenance.figures_batch_id())};
}

std::array<std::pair<const char*, const ErrorFigures*>, 3> levels_of(const Evaluation& evaluation) {
  return {{{"nominal", &evaluation.nominal},
           {"calibrated", &evaluation.calibrated},
           {"compensated", &evaluation.compensated}}};
}

/// A gain that is doubtful is not shown as a gain.
bool is_doubtful(const Evaluation& evaluation) { return doubt_of_bias(evaluation).has_value(); }

/// The tiles of distances and touches: their values, where no position was measured.
std::string gauge_tiles(const GaugeFigures& gauges) {
  std::string html;
  for (const auto& [level, rms] :
       {std::pair("nominal", gauges.nominal), std::pair("calibrated", gauges.calibrated),
        std::pair("compensated", gauges.compensated)}) {
    html += fmt::format(
        R"(<div class="tile {0}"><b>{1:.3f} mm</b><span>{0}, rms of distances</span></div>)", level,
        to_mm(rms));
  }
  return html;
}

std::string tiles(const Evaluation& evaluation) {
  if (evaluation.poses == 0 && evaluation.gauges) return gauge_tiles(*evaluation.gauges);
  std::string html;
  for (const auto& [level, figures] : levels_of(evaluation)) {
    const bool doubtful = figures == &evaluation.compensated && is_doubtful(evaluation);
    html += fmt::format(R"(<div class="tile {0}"><b>{2:.3f} mm</b><span>{1}, rms</span></div>)",
                        doubtful ? "doubtful" : level, level, to_mm(figures->rms));
  }
  return html;
}

std::string warnings(const CompensatedModel& model, const Evaluation& evaluation) {
  std::string html;
  for (const Note& note : warnings_of(model, evaluation)) {
    std::string one = note.text;
    one.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(one.front())));
    html += "<p class=\"warning\">" + html_text(one) + ".</p>\n";
  }
  return html;
}

std::string figures_table(const Evaluation& evaluation) {
  if (evaluation.poses == 0) return "";
  std::vector<HtmlRow> rows;
  for (const auto& [level, figures] : levels_of(evaluation)) {
    std::vector<std::string> cells = {level};
    for (const double value : {figures->rms, figures->mean, figures->p997, figures->max})
      cells.push_back(fmt::format("{:.4f}", to_mm(value)));
    rows.push_back({cells});
  }
  return html_table(
             {"figures", {"length of the error, mm", "rms", "mean", "99.7 %", "largest"}, rows}) +
         "\n";
}

std::string axes_table(const Evaluation& evaluation) {
  if (evaluation.poses == 0) return "";
  std::vector<HtmlRow> rows;
  for (const auto& [level, figures] : levels_of(evaluation)) {
    std::vector<std::string> along = {level};
    for (int k = 0; k < 3; ++k)
      along.push_back(fmt::format("{:.4f} ± {:.4f}", to_mm(figures->axis_mean(k)),
                                  to_mm(figures->axis_stddev(k))));
    rows.push_back({along});
  }
  return html_table(
             {"figures axes flows",
              {"along the base's axes, mm", "x: mean ± std", "y: mean ± std", "z: mean ± std"},
              rows}) +
         "\n";
}

std::string orientation_table(const Evaluation& evaluation) {
  if (!evaluation.orientation) return "";
  const OrientationFigures& turned = *evaluation.orientation;
  const auto degrees = [](double angle) { return fmt::format("{:.4f}", to_deg(angle)); };
  std::vector<std::string> names = {fmt::format("orientation, deg rms of {} poses", turned.poses),
                                    "nominal", "calibrated", "compensated"};
  std::vector<std::string> cells = {"angle between measured and predicted, deg",
                                    degrees(turned.nominal), degrees(turned.calibrated),
                                    degrees(turned.compensated)};
  if (turned.coverage_95) {
    names.emplace_back("inside their 95 % interval");
    cells.push_back(fmt::format("{:.1f} %", 100 * *turned.coverage_95));
  }
  return html_table({"figures orientation flows", names, {{cells}}}) + "\n";
}

std::string date_of(std::int64_t unix_time) {
  const std::time_t time = unix_time;
  std::tm utc{};
  ::gmtime_r(&time, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S UTC", &utc);
  return text.data();
}

std::string bias_text(const CompensatedModel::Parts& parts) {
  const std::string chosen = parts.bias_choice ? "; chosen: " + parts.bias_choice->sentence : "";
  if (!parts.bias) return "none" + chosen;
  return fmt::format("Gaussian process on the joints, kernel {}, {} observations, {}{}",
                     parts.bias->kernel, parts.bias->q.rows(),
                     parts.rotation_bias ? "positions and orientations" : "positions only", chosen);
}

std::string trained_ranges(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  std::string text;
  for (int j = 0; j < model.cell().robot.size(); ++j) {
    const JointType type = model.cell().robot.joint(j).type;
    text +=
        fmt::format("{}q{}\u00a0{:.1f}\u00a0…\u00a0{:.1f}\u00a0{}", j == 0 ? "" : " · ", j + 1,
                    joint_to_column(parts.q_min(j), type), joint_to_column(parts.q_max(j), type),
                    type == JointType::kRevolute ? "deg" : "mm");
  }
  return text;
}

std::string refit_text(const RefitRecord& refit) {
  return fmt::format("{} on {} poses of batch {}; all else is that of model {}",
                     causes_in_words(refit.sources), refit.poses, refit.batch_id, refit.model);
}

std::string provenance_rows(const CompensatedModel& model, const Evaluation& evaluation) {
  const CompensatedModel::Parts& parts = model.parts();
  const ModelProvenance& provenance = parts.provenance;
  std::vector<HtmlRow> rows;
  const auto add = [&](const std::string& name, const std::string& value) {
    rows.push_back({{name, html_text(value)}});
  };
  add("model", provenance.id);
  add("hash (SHA-256)", provenance.hash);
  add("robot", model.cell().robot.name());
  add("error sources",
      provenance.level.empty() ? "none (nominal)" : level_in_words(provenance.level));
  add("learned bias", bias_text(parts));
  add("batch", provenance.batch_id);
  add("batch hash (SHA-256)", provenance.batch_hash);
  add("newest measurement",
      provenance.measured_at ? date_of(*provenance.measured_at) : "not recorded");
  add("trained",
      fmt::format("{}, {} poses, seed {}, trammel {}", date_of(provenance.trained_at),
                  provenance.training_poses, provenance.seed, provenance.program_version));
  for (const RefitRecord& refit : provenance.refits) add("identified anew", refit_text(refit));
  add("joints of the training", trained_ranges(model));
  if (evaluation.poses > 0) {
    add("compared poses in domain",
        fmt::format("{} of {}", evaluation.in_domain, evaluation.poses));
    add("inside their 95 % interval",
        fmt::format("{:.1f} % of coordinates", 100 * evaluation.coverage_95));
    if (const auto stated = evaluation.coverage_95_stated)
      add("inside that of the stated sigma alone",
          fmt::format("{:.1f} % of coordinates", 100 * *stated));
  }
  if (const auto& gauges = evaluation.gauges) {
    add("distances and touches",
        fmt::format(
            "{}: {:.4f} mm rms of the value, {:.1f} % inside their 95 % interval, {} in domain",
            gauges->rows, to_mm(gauges->compensated), 100 * gauges->coverage_95,
            gauges->in_domain));
  }
  add("negative log predictive density",
      evaluation.nlpd ? fmt::format("{:.3f} nat a coordinate, mm", nlpd_in_mm(*evaluation.nlpd))
                      : "-");
  add("left over beyond the tracker's sigma",
      fmt::format("{:.4f} mm per axis, calibrated", to_mm(parts.discrepancy)));
  return html_rows(rows);
}

std::string suspects_text(const CompensatedModel::Parts& parts) {
  if (parts.suspects.empty()) return "<p>None: every pose fits the others.</p>\n";
  std::vector<HtmlRow> rows;
  for (const SuspectPose& pose : parts.suspects) {
    rows.push_back(
        {{html_text(pose.pose_id), fmt::format("{}", pose.row),
          fmt::format("{:.3f}", to_mm(pose.distance)), fmt::format("{:.0f}", pose.sigmas)}});
  }
  return "<p>These fit the others so badly that their pull was bounded. Measure them again.</p>\n" +
         html_table({"", {"pose", "row", "off by, mm", "sigma"}, rows}) + "\n";
}

/// The section on causes that the measurements chose; empty if none were chosen.
std::string chosen_causes(const CompensatedModel::Parts& parts) {
  if (!parts.cause_choice) return "";
  std::vector<HtmlRow> rows;
  std::vector<std::string> not_shown;
  for (const TriedCause& one : parts.cause_choice->tried) {
    if (one.not_shown())
      not_shown.push_back(causes_in_words(one.sources));
    else
      rows.push_back({{html_text(causes_in_words(one.sources)),
                       fmt::format("{:.4f}", to_mm(one.held_out_before)),
                       fmt::format("{:.4f}", to_mm(one.held_out_after)),
                       html_text((one.taken ? "taken: " : "not taken: ") + one.why)}});
  }
  const std::string others =
      not_shown.empty()
          ? ""
          : fmt::format("<p class=\"note\">Tried, and not shown by these poses: {}.</p>\n",
                        html_text(fmt::format("{}", fmt::join(not_shown, ", "))));
  return fmt::format(
             "<p>The measurements chose the error sources. Each cause was tried beside those above "
             "it that were taken. The columns tell how far poses are missed that were left out, an "
             "eighth of joint space at a time; with all that was taken it is {:.4f} mm.</p>\n",
             to_mm(parts.cause_choice->held_out)) +
         html_table({"flows", {"cause", "before, mm rms", "after, mm rms", "taken"}, rows}) + "\n" +
         others;
}

/// The data of the charts.
ordered_json chart_data(const Evaluation& evaluation, const ShownPoses& shown,
                        const ordered_json& scene, const std::optional<LearningCurve>& curve) {
  ordered_json data;
  if (is_doubtful(evaluation)) data["doubtful"] = true;
  data["levels"] = ordered_json::object();
  for (const auto& [level, figures] : levels_of(evaluation)) {
    if (evaluation.poses == 0) break;
    data["levels"][level] = {to_mm(figures->rms), to_mm(figures->mean), to_mm(figures->p997),
                             to_mm(figures->max)};
  }
  const auto put = [&](const char* key, const ordered_json& value) {
    if (!value.is_null()) data[key] = value;
  };
  put("histogram", histogram_json(shown));
  put("coverage", coverage_json(shown));
  put("scene", scene);
  if (curve) {
    std::vector<double> error_mm;
    for (const double error : curve->error) error_mm.push_back(to_mm(error));
    data["learning"] = {{"what", curve->what}, {"poses", curve->poses}, {"error_mm", error_mm}};
  }
  return data;
}

/// The note in place of the compensated level where nothing was learned.
std::string bias_note(const CompensatedModel::Parts& parts) {
  if (parts.bias) return "";
  const std::string why =
      parts.bias_choice ? parts.bias_choice->sentence : "the cell asks for none";
  return " No bias is learned, so calibrated and compensated are the same: " + why + ".";
}

/// Explains the three levels, and why their errors exceed the stated accuracy.
std::string reading_note(const CompensatedModel& model) {
  return fmt::format(
      " Nominal: the robot as drawn; calibrated: with the parameters that were identified; "
      "compensated: with the learned bias, too. The instrument's own noise, {:.4f} mm rms as "
      "stated, is in these errors; in what is promised above it is not.",
      to_mm(std::sqrt(3.0) * model.cell().tracker.sigma));
}

std::string learning_text(const std::optional<LearningCurve>& curve) {
  return curve ? "<p>" + html_text(curve->sentence) + "</p>"
               : "<p>Not known: there are too few poses to leave some out, or too many to do it "
                 "for a page.</p>";
}

}  // namespace

std::string model_page(const CompensatedModel& model, const std::optional<MeasurementBatch>& batch,
                       const std::string& last_check) {
  const NextCheck next = next_check(model.provenance(), last_check, unix_now());
  const Compared compared = compared_with(model, batch);
  std::optional<PositionAccuracy> accuracy = PositionAccuracy::of(model, batch);
  const std::optional<std::string> no_promise = why_no_promise(model, accuracy, batch);
  if (no_promise) accuracy.reset();
  const ShownPoses shown = poses_to_show(model, batch);
  const std::optional<LearningCurve> curve = no_promise ? std::nullopt : learning_curve(model);
  const ordered_json scene = scene_json(model, shown);
  const std::string title =
      html_text(fmt::format("Cell {}: model {}", model.cell().name, model.provenance().id));
  return fill_in(
      embedded::model_page_html,
      {{"title", title},
       {"mark", page_mark({"model", model.cell().name, model.provenance().id})},
       {"subtitle", html_text(fmt::format("{} · {}", model.cell().robot.name(),
                                          date_of(model.provenance().trained_at)))},
       {"promise", html_text(no_promise ? *no_promise : promise_sentence(model, accuracy, next))},
       {"certificate", certificate(model, accuracy, batch, next)},
       {"tiles", tiles(compared.evaluation)},
       {"warnings", warnings(model, compared.evaluation)},
       {"compared", html_text(compared.text + bias_note(model.parts()) + reading_note(model))},
       {"figures", figures_table(compared.evaluation)},
       {"axes", axes_table(compared.evaluation)},
       {"orientation", orientation_table(compared.evaluation)},
       {"budget", budget_section(model.parts().budget)},
       {"poses", pose_table(shown)},
       {"volumes", volume_table(model, scene)},
       {"learning", learning_text(curve)},
       {"provenance", provenance_rows(model, compared.evaluation)},
       {"sessions", session_changes_html(session_changes(model))},
       {"chosen", chosen_causes(model.parts())},
       {"parameters", parameter_table(model)},
       {"unidentifiable", unidentifiable_text(model.parts())},
       {"suspects", suspects_text(model.parts())},
       {"data", script_json(chart_data(compared.evaluation, shown, scene, curve))},
       {"page_css", std::string(page_style())},
       {"sort_tables_js", std::string(sort_tables_script())},
       {"view3d_js", std::string(view3d_script())},
       {"chart_js", std::string(embedded::chart_js)}});
}

}  // namespace trammel
