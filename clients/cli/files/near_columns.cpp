#include "clients/cli/files/near_columns.h"

#include <algorithm>
#include <cstdio>

#include "server/base/letters.h"
#include "server/base/near_miss.h"
#include "server/base/plain_text.h"
#include "server/measurement/files/text_lines.h"
#include "server/measurement/unread_columns.h"

namespace trammel::cli {

namespace {

constexpr std::size_t kShortest = 5;  // letters; shorter words are near to too many
constexpr std::size_t kLong = 10;     // letters, from which two may be wrong
constexpr std::size_t kLongestLine = 65536;

std::vector<std::string> optional_columns(TableKind kind) {
  std::vector<std::string> names = {"time_s", "temperature_c"};
  if (kind == TableKind::kTargets) return names;
  names.insert(names.end(), {"pose_id", "tool_id", "payload_id"});
  if (kind == TableKind::kJoints) return names;
  names.insert(names.end(), {"sigma_mm", "session_id", "distance_mm", "touch_mm", "anchor_id",
                             "minus_pose_id", "from_pose_id"});
  return names;
}

/// True if one letter was inserted, left out or changed, or two neighbours are swapped.
bool differ_by_one(std::string_view a, std::string_view b) {
  while (!a.empty() && !b.empty() && a.front() == b.front()) a.remove_prefix(1), b.remove_prefix(1);
  while (!a.empty() && !b.empty() && a.back() == b.back()) a.remove_suffix(1), b.remove_suffix(1);
  const bool swapped = a.size() == 2 && b.size() == 2 && a[0] == b[1] && a[1] == b[0];
  return swapped || (a.size() <= 1 && b.size() <= 1);
}

/// A column with a name that is nearly the name of another one.
struct NearColumn {
  std::string column, meant;
};

std::vector<NearColumn> near_among(const std::vector<std::string>& columns, TableKind kind) {
  std::vector<std::string> missing = optional_columns(kind);
  const std::vector<std::string> known = missing;
  for (const std::string& column : columns) std::erase(missing, lower(column));
  std::vector<NearColumn> all;
  for (const std::string& column : columns) {
    const std::string word = lower(column);
    if (word.size() < kShortest || std::find(known.begin(), known.end(), word) != known.end())
      continue;
    const std::string meant = near_miss(word, missing);
    if (meant.empty() || (word.size() < kLong && !differ_by_one(word, meant))) continue;
    all.push_back({column, meant});
  }
  return all;
}

std::string near_sentence(const NearColumn& one, const std::string& where) {
  return fmt::format("{}: column {} is not known and is left aside; {} was meant?", where,
                     one.column, one.meant);
}

}  // namespace

std::vector<std::string> near_columns(const std::vector<std::string>& columns, TableKind kind,
                                      const std::string& where) {
  std::vector<std::string> said;
  for (const NearColumn& one : near_among(columns, kind)) said.push_back(near_sentence(one, where));
  return said;
}

std::vector<std::string> tell_near_columns(const std::string& text, TableKind kind,
                                           const std::string& where) {
  const std::vector<TextLine> lines = first_lines(text, 1);
  if (lines.empty() || lines[0].text.size() > kLongestLine) return {};
  const std::vector<std::string> header = split_fields(lines[0].text, separator_of(lines[0].text));
  std::vector<std::string> told;
  for (const NearColumn& one : near_among(header, kind)) {
    fmt::print(stderr, "{}\n", shown(near_sentence(one, where)));
    told.push_back(one.column);
  }
  return told;
}

void tell_columns_left_aside(const MeasurementBatch& batch, const std::string& text,
                             const std::string& where) {
  if (batch.extra_columns.empty()) return;
  const auto told = tell_near_columns(text, TableKind::kBatch, where);
  const std::string unread = unread_columns(batch, told);
  if (!unread.empty()) fmt::print(stderr, "note: {}: {}\n", where, shown(unread));
}

}  // namespace trammel::cli
