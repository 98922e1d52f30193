#include "clients/cli/text/prediction_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "clients/cam/short_names.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

using cam::PredictedProgram;
using cam::PredictedTarget;
using nlohmann::ordered_json;

bool has_prediction(const PredictedTarget& target) {
  return target.status != "refused" && target.status != "unreachable";
}

/// mm, to a hundredth of a micrometre: more nobody knows.
std::string millimetres(double value) {
  return std::isfinite(value) ? fmt::format("{:.5f}", value) : "";
}
double rounded(double value) { return std::round(value * 1e5) / 1e5; }
std::array<double, 3> rounded(const std::array<double, 3>& v) {
  return {rounded(v[0]), rounded(v[1]), rounded(v[2])};
}

double error_mm(const PredictedTarget& target) {
  const auto& e = target.predicted.error_mm;
  return std::hypot(e[0], e[1], e[2]);
}

/// rms of the expected error: from its mean and its standard deviation.
double expected_mm(const PredictedTarget& target) {
  const auto& s = target.predicted.true_stddev_mm;
  return std::hypot(error_mm(target), std::hypot(s[0], s[1], s[2]));
}

}  // namespace

std::string prediction_csv(const PredictedProgram& program) {
  std::string text =
      "file,line,name,motion,used_at,tool,frame,status,x_mm,y_mm,z_mm,px_mm,py_mm,pz_mm,dx_mm,dy_"
      "mm,dz_mm,error_mm,slx_mm,sly_mm,slz_mm,expected_mm,model_id,message\n";
  for (const PredictedTarget& row : program.targets) {
    text += fmt::format("{},{},{},{},{},{},{},{},", csv_field(row.file), row.line,
                        csv_field(cam::shown_name(row)), csv_field(row.motion),
                        csv_field(fmt::format("{}", fmt::join(row.used_at, " "))),
                        csv_field(row.tool), csv_field(row.frame), row.status);
    const auto& [error, spread] = std::tie(row.predicted.error_mm, row.predicted.true_stddev_mm);
    const auto& at = row.predicted.predicted.xyz_mm;
    std::vector<double> values = {to_mm(row.p_B.x()), to_mm(row.p_B.y()), to_mm(row.p_B.z())};
    const std::vector<double> known = {at[0],     at[1],     at[2],           error[0],
                                       error[1],  error[2],  error_mm(row),   spread[0],
                                       spread[1], spread[2], expected_mm(row)};
    const std::vector<double> unknown(known.size(), cam::kNotKnown);
    values.insert(values.end(), has_prediction(row) ? known.begin() : unknown.begin(),
                  has_prediction(row) ? known.end() : unknown.end());
    for (const double value : values) text += millimetres(value) + ",";
    text += fmt::format("{},{}\n", program.model_id, csv_field(row.message));
  }
  return text;
}

ordered_json prediction_json(const PredictedProgram& program) {
  ordered_json targets = ordered_json::array();
  for (const PredictedTarget& row : program.targets) {
    ordered_json item = {
        {"file", row.file},     {"line", row.line},       {"name", cam::shown_name(row)},
        {"motion", row.motion}, {"used_at", row.used_at}, {"tool", row.tool},
        {"frame", row.frame},   {"status", row.status},   {"message", row.message}};
    if (std::isfinite(row.p_B.x()))
      item["position_mm"] = {to_mm(row.p_B.x()), to_mm(row.p_B.y()), to_mm(row.p_B.z())};
    if (has_prediction(row)) {
      item["predicted_mm"] = row.predicted.predicted.xyz_mm;
      item["error_mm"] = rounded(row.predicted.error_mm);
      item["sigma_mm"] = rounded(row.predicted.true_stddev_mm);
      item["expected_mm"] = rounded(expected_mm(row));
    }
    targets.push_back(std::move(item));
  }
  std::vector<Note> notes;
  for (const std::string& one : program.corrected)
    notes.push_back({"corrected_already", Note::Severity::kWarning, one});
  for (const std::string& one : program.contradictions)
    notes.push_back({"contradiction", Note::Severity::kWarning, one});
  notes.insert(notes.end(), program.model.notes.begin(), program.model.notes.end());
  for (const std::string& one : program.notes)
    notes.push_back({"program", Note::Severity::kInfo, one});
  return {{"model", program.model_id}, {"notes", notes_json(notes)}, {"targets", targets}};
}

std::string prediction_summary(const PredictedProgram& program) {
  std::map<std::string, int> counts;
  double squares = 0, most = 0;
  int known = 0;
  std::string left;
  for (const PredictedTarget& row : program.targets) {
    ++counts[row.status];
    if (!has_prediction(row)) {
      left +=
          fmt::format("  {} line {}: {}{}: {}\n", row.file, row.line,
                      row.name.empty() ? "" : cam::shown_name(row) + ": ", row.status, row.message);
      continue;
    }
    ++known;
    squares += expected_mm(row) * expected_mm(row);
    most = std::max(most, expected_mm(row));
  }
  std::string text;
  for (const auto* list : {&program.corrected, &program.contradictions}) {
    for (const std::string& one : *list) text += "warning: " + one + "\n";
  }
  text += fmt::format("{} targets:", program.targets.size());
  const char* separator = " ";
  for (const auto& [status, count] : counts) {
    text += fmt::format("{}{} {}", separator, count, status);
    separator = ", ";
  }
  if (known > 0)
    text += fmt::format("; expected error {:.3f} mm rms, {:.3f} mm at most",
                        std::sqrt(squares / known), most);
  text += "\n";
  for (const std::string& note : cam::counted(program.notes)) text += "note: " + note + "\n";
  return text + left;
}

}  // namespace trammel::cli
