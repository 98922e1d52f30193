#include "clients/cli/text/receipt_page.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <nlohmann/json.hpp>

#include "clients/cam/short_names.h"
#include "clients/cli/text/receipt_page_html.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/error_sources/cause_words.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/pages_beside.h"
#include "server/report/plain_page.h"

namespace trammel::cli {

namespace {

using cam::CorrectedProgram;
using cam::ReceiptRow;
using nlohmann::ordered_json;

constexpr std::size_t kMostRows = 2000;    // of the table; the CSV has all
constexpr std::size_t kMostPoints = 6000;  // of the drawing

std::string mm(double value) { return std::isfinite(value) ? fmt::format("{:.4f}", value) : ""; }

std::string date_of(std::optional<std::int64_t> time) {
  if (!time || *time == 0) return "not recorded";
  const std::time_t seconds = static_cast<std::time_t>(*time);
  std::tm utc{};
  ::gmtime_r(&seconds, &utc);
  const auto days = std::max<std::int64_t>(0, (unix_now() - *time) / 86400);
  return fmt::format("{:04}-{:02}-{:02}, {}", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday,
                     days == 0   ? "today"
                     : days == 1 ? "a day ago"
                                 : fmt::format("{} days ago", days));
}

/// rms and largest of a column, over rows where it is known.
std::string figures(const CorrectedProgram& program, double ReceiptRow::*column) {
  double sum = 0, most = 0;
  std::size_t count = 0;
  for (const ReceiptRow& row : program.rows) {
    if (!std::isfinite(row.*column)) continue;
    sum += row.*column * (row.*column);
    most = std::max(most, row.*column);
    ++count;
  }
  if (count == 0) return "not known";
  return fmt::format("{:.3f} mm rms, {:.3f} mm at most",
                     std::sqrt(sum / static_cast<double>(count)), most);
}

/// `8 of 8 targets are corrected: 8.437 mm rms expected before, 0.017 mm after.`
std::string verdict_of(const CorrectedProgram& program, double tolerance_mm) {
  const std::size_t left = program.left_alone(), all = program.rows.size();
  std::string text =
      all == 0 ? "No target in it is understood: it is as it was."
               : fmt::format("{} of {} targets are corrected{}.", all - left, all,
                             left == 0 ? "" : "; the others are left as they were, see below");
  const auto count = [&](const char* status) {
    return std::count_if(program.rows.begin(), program.rows.end(),
                         [&](const ReceiptRow& r) { return r.status == status; });
  };
  if (const auto outside = count("out_of_domain"); outside > 0)
    text += fmt::format(" {} are outside the poses that the model learned from.", outside);
  if (tolerance_mm > 0)
    text += " Held against " +
            verdict_text(tolerance_verdict(expected_errors(program), tolerance_mm)) + ".";
  return text;
}

std::string facts(const CorrectedProgram& program) {
  std::map<std::string, int> tools;
  for (const ReceiptRow& row : program.rows) {
    if (!row.tool.empty()) ++tools[row.tool];
  }
  std::vector<std::string> names;
  for (const auto& [name, count] : tools)
    names.push_back(fmt::format("{} ({} targets)", html_text(name), count));
  std::vector<HtmlRow> rows = {
      {{"Model", html_text(fmt::format("{} of cell {}", program.model_id, program.model.cell))}},
      {{"Error sources in it", html_text(level_in_words(program.model.level))}},
      {{"Newest measurement in it", date_of(program.model.measured_at_unix_s)}},
      {{"Tools", fmt::format("{}", fmt::join(names, ", "))}},
      {{"Motions",
        fmt::format("{}, {} to corrected targets", program.moves, program.moves_corrected)}},
      {{"Targets",
        fmt::format("{}, {} left as they were", program.rows.size(), program.left_alone())}},
      {{"Motions inserted before targets (lead-ins)", fmt::format("{}", program.lead_ins)}},
      {{"Expected error before", figures(program, &ReceiptRow::error_before_mm)}},
      {{"Expected error after", figures(program, &ReceiptRow::error_after_mm)}},
  };
  for (const std::string& one : program.contradictions)
    rows.insert(rows.begin(), {{"Contradiction", html_text(one)}});
  for (const std::string& note : program.notes) rows.push_back({{"Note", html_text(note)}});
  return html_table({"facts", {}, rows});
}

/// How far the corrected target is from the wanted one along an axis of the base, mm.
std::string moved(const ReceiptRow& row, int axis) {
  return row.corrected() ? mm(to_mm(row.correction_B(axis))) : "";
}

std::string targets(const CorrectedProgram& program) {
  std::vector<HtmlRow> rows;
  for (const ReceiptRow& row : program.rows) {
    if (rows.size() == kMostRows) break;
    const std::string said =
        row.message +
        (row.suggestion.empty() ? "" : (row.message.empty() ? "" : "; ") + row.suggestion);
    rows.push_back(
        {{html_text(fmt::format("{}:{}", row.file, row.line)), html_text(shown_name(row)),
          html_text(row.motion), html_text(row.tool), html_text(row.frame), html_text(row.status),
          moved(row, 0), moved(row, 1), moved(row, 2), mm(row.error_before_mm),
          mm(row.error_after_mm), mm(row.sigma_mm), mm(row.rounding_mm), html_text(said)},
         row.corrected() ? row.status : "left"});
  }
  return "<p class=\"note\">dx, dy, dz: how far the commanded target is from the wanted one, along "
         "the axes of the robot's base.</p>\n" +
         html_table({"targets",
                     {"place", "name", "motion", "tool", "frame", "status", "dx, mm", "dy, mm",
                      "dz, mm", "before, mm", "after, mm", "sigma, mm", "rounding, mm", ""},
                     rows});
}

ordered_json points(const CorrectedProgram& program) {
  const auto number = [](double value) {
    return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
  };
  std::vector<const ReceiptRow*> path;
  for (const ReceiptRow& row : program.rows) {
    if (std::isfinite(row.p_B.x())) path.push_back(&row);
  }
  std::stable_sort(path.begin(), path.end(),
                   [](const ReceiptRow* a, const ReceiptRow* b) { return a->order < b->order; });
  ordered_json all = ordered_json::array();
  // A long program shows the bad targets, and enough others to make its path readable.
  const std::size_t step = path.size() / kMostPoints + 1;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const ReceiptRow& row = *path[i];
    if (i % step != 0 && (row.status == "ok" || all.size() >= 2 * kMostPoints)) continue;
    all.push_back({to_mm(row.p_B.x()), to_mm(row.p_B.y()), to_mm(row.p_B.z()),
                   number(row.error_before_mm), number(row.error_after_mm), row.status,
                   fmt::format("{} {}:{}", shown_name(row), row.file, row.line)});
  }
  return all;
}

/// `drill.mod`, or `main.mod and 3 more`.
std::string files_of(const CorrectedProgram& program) {
  std::vector<std::string> files;
  for (const ReceiptRow& row : program.rows) {
    if (std::find(files.begin(), files.end(), row.file) == files.end()) files.push_back(row.file);
  }
  if (files.empty()) return "";
  return files.size() == 1 ? files[0] : fmt::format("{} and {} more", files[0], files.size() - 1);
}

}  // namespace

std::vector<ExpectedError> expected_errors(const CorrectedProgram& program) {
  std::vector<ExpectedError> errors;
  for (const ReceiptRow& row : program.rows) {
    errors.push_back(
        {row.error_before_mm, row.error_after_mm, row.sigma_mm, row.status != "out_of_domain"});
  }
  return errors;
}

std::string receipt_page(const CorrectedProgram& program, double tolerance_mm,
                         const CellPapers& papers) {
  std::string more;
  if (program.rows.size() > kMostRows)
    more = fmt::format("<p>The first {} of {} targets; the CSV receipt has all.</p>", kMostRows,
                       program.rows.size());
  return fill_in(kReceiptPage,
                 {{"page_css", std::string(page_style())},
                  {"mark", page_mark({"program", program.model.cell, program.model_id})},
                  {"verdict", html_text(verdict_of(program, tolerance_mm))},
                  {"view3d_js", std::string(view3d_script())},
                  {"subtitle", html_text(fmt::format("{} · cell {} · {}{}", files_of(program),
                                                     program.model.cell, shown_day(unix_now()),
                                                     papers_text(papers)))},
                  {"facts", facts(program)},
                  {"targets", targets(program) + more},
                  {"points", script_json(points(program))},
                  {"tolerance", fmt::format("{}", tolerance_mm)}});
}

}  // namespace trammel::cli
