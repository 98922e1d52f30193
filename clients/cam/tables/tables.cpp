#include "clients/cam/tables/tables.h"

#include <fmt/format.h>

#include <algorithm>

#include "clients/cam/keep.h"
#include "server/base/letters.h"

namespace trammel::cam {

namespace {

/// The fields of a line, each with its place.
struct Row {
  int line = 1;
  std::vector<Token> fields;
};

/// Which columns hold the numbers of a pose.
struct Columns {
  Coordinates coordinates = Coordinates::kAnglesXyz;
  std::vector<std::size_t> at;
};

Token field_at(const std::string& text, std::size_t begin, std::size_t end, int line) {
  while (begin < end && (text[begin] == ' ' || text[begin] == '\t' || text[begin] == '"')) ++begin;
  while (end > begin && (text[end - 1] == ' ' || text[end - 1] == '\t' || text[end - 1] == '\r' ||
                         text[end - 1] == '"'))
    --end;
  return {TokenKind::kWord, begin, end, line, std::string_view(text).substr(begin, end - begin)};
}

/// The separator of a line: `;` if it has one, else a tab, else `,`.
char separator_of(std::string_view line) {
  for (const char c : {';', '\t'}) {
    if (line.find(c) != std::string_view::npos) return c;
  }
  return ',';
}

std::vector<Row> rows_of(const std::string& text) {
  std::vector<Row> rows;
  for (const TextLine& line : text_lines(text)) {
    const std::size_t first = line.text.find_first_not_of(" \t\r");
    if (first == std::string_view::npos || line.text[first] == '#') continue;
    Row& row = rows.emplace_back();
    row.line = line.number;
    const char separator = separator_of(line.text);
    for (std::size_t at = line.begin; at <= line.end;) {
      const std::size_t stop = std::min(text.find(separator, at), line.end);
      row.fields.push_back(field_at(text, at, stop, line.number));
      at = stop + 1;
    }
  }
  return rows;
}

/// The name of a column without its unit, in lower case.
std::string column_name(std::string_view text) {
  std::string made = lower(text.substr(0, text.find_first_of("[( ")));
  for (const char* unit : {"_mm", "_deg"}) {
    if (made.ends_with(unit)) made.erase(made.size() - std::string_view(unit).size());
  }
  return made;
}

/// The columns that a header names; empty where it names no pose.
std::optional<Columns> named_columns(const Row& header) {
  const auto all = [&](std::initializer_list<const char*> names) {
    std::vector<std::size_t> at;
    for (const char* name : names) {
      for (std::size_t k = 0; k < header.fields.size(); ++k) {
        if (column_name(header.fields[k].text) == name) {
          at.push_back(k);
          break;
        }
      }
    }
    return at.size() == names.size() ? at : std::vector<std::size_t>();
  };
  if (auto at = all({"x", "y", "z", "qw", "qx", "qy", "qz"}); !at.empty())
    return Columns{Coordinates::kQuaternion, at};
  if (auto at = all({"x", "y", "z", "a", "b", "c"}); !at.empty())
    return Columns{Coordinates::kAnglesZyx, at};
  if (auto at = all({"x", "y", "z", "rx", "ry", "rz"}); !at.empty())
    return Columns{Coordinates::kAnglesXyz, at};
  if (auto at = all({"x", "y", "z", "w", "p", "r"}); !at.empty())
    return Columns{Coordinates::kAnglesXyz, at};
  return std::nullopt;
}

class Tables {
 public:
  Tables(std::vector<SourceFile> files, const std::string& dialect, const std::string& frame,
         Columns bare, const ReadOptions& options)
      : bare_(std::move(bare)) {
    program_.dialect = dialect;
    program_.files = std::move(files);
    program_.tools.emplace_back();
    ProgramFrame& base = program_.frames.emplace_back();
    base.name = "base";
    if (take_row(frame, options, base)) base.name = frame;
  }

  Program read() {
    for (std::size_t f = 0; f < program_.files.size(); ++f) {
      const std::string& text = program_.files[f].text;
      program_.mark_places.push_back({first_byte(text), "# "});
      read_rows(f, rows_of(text));
    }
    return std::move(program_);
  }

 private:
  void read_rows(std::size_t f, const std::vector<Row>& rows) {
    Columns columns = bare_;
    bool any = false;
    for (const Row& row : rows) {
      const auto header = any ? std::nullopt : named_columns(row);
      if (header) columns = *header;
      any |= !header && read_row(f, row, columns);
    }
  }

  /// True if the row holds a pose. Other rows stay unchanged: a header, a remark.
  bool read_row(std::size_t f, const Row& row, const Columns& columns) {
    ProgramTarget target;
    for (const std::size_t column : columns.at) {
      if (column >= row.fields.size() || !keep(row.fields[column], target)) return false;
    }
    target.coordinates = columns.coordinates;
    target.name = fmt::format("row {}", row.line);
    target.file = f;
    target.line = row.line;
    target.used_at = {row.line};
    target.linear = true;
    program_.moves.push_back({f, row.line, {program_.targets.size()}, false});
    program_.targets.push_back(std::move(target));
    return true;
  }

  Program program_;
  Columns bare_;
};

}  // namespace

Program read_camrob(std::vector<SourceFile> files, const ReadOptions& options) {
  return Tables(std::move(files), "camrob", "CAMROB", {Coordinates::kAnglesZyx, {1, 2, 3, 4, 5, 6}},
                options)
      .read();
}

Program read_robodk(std::vector<SourceFile> files, const ReadOptions& options) {
  return Tables(std::move(files), "robodk", "ROBODK", {Coordinates::kAnglesXyz, {0, 1, 2, 3, 4, 5}},
                options)
      .read();
}

}  // namespace trammel::cam
