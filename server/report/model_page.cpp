#include "server/report/model_page.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/error_sources/cause_words.h"
#include "server/measurement/pose_columns.h"
#include "server/report/embedded.h"
#include "server/report/html.h"
#include "server/report/session_changes_json.h"
#include "server/report/shown_value.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr double kFewestBins = 12;    // of a histogram
constexpr double kLeastError = 1e-6;  // mm: the histogram of a model without any error is that wide

/// What the page compares the model with.
struct Compared {
  Evaluation evaluation;
  std::string text;  ///< of which poses
};

/// Rows that were compared, with a position or without.
int rows_of(const Evaluation& evaluation) {
  return evaluation.poses + (evaluation.gauges ? evaluation.gauges->rows : 0);
}

Compared compared_with(const CompensatedModel& model, const std::optional<MeasurementBatch>& batch) {
  const CompensatedModel::Parts& parts = model.parts();
  if (batch) {
    Evaluation evaluation = model.evaluate(*batch);
    return {evaluation, fmt::format("On the {} poses of batch {}.", rows_of(evaluation), batch->id)};
  }
  if (parts.validation) {
    return {*parts.validation, fmt::format("On {} poses of batch {} that were held out from training.",
                                           rows_of(*parts.validation), parts.provenance.figures_batch_id())};
  }
  return {parts.training,
          fmt::format("On the {} poses of batch {} that the model was trained on: the compensated error "
                      "is smaller here than on new poses.",
                      rows_of(parts.training), parts.provenance.figures_batch_id())};
}

std::array<std::pair<const char*, const ErrorFigures*>, 3> levels_of(const Evaluation& evaluation) {
  return {{{"nominal", &evaluation.nominal},
           {"calibrated", &evaluation.calibrated},
           {"compensated", &evaluation.compensated}}};
}

/// What is no gain is not shown as one.
bool is_doubtful(const Evaluation& evaluation) { return doubt_of_bias(evaluation).has_value(); }

/// Of distances and touches: their values, where no position was measured.
std::string gauge_tiles(const GaugeFigures& gauges) {
  std::string html;
  for (const auto& [level, rms] : {std::pair("nominal", gauges.nominal), std::pair("calibrated", gauges.calibrated),
                                   std::pair("compensated", gauges.compensated)}) {
    html += fmt::format(R"(<div class="tile {0}"><b>{1:.3f} mm</b><span>{0}, rms of distances</span></div>)", level,
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
  for (std::string one : warnings_of(model, evaluation)) {
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
    for (const double value : {figures->rms, figures->mean, figures->p997, figures->max}) {
      cells.push_back(fmt::format("{:.4f}", to_mm(value)));
    }
    for (int k = 0; k < 3; ++k) {
      cells.push_back(fmt::format("{:.4f} ± {:.4f}", to_mm(figures->axis_mean(k)), to_mm(figures->axis_stddev(k))));
    }
    rows.push_back({cells});
  }
  return html_head({"mm", "rms", "mean", "99.7 %", "max", "x mean ± std", "y mean ± std", "z mean ± std"}) +
         html_rows(rows);
}

std::string orientation_table(const Evaluation& evaluation) {
  if (!evaluation.orientation) return "";
  const OrientationFigures& turned = *evaluation.orientation;
  const auto degrees = [](double angle) { return fmt::format("{:.4f}", to_deg(angle)); };
  std::vector<std::string> names = {fmt::format("orientation, deg rms of {} poses", turned.poses), "nominal",
                                    "calibrated", "compensated"};
  std::vector<std::string> cells = {"angle between measured and predicted", degrees(turned.nominal),
                                    degrees(turned.calibrated), degrees(turned.compensated)};
  if (turned.coverage_95) {
    names.emplace_back("inside their 95 % interval");
    cells.push_back(fmt::format("{:.1f} %", 100 * *turned.coverage_95));
  }
  return html_table({"figures orientation", names, {{cells}}}) + "\n";
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
  return fmt::format("Gaussian process on the joints, kernel {}, {} observations, {}{}", parts.bias->kernel,
                     parts.bias->q.rows(), parts.rotation_bias ? "positions and orientations" : "positions only",
                     chosen);
}

std::string trained_ranges(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  std::string text;
  for (int j = 0; j < model.cell().robot.size(); ++j) {
    const JointType type = model.cell().robot.joint(j).type;
    text += fmt::format("{}q{}\u00a0{:.1f}\u00a0…\u00a0{:.1f}\u00a0{}", j == 0 ? "" : " · ", j + 1,
                        joint_to_column(parts.q_min(j), type), joint_to_column(parts.q_max(j), type),
                        type == JointType::kRevolute ? "deg" : "mm");
  }
  return text;
}

std::string refit_text(const RefitRecord& refit) {
  return fmt::format("{} on {} poses of batch {}; all else is that of model {}", causes_in_words(refit.sources),
                     refit.poses, refit.batch_id, refit.model);
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
  add("error sources", provenance.level.empty() ? "none (nominal)" : level_in_words(provenance.level));
  add("learned bias", bias_text(parts));
  add("batch", provenance.batch_id);
  add("batch hash (SHA-256)", provenance.batch_hash);
  add("newest measurement", provenance.measured_at ? date_of(*provenance.measured_at) : "not recorded");
  add("trained", fmt::format("{}, {} poses, seed {}, trammel {}", date_of(provenance.trained_at),
                             provenance.training_poses, provenance.seed, provenance.program_version));
  for (const RefitRecord& refit : provenance.refits) add("identified anew", refit_text(refit));
  add("joints of the training", trained_ranges(model));
  if (evaluation.poses > 0) {
    add("compared poses in domain", fmt::format("{} of {}", evaluation.in_domain, evaluation.poses));
    add("inside their 95 % interval", fmt::format("{:.1f} % of coordinates", 100 * evaluation.coverage_95));
  }
  if (const auto& gauges = evaluation.gauges) {
    add("distances and touches",
        fmt::format("{}: {:.4f} mm rms of the value, {:.1f} % inside their 95 % interval, {} in domain", gauges->rows,
                    to_mm(gauges->compensated), 100 * gauges->coverage_95, gauges->in_domain));
  }
  add("negative log predictive density",
      evaluation.nlpd ? fmt::format("{:.3f} nat a coordinate, mm", nlpd_in_mm(*evaluation.nlpd)) : "-");
  add("left over beyond the tracker's sigma", fmt::format("{:.4f} mm per axis, calibrated", to_mm(parts.discrepancy)));
  return html_rows(rows);
}

HtmlRow source_row(const ErrorSource& source) {
  return {
      .cells = {fmt::format("{} <span>{}</span>", html_text(in_words(source.name())), html_text(source.explanation()))},
      .kind = "cause",
      .last_spans = 5};
}

HtmlRow parameter_row(const IdentifiedParameter& identified) {
  const Parameter& parameter = identified.parameter;
  const ShownValue shown =
      show_with_uncertainty(parameter.scale * identified.value, kExpanded * parameter.scale * identified.stddev);
  return {.cells = {html_text(parameter.name), shown.value, shown.expanded, html_text(parameter.unit),
                    identified.identified ? "" : "not identified by itself"},
          .kind = identified.identified ? "" : "unknown"};
}

std::string parameter_table(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  if (parts.parameters.empty()) return "<p>Nothing: the model is the nominal robot.</p>\n";
  std::vector<HtmlRow> rows;
  std::size_t next = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    rows.push_back(source_row(*source));
    for (std::size_t k = 0; k < source->parameters().size(); ++k)
      rows.push_back(parameter_row(parts.parameters[next++]));
  }
  return html_table({"parameters", {"parameter", "value", "U (k = 2)", "unit", ""}, rows}) + "\n";
}

std::string unidentifiable_text(const CompensatedModel::Parts& parts) {
  if (parts.unidentifiable.empty()) {
    return parts.parameters.empty() ? "<p>Nothing was asked of them.</p>\n"
                                    : "<p>Nothing: every combination of parameters shows in them.</p>\n";
  }
  std::string html = fmt::format(
      "<p>{} of {} directions in parameter space are determined. In the others the measurements say less than what was "
      "believed before, so the model keeps that belief:</p>\n<ul>\n",
      parts.rank, parts.parameters.size());
  for (const UnidentifiableCombination& combination : parts.unidentifiable) {
    html += "<li>" + html_text(combination.sentence) + "</li>\n";
  }
  return html + "</ul>\n";
}

std::string suspects_text(const CompensatedModel::Parts& parts) {
  if (parts.suspects.empty()) return "<p>None: every pose fits the others.</p>\n";
  std::vector<HtmlRow> rows;
  for (const SuspectPose& pose : parts.suspects) {
    rows.push_back({{html_text(pose.pose_id), fmt::format("{}", pose.row), fmt::format("{:.3f}", to_mm(pose.distance)),
                     fmt::format("{:.0f}", pose.sigmas)}});
  }
  return "<p>These fit the others so badly that their pull was bounded. Measure them again.</p>\n" +
         html_table({"", {"pose", "row", "off by, mm", "sigma"}, rows}) + "\n";
}

/// |error| of each pose, mm, at two levels.
struct PoseErrors {
  std::vector<double> calibrated, compensated;
  std::string title;
};

PoseErrors errors_of(const CompensatedModel& model, const MeasurementBatch& batch) {
  PoseErrors errors{{}, {}, fmt::format("Poses of batch {} by their error", batch.id)};
  const CompensatedModel::LevelErrors levels = model.errors_B(batch);
  for (Eigen::Index i = 0; i < levels.calibrated.cols(); ++i) {
    errors.calibrated.push_back(to_mm(levels.calibrated.col(i).norm()));
    errors.compensated.push_back(to_mm(levels.compensated.col(i).norm()));
  }
  return errors;
}

/// What each training pose would show if it were new: the bias predicts it from all the others.
PoseErrors errors_of_training(const BiasModel& bias) {
  PoseErrors errors{{}, {}, "Training poses by their error, each left out of the bias"};
  const BiasState& state = bias.state();
  const Eigen::MatrixXd left = state.residual_B - bias.leave_one_out_mean_B();
  for (Eigen::Index i = 0; i < left.rows(); ++i) {
    errors.calibrated.push_back(to_mm(state.residual_B.row(i).norm()));
    errors.compensated.push_back(to_mm(left.row(i).norm()));
  }
  return errors;
}

/// The largest of 1, 2, 5, 10, 20... that is not above `limit`, which is positive.
double round_width(double limit) {
  const double power = std::pow(10, std::floor(std::log10(limit)));
  for (const double digit : {5., 2.}) {
    if (digit * power <= limit) return digit * power;
  }
  return power;
}

ordered_json histogram_json(const PoseErrors& errors) {
  double largest = kLeastError;
  for (const double error : errors.calibrated) largest = std::max(largest, error);
  for (const double error : errors.compensated) largest = std::max(largest, error);
  const double width = round_width(largest / kFewestBins);
  const std::size_t bins = static_cast<std::size_t>(largest / width) + 1;
  const auto counts = [&](const std::vector<double>& values) {
    std::vector<int> counted(bins, 0);
    for (const double value : values) ++counted[static_cast<std::size_t>(value / width)];
    return counted;
  };
  std::vector<std::string> labels;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    labels.push_back(fmt::format("{:.3g}", (static_cast<double>(bin) + 0.5) * width));
  }
  return {{"title", errors.title},
          {"labels_mm", labels},
          {"calibrated", counts(errors.calibrated)},
          {"compensated", counts(errors.compensated)}};
}

/// What the charts are drawn from.
ordered_json chart_data(const CompensatedModel& model, const std::optional<MeasurementBatch>& batch,
                        const Evaluation& evaluation) {
  ordered_json data;
  if (is_doubtful(evaluation)) data["doubtful"] = true;
  data["levels"] = ordered_json::object();
  for (const auto& [level, figures] : levels_of(evaluation)) {
    if (evaluation.poses == 0) break;
    data["levels"][level] = {to_mm(figures->rms), to_mm(figures->mean), to_mm(figures->p997), to_mm(figures->max)};
  }
  const auto& bias = model.bias();
  if (batch) {
    data["histogram"] = histogram_json(errors_of(model, *batch));
  } else if (bias) {
    data["histogram"] = histogram_json(errors_of_training(*bias));
  }
  return data;
}

}  // namespace

std::string model_page(const CompensatedModel& model, const std::optional<MeasurementBatch>& batch) {
  const Compared compared = compared_with(model, batch);
  const std::string title = html_text(fmt::format("Cell {}: model {}", model.cell().name, model.provenance().id));
  return fill_in(embedded::model_page_html,
                 {{"title", title},
                  {"subtitle", html_text(fmt::format("{} · {}", model.cell().robot.name(),
                                                     date_of(model.provenance().trained_at)))},
                  {"tiles", tiles(compared.evaluation)},
                  {"warnings", warnings(model, compared.evaluation)},
                  {"compared", html_text(compared.text)},
                  {"figures", figures_table(compared.evaluation)},
                  {"orientation", orientation_table(compared.evaluation)},
                  {"provenance", provenance_rows(model, compared.evaluation)},
                  {"sessions", session_changes_html(session_changes(model))},
                  {"parameters", parameter_table(model)},
                  {"unidentifiable", unidentifiable_text(model.parts())},
                  {"suspects", suspects_text(model.parts())},
                  {"data", script_json(chart_data(model, batch, compared.evaluation))},
                  {"chart_js", std::string(embedded::chart_js)}});
}

}  // namespace trammel
