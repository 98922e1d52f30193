#include "server/report/model_parameters.h"

#include <algorithm>
#include <cmath>

#include "server/base/coverage.h"
#include "server/base/shown_value.h"
#include "server/report/html.h"

namespace trammel {

namespace {

constexpr int kColumns = 7;

HtmlRow source_row(const ErrorSource& source) {
  return {.cells = {fmt::format("{} <span>{}</span>", html_text(in_words(source.name())),
                                html_text(source.explanation()))},
          .kind = "cause",
          .last_spans = kColumns};
}

/// The number of a link that a parameter like `alpha4` changes; SI.
std::optional<double> nominal_of_link(const Chain& robot, const std::string& name) {
  const std::size_t digits = name.find_first_of("0123456789");
  if (digits == std::string::npos || name.size() > digits + 2) return std::nullopt;
  const int joint = std::stoi(name.substr(digits)) - 1;
  if (joint < 0 || joint >= robot.size()) return std::nullopt;
  const LinkGeometry& link = robot.joint(joint).link;
  const std::string symbol = name.substr(0, digits);
  if (symbol == "q" || symbol == "theta") return link.theta;
  if (symbol == "d") return link.d;
  if (symbol == "a") return link.a;
  if (symbol == "alpha") return link.alpha;
  return symbol == "beta" ? std::optional(link.beta) : std::nullopt;
}

/// The value in the drawing or the cell file from which the parameter is an offset, if there is
/// one; SI.
std::optional<double> stated(const CompensatedModel& model, const ErrorSource& source,
                             const std::string& name) {
  const causes::ActsOn on = source.cause().acts.on;
  if (on == causes::ActsOn::kLinks) return nominal_of_link(model.cell().robot, name);
  if (on != causes::ActsOn::kBase || name.size() != 2 || name[1] != '0') return std::nullopt;
  const auto axis = std::string("xyz").find(name[0]);
  if (axis == std::string::npos) return std::nullopt;
  return model.parts().physics.X_WB.translation()(static_cast<Eigen::Index>(axis));
}

HtmlRow parameter_row(const CompensatedModel& model, const ErrorSource& source,
                      const IdentifiedParameter& identified) {
  const Parameter& parameter = identified.parameter;
  const Reading reading = reading_of(parameter.unit);
  const std::optional<double> drawn = stated(model, source, parameter.name);
  const double nominal = drawn.value_or(parameter.prior);
  const double correction = drawn ? identified.value : identified.value - parameter.prior;
  const double u95 = kExpanded * parameter.scale * identified.stddev;
  const ShownValue shown = show_read(parameter.scale * correction, u95, reading);
  return {.cells = {html_text(parameter.name),
                    fmt::format("{:.7g}", reading.scale * parameter.scale * nominal), shown.value,
                    show_read(parameter.scale * (nominal + correction), u95, reading).value,
                    shown.expanded, html_text(reading.unit),
                    identified.identified ? "" : "not identified by itself"},
          .kind = identified.identified ? "" : "unknown"};
}

}  // namespace

std::string parameter_table(const CompensatedModel& model) {
  const CompensatedModel::Parts& parts = model.parts();
  if (parts.parameters.empty()) return "<p>Nothing: the model is the nominal robot.</p>\n";
  std::vector<HtmlRow> rows;
  std::size_t next = 0;
  for (const ErrorSourcePtr& source : parts.physics.sources) {
    rows.push_back(source_row(*source));
    for (std::size_t k = 0; k < source->parameters().size(); ++k)
      rows.push_back(parameter_row(model, *source, parts.parameters[next++]));
  }
  return html_table({"parameters flows",
                     {"parameter", "nominal", "correction", "result", "± U (k = 2)", "unit", ""},
                     rows}) +
         "\n";
}

std::string unidentifiable_text(const CompensatedModel::Parts& parts) {
  if (parts.unidentifiable.empty()) {
    return parts.parameters.empty()
               ? "<p>Nothing was asked of them.</p>\n"
               : "<p>Nothing: every combination of parameters shows in them.</p>\n";
  }
  std::string html = fmt::format(
      "<p>{} of {} directions in parameter space are determined. In the others the measurements "
      "say less than what was believed before, so the model keeps that belief:</p>\n<ul>\n",
      parts.rank, parts.parameters.size());
  for (const UnidentifiableCombination& combination : parts.unidentifiable) {
    html += "<li>" + html_text(combination.sentence) + "</li>\n";
  }
  return html + "</ul>\n";
}

}  // namespace trammel
