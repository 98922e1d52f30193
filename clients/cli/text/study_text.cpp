#include "clients/cli/text/study_text.h"

#include <algorithm>

#include "clients/cli/text/evaluation_text.h"
#include "server/base/coverage.h"
#include "server/base/units.h"
#include "server/report/figures_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

std::optional<Aim> row_aim(const Study& study, const StudyRow& row) {
  return aim_of(study.name, row.set, row.model, row.training_poses);
}

std::optional<PrintedFigures> row_printed(const Study& study, const StudyRow& row) {
  return printed_figures(study.name, row.set, row.model);
}

/// `M3+none` if a bias was requested and none was worth it.
std::string shown_model(const StudyRow& row) {
  return row.bias_left_out ? row.model.substr(0, row.model.find('+')) + "+none" : row.model;
}

bool reached(const Aim& aim, const StudyRow& row) {
  return to_mm(row.figures.rms) >= aim.least_mm && to_mm(row.figures.rms) <= aim.most_mm;
}

std::string number_or_dash(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "-";
}

std::string aim_text(const std::optional<Aim>& aim, const StudyRow& row) {
  if (!aim) return "";
  const std::string limit = aim->least_mm > 0
                                ? fmt::format("{:g} to {:g}", aim->least_mm, aim->most_mm)
                                : fmt::format("<= {:g}", aim->most_mm);
  return limit + (reached(*aim, row) ? "  reached" : "  NOT REACHED");
}

/// |error|: rms and maximum of the source, all figures of ours, and the aim.
std::string error_table(const Study& study) {
  std::string text = fmt::format("{:<36}{:>6}{:>7} |{:>8}{:>9} |{:>9}{:>9}{:>9}{:>9} |\n", "", "",
                                 "", "thesis", "", "ours", "", "", "");
  text += fmt::format("{:<28}{:<8}{:>6}{:>7} |{:>8}{:>9} |{:>9}{:>9}{:>9}{:>9} | {}\n",
                      "|error|, mm", "model", "learnt", "poses", "rms", "max", "rms", "mean",
                      "99.7 %", "max", "aim (rms)");
  for (const StudyRow& row : study.rows) {
    const std::optional<PrintedFigures> printed = row_printed(study, row);
    text +=
        fmt::format("{:<28}{:<8}{:>6}{:>7} |{:>8}{:>9} |{:>9.4f}{:>9.4f}{:>9.4f}{:>9.4f} | {}\n",
                    row.set, shown_model(row), row.training_poses, row.poses,
                    printed ? fmt::format("{:.3f}", printed->rms_mm) : "-",
                    printed ? fmt::format("{:.3f}", printed->max_mm) : "-", to_mm(row.figures.rms),
                    to_mm(row.figures.mean), to_mm(row.figures.p997), to_mm(row.figures.max),
                    aim_text(row_aim(study, row), row));
  }
  const auto left_out = [](const StudyRow& row) { return row.bias_left_out; };
  if (std::any_of(study.rows.begin(), study.rows.end(), left_out))
    text += "+none: no bias was worth it, so this is the calibrated model\n";
  return text;
}

std::string mean_and_stddev(double mean_mm, double stddev_mm) {
  return fmt::format("{:>17}", fmt::format("{:.3f} ({:.3f})", mean_mm, stddev_mm));
}

std::string axis_line(const Study& study, const StudyRow& row) {
  const std::optional<PrintedFigures> printed = row_printed(study, row);
  std::string text = fmt::format("{:<28}{:<8}|", row.set, shown_model(row));
  for (std::size_t k = 0; k < 3; ++k) {
    text += printed ? mean_and_stddev(printed->mean_mm[k], printed->stddev_mm[k])
                    : fmt::format("{:>17}", "-");
  }
  text += "|";
  for (int k = 0; k < 3; ++k) {
    text += mean_and_stddev(to_mm(row.figures.axis_mean(k)), to_mm(row.figures.axis_stddev(k)));
  }
  return text + "\n";
}

/// Mean and standard deviation of each axis, the source's and ours.
std::string axis_table(const Study& study) {
  std::string text = fmt::format("\n{:<28}{:<8}|{:^51}|{:^51}\n{:<36}|", "mean (std) in mm",
                                 "model", "thesis", "ours", "");
  for (int side = 0; side < 2; ++side)
    text += fmt::format("{:>17}{:>17}{:>17}{}", "x", "y", "z", side == 0 ? "|" : "\n");
  for (const StudyRow& row : study.rows) text += axis_line(study, row);
  return text;
}

/// As a service answers: outside the domain of the bias, by the calibrated model alone.
std::string served_table(const Study& study) {
  std::string text;
  for (const StudyRow& row : study.rows) {
    if (!row.served) continue;
    if (text.empty()) {
      text = fmt::format("\n{:<28}{:<8}{:>6}{:>16}{:>14}{:>14}{:>14}\n", "as served", "model",
                         "learnt", "rms, mm", "in domain", "inside 95 %", "nlpd (mm)");
    }
    text += fmt::format(
        "{:<28}{:<8}{:>6}{:>16.4f}{:>14}{:>12.1f} %{:>14}\n", row.set, shown_model(row),
        row.training_poses, to_mm(row.served->compensated.rms),
        fmt::format("{} of {}", row.served->in_domain, row.served->poses),
        100 * row.served->coverage_95,
        number_or_dash(
            row.served->nlpd ? std::optional(nlpd_in_mm(*row.served->nlpd)) : std::nullopt, 3));
  }
  return text;
}

/// Angles in mrad and compliances in 1e-9 rad/Nmm, as the source prints them.
std::pair<double, std::string> factor_and_unit(const std::string& unit) {
  if (unit == "rad") return {1e3, "mrad"};
  if (unit == "rad/Nmm") return {1e9, "rad/GNmm"};
  return {1, unit};
}

constexpr const char* kLevels[] = {"M1", "M2", "M3"};

std::string parameter_head() {
  std::string text = fmt::format("\n{:<10}{:<9}{:>8} |{:^27}|{:^36}\n{:<27} |", "parameter", "",
                                 "truth", "thesis", "ours ([ ]: a combination only)", "");
  for (const char* level : kLevels) text += fmt::format("{:>9}", level);
  text += "|";
  for (const char* level : kLevels) text += fmt::format("{:>12}", level);
  return text + "\n";
}

/// The parameters that a level identified, in brackets where only a combination is known.
std::string identified_text(const StudyParameter& parameter, const char* level, double factor) {
  const auto found = parameter.identified.find(level);
  if (found == parameter.identified.end()) return "-";
  const double value = factor * found->second.parameter.scale * found->second.value;
  return found->second.identified ? fmt::format("{:.3f}", value) : fmt::format("[{:.3f}]", value);
}

std::string parameter_line(const StudyParameter& parameter) {
  const auto [factor, unit] = factor_and_unit(parameter.unit);
  std::string text =
      fmt::format("{:<10}{:<9}{:>8.3f} |", parameter.name, unit, factor * parameter.truth);
  for (const char* level : kLevels) {
    const std::optional<double> printed = printed_parameter(parameter.name, level);
    text += fmt::format(
        "{:>9}", number_or_dash(printed ? std::optional(factor * *printed) : std::nullopt, 3));
  }
  text += "|";
  for (const char* level : kLevels)
    text += fmt::format("{:>12}", identified_text(parameter, level, factor));
  return text + "\n";
}

/// Table 5.5 beside ours.
std::string parameter_table(const Study& study) {
  if (study.parameters.empty()) return "";
  std::string text = parameter_head();
  for (const StudyParameter& parameter : study.parameters) text += parameter_line(parameter);
  return text;
}

std::string hole_table(const Study& study) {
  std::string text;
  std::map<std::string, double> worst;
  for (const DrilledHole& hole : study.holes) {
    if (text.empty()) {
      text = fmt::format("\n{:<12}{:<8}{:<16}{:>18}{:>18}{:>16}\n", "hole in row", "model",
                         "status", "true before, mm", "true after, mm", "expected, mm");
    }
    text += fmt::format("{:<12}{:<8}{:<16}{:>18.4f}{:>18.4f}{:>16.4f}\n", hole.row, hole.model,
                        to_string(hole.status), to_mm(hole.error_before), to_mm(hole.error_after),
                        to_mm(hole.expected_after));
    worst[hole.model] = std::max(worst[hole.model], hole.error_after);
  }
  for (const auto& [model, error] : worst) {
    text +=
        fmt::format("worst true error of a hole corrected by {}: {:.4f} mm\n", model, to_mm(error));
  }
  return text;
}

ordered_json printed_json(const PrintedFigures& printed) {
  ordered_json axes;
  for (std::size_t k = 0; k < 3; ++k) {
    axes[std::string(1, "xyz"[k])] = {{"mean_mm", printed.mean_mm[k]},
                                      {"std_mm", printed.stddev_mm[k]}};
  }
  return {{"rms_mm", printed.rms_mm}, {"max_mm", printed.max_mm}, {"axis", axes}};
}

ordered_json row_json(const Study& study, const StudyRow& row) {
  ordered_json json = {{"set", row.set},
                       {"model", row.model},
                       {"training_poses", row.training_poses},
                       {"poses", row.poses},
                       {"ours", figures_json(row.figures)}};
  if (const auto printed = row_printed(study, row)) json["thesis"] = printed_json(*printed);
  if (const auto aim = row_aim(study, row)) {
    json["aim"] = {{"rms_least_mm", aim->least_mm},
                   {"rms_most_mm", aim->most_mm},
                   {"reached", reached(*aim, row)}};
  }
  if (row.served) json["served"] = evaluation_json(*row.served);
  if (row.bias_left_out) json["bias_left_out"] = true;
  return json;
}

ordered_json parameter_json(const StudyParameter& parameter) {
  ordered_json levels = ordered_json::object();
  for (const auto& [level, identified] : parameter.identified) {
    const double scale = identified.parameter.scale;
    levels[level] = {{"value", scale * identified.value},
                     {"u95", kExpanded * scale * identified.stddev},
                     {"identified", identified.identified}};
    if (const auto printed = printed_parameter(parameter.name, level))
      levels[level]["thesis"] = *printed;
  }
  return {{"name", parameter.name},
          {"unit", parameter.unit},
          {"truth", parameter.truth},
          {"levels", levels}};
}

ordered_json hole_json(const DrilledHole& hole) {
  return {{"row", hole.row},
          {"model", hole.model},
          {"status", to_string(hole.status)},
          {"error_before_mm", to_mm(hole.error_before)},
          {"error_after_mm", to_mm(hole.error_after)},
          {"expected_after_mm", to_mm(hole.expected_after)}};
}

}  // namespace

std::string study_text(const Study& study) {
  return fmt::format(
             "study {} on the virtual robot in cell {}, seed {}; the bias applied at every "
             "pose\n\n",
             study.name, study.cell, study.seed) +
         error_table(study) + axis_table(study) + served_table(study) + parameter_table(study) +
         hole_table(study);
}

ordered_json study_json(const Study& study) {
  ordered_json json = {{"study", study.name}, {"seed", study.seed}, {"cell", study.cell}};
  json["aims_reached"] =
      std::all_of(study.rows.begin(), study.rows.end(), [&](const StudyRow& row) {
        const auto aim = row_aim(study, row);
        return !aim || reached(*aim, row);
      });
  json["rows"] = ordered_json::array();
  for (const StudyRow& row : study.rows) json["rows"].push_back(row_json(study, row));
  if (!study.parameters.empty()) json["parameters"] = ordered_json::array();
  for (const StudyParameter& parameter : study.parameters)
    json["parameters"].push_back(parameter_json(parameter));
  if (!study.holes.empty()) json["holes"] = ordered_json::array();
  for (const DrilledHole& hole : study.holes) json["holes"].push_back(hole_json(hole));
  return json;
}

}  // namespace trammel::cli
