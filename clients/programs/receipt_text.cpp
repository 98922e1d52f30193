#include "clients/programs/receipt_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "clients/cam/short_names.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/error_json.h"
#include "server/report/note_json.h"

namespace trammel::cam {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kNumbers = 7;  // of the longest kind of target
// Bytes per target. The text of a long program that grows by doubling takes three times its size
// for a moment.
constexpr std::size_t kCsvBytes = 400;
constexpr std::size_t kJsonBytes = 900;

// A long program's receipt is mostly numbers.

void add_number(std::string& text, double value, std::chars_format format, int digits) {
  std::array<char, 400> written{};
  text.append(written.data(),
              std::to_chars(written.begin(), written.end(), value, format, digits).ptr);
}

/// Adds a number; an unknown one stays empty.
void add_fixed(std::string& text, double value, int decimals) {
  if (std::isfinite(value)) add_number(text, value, std::chars_format::fixed, decimals);
  text += ',';
}

void add_numbers(std::string& text, const std::vector<double>& values) {
  for (std::size_t k = 0; k < kNumbers; ++k) {
    if (k < values.size()) add_number(text, values[k], std::chars_format::general, 12);
    text += ',';
  }
}

const char* spelled(Coordinates coordinates) {
  switch (coordinates) {
    case Coordinates::kQuaternion:
      return "mm_wxyz";
    case Coordinates::kAnglesZyx:
      return "mm_abc_deg";
    case Coordinates::kAnglesXyz:
      return "mm_wpr_deg";
    case Coordinates::kRotationVector:
      return "m_rotvec_rad";
    case Coordinates::kJoints:
      return "joints_deg";
    case Coordinates::kJointRadians:
      return "joints_rad";
    case Coordinates::kJointPulses:
      return "joints_pulses";
  }
  return "";
}

std::string domain_of(const ReceiptRow& row) {
  return row.status == "ok" ? "inside" : row.status == "out_of_domain" ? "outside" : "";
}

ordered_json json_of(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

/// To a tenth of a micrometre, as in the CSV.
ordered_json json_mm(double value) {
  return json_of(std::isfinite(value) ? std::round(value * 1e5) / 1e5 : value);
}

ordered_json item_of(const ReceiptRow& row) {
  ordered_json item = {{"file", row.file},     {"line", row.line},       {"name", shown_name(row)},
                       {"motion", row.motion}, {"used_at", row.used_at}, {"tool", row.tool},
                       {"frame", row.frame},   {"status", row.status},   {"message", row.message}};
  if (!row.suggestion.empty()) item["suggestion"] = row.suggestion;
  if (!row.before.empty()) {
    item["units"] = spelled(row.coordinates);
    item["before"] = row.before;
  }
  if (row.corrected()) {
    item["after"] = row.after;
    item["joints"] = row.joints;
    item["folded"] = row.folded;
    item["lead_in"] = row.lead_in;
    item["turned_rz_deg"] = row.turned_deg;
  }
  if (std::isfinite(row.p_B.x()))
    item["position_mm"] = {to_mm(row.p_B.x()), to_mm(row.p_B.y()), to_mm(row.p_B.z())};
  item["error_before_mm"] = json_mm(row.error_before_mm);
  item["error_after_mm"] = json_mm(row.error_after_mm);
  item["sigma_mm"] = json_mm(row.sigma_mm);
  item["sigma_measured_mm"] = json_mm(row.sigma_measured_mm);
  item["rounding_mm"] = json_mm(row.rounding_mm);
  item["domain"] = domain_of(row);
  item["iterations"] = row.iterations;
  if (std::isfinite(row.path_limit_after_mm_s)) {
    item["path_limit_before_mm_s"] = json_of(row.path_limit_before_mm_s);
    item["path_limit_after_mm_s"] = json_of(row.path_limit_after_mm_s);
  }
  return item;
}

}  // namespace

std::string receipt_csv(const CorrectedProgram& program) {
  std::string text = "file,line,name,motion,used_at,tool,frame,status,folded,units";
  for (std::size_t k = 1; k <= kNumbers; ++k) text += fmt::format(",before_{}", k);
  for (std::size_t k = 1; k <= kNumbers; ++k) text += fmt::format(",after_{}", k);
  text +=
      ",x_mm,y_mm,z_mm,error_before_mm,error_after_mm,sigma_mm,sigma_measured_mm,rounding_mm,"
      "domain,iterations,path_limit_before_mm_s,path_limit_after_mm_s,model_id,message,"
      "suggestion,lead_in,turned_rz_deg\n";
  text.reserve(text.size() + kCsvBytes * program.rows.size());
  const auto out = std::back_inserter(text);
  for (const ReceiptRow& row : program.rows) {
    fmt::format_to(out, "{},{},{},{},{},{},{},{},{},{},", csv_field(row.file), row.line,
                   csv_field(shown_name(row)), csv_field(row.motion),
                   csv_field(fmt::format("{}", fmt::join(row.used_at, " "))), csv_field(row.tool),
                   csv_field(row.frame), row.status, row.folded && row.corrected() ? 1 : 0,
                   row.before.empty() ? "" : spelled(row.coordinates));
    add_numbers(text, row.before);
    add_numbers(text, row.after);
    for (Eigen::Index k = 0; k < 3; ++k) add_fixed(text, to_mm(row.p_B(k)), 4);
    // Micrometres appear in mm with four decimals, tenths of them with five. Nobody knows more
    // digits.
    for (const double value : {row.error_before_mm, row.error_after_mm, row.sigma_mm,
                               row.sigma_measured_mm, row.rounding_mm})
      add_fixed(text, value, 5);
    fmt::format_to(out, "{},{},", domain_of(row), row.iterations);
    add_fixed(text, row.path_limit_before_mm_s, 1);
    add_fixed(text, row.path_limit_after_mm_s, 1);
    fmt::format_to(out, "{},{},{},{},{:g}\n", program.model_id, csv_field(row.message),
                   csv_field(row.suggestion), row.lead_in, row.turned_deg);
  }
  return text;
}

std::string receipt_json(const CorrectedProgram& program, const ordered_json& tolerance,
                         const std::vector<Note>& of_model) {
  std::vector<Note> notes;
  for (const std::string& one : program.contradictions)
    notes.push_back({"contradiction", Note::Severity::kWarning, one});
  notes.insert(notes.end(), of_model.begin(), of_model.end());
  for (const std::string& one : program.notes)
    notes.push_back({"program", Note::Severity::kInfo, one});
  ordered_json inserted = ordered_json::array();
  for (const InsertedLine& line : program.inserted)
    inserted.push_back({{"file", line.file}, {"line", line.line}, {"text", line.text}});
  ordered_json head = {{"model", program.model_id},
                       {"moves", program.moves},
                       {"moves_corrected", program.moves_corrected},
                       {"left_alone", program.left_alone()},
                       {"lead_ins", program.lead_ins},
                       {"notes", notes_json(notes)},
                       {"largest_step",
                        {{"mm", json_mm(program.largest_step_mm)},
                         {"file", program.largest_step_file},
                         {"line", program.largest_step_line}}},
                       {"inserted_lines", inserted}};
  if (!tolerance.is_null()) head["tolerance"] = tolerance;
  // A line per target: as one JSON value, all of them would take hundreds of megabytes for a long
  // program.
  std::string text = json_text(head);
  text.erase(text.rfind("\n}"));
  text += ",\n  \"targets\": [";
  text.reserve(text.size() + kJsonBytes * program.rows.size());
  const char* separator = "\n    ";
  for (const ReceiptRow& row : program.rows) {
    text += separator;
    text += shown_lines(item_of(row).dump(-1, ' ', false, ordered_json::error_handler_t::replace));
    separator = ",\n    ";
  }
  text += "\n  ]\n}\n";
  return text;
}

std::string receipt_summary(const CorrectedProgram& program) {
  std::map<std::string, int> counts;
  for (const ReceiptRow& row : program.rows) ++counts[row.status];
  std::string text;
  for (const std::string& one : program.contradictions) text += "warning: " + one + "\n";
  text += fmt::format("{} motions, {} to corrected targets; {} targets:", program.moves,
                      program.moves_corrected, program.rows.size());
  const char* separator = " ";
  for (const auto& [status, count] : counts) {
    text += fmt::format("{}{} {}", separator, count, status);
    separator = ", ";
  }
  text += "\n";
  const auto led = std::count_if(program.rows.begin(), program.rows.end(),
                                 [](const ReceiptRow& row) { return row.lead_in > 0; });
  if (led > 0)
    text +=
        fmt::format("{} targets are led in to, by {} inserted motions\n", led, program.lead_ins);
  const auto turned = std::count_if(program.rows.begin(), program.rows.end(), [](const auto& row) {
    return row.corrected() && row.turned_deg != 0;
  });
  if (turned > 0) text += fmt::format("{} targets are turned about the tool's axis\n", turned);
  for (const std::string& note : counted(program.notes)) text += "note: " + note + "\n";
  return text;
}

namespace {

/// Rows that are left alone for one reason.
struct Reason {
  const ReceiptRow* first = nullptr;
  std::size_t targets = 0, motions = 0;
};

std::string why_left(const ReceiptRow& row) {
  return fmt::format("{}: {}{}", row.status, row.message,
                     row.suggestion.empty() ? "" : "; " + row.suggestion);
}

/// The reason that leaves most motions first.
std::vector<Reason> reasons_of(const CorrectedProgram& program) {
  std::map<std::string, Reason> by_text;
  for (const ReceiptRow& row : program.rows) {
    if (row.corrected()) continue;
    Reason& reason = by_text[why_left(row)];
    if (reason.first == nullptr) reason.first = &row;
    ++reason.targets;
    reason.motions += std::max<std::size_t>(row.used_at.size(), 1);
  }
  std::vector<Reason> reasons;
  for (const auto& [text, reason] : by_text) reasons.push_back(reason);
  std::stable_sort(reasons.begin(), reasons.end(), [](const Reason& a, const Reason& b) {
    return std::pair(a.motions, a.targets) > std::pair(b.motions, b.targets);
  });
  return reasons;
}

std::string by_reason(const CorrectedProgram& program, std::size_t most_lines) {
  const std::vector<Reason> reasons = reasons_of(program);
  std::string text;
  for (std::size_t k = 0; k < std::min(reasons.size(), most_lines); ++k) {
    const ReceiptRow& first = *reasons[k].first;
    const std::string more =
        reasons[k].targets > 1 ? fmt::format(" and {} more", reasons[k].targets - 1) : "";
    text += fmt::format("  {} motion{}, {} {} line {}{}: {}\n", reasons[k].motions,
                        reasons[k].motions == 1 ? "" : "s",
                        first.name.empty() ? first.motion : shown_name(first), first.file,
                        first.line, more, why_left(first));
  }
  if (reasons.size() > most_lines)
    text += fmt::format("  and {} more reasons\n", reasons.size() - most_lines);
  if (program.moves_corrected == 0 && reasons.size() > 1 && reasons[0].motions > 1)
    text += fmt::format("no motion is corrected; one reason leaves {} of {} motions: {}\n",
                        reasons[0].motions, program.moves, why_left(*reasons[0].first));
  return text;
}

}  // namespace

std::string left_alone_text(const CorrectedProgram& program) {
  constexpr std::size_t kLines = 10;
  const std::size_t left = program.left_alone();
  if (left == 0) return "";
  std::string text =
      fmt::format("{} of {} targets are left as they were:\n", left, program.rows.size());
  if (left > kLines) return text + by_reason(program, kLines);
  for (const ReceiptRow& row : program.rows) {
    if (row.corrected()) continue;
    text += fmt::format("  {} line {}: {}{}\n", row.file, row.line,
                        row.name.empty() ? "" : shown_name(row) + ": ", why_left(row));
  }
  return text;
}

}  // namespace trammel::cam
