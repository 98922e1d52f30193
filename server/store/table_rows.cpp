#include "server/store/table_rows.h"

#include <bit>
#include <charconv>
#include <set>
#include <string_view>

#include "server/base/hash.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

constexpr std::size_t kRowsAtOnce = 20;  // a text may be of 30 MB

using Kind = StoreColumn::Kind;

/// Names with their kinds: i (integer), n (number) or b (bytes).
std::vector<StoreColumn> columns_of(std::initializer_list<std::pair<const char*, char>> spelled) {
  std::vector<StoreColumn> columns;
  for (const auto& [name, kind] : spelled)
    columns.push_back({name, kind == 'i'   ? Kind::kInteger
                             : kind == 'n' ? Kind::kNumber
                                           : Kind::kBytes});
  return columns;
}

const std::vector<StoreTable> kTables = {
    {"store_identity", 1, columns_of({{"id", 'b'}})},
    {"cells", 1, columns_of({{"cell", 'b'}, {"last_version", 'i'}})},
    {"jobs", 1,
     columns_of({{"id", 'i'},
                 {"cell", 'b'},
                 {"level", 'b'},
                 {"bias", 'b'},
                 {"state", 'b'},
                 {"message", 'b'},
                 {"created_at", 'i'},
                 {"model_version", 'i'},
                 {"attempts", 'i'},
                 {"kind", 'b'}})},
    {"batches", 1,
     columns_of({{"number", 'i'},
                 {"cell", 'b'},
                 {"id", 'b'},
                 {"csv", 'b'},
                 {"hash", 'b'},
                 {"request_id", 'b'},
                 {"accepted_at", 'i'},
                 {"poses", 'i'},
                 {"job", 'i'},
                 {"quarantine", 'b'}})},
    {"job_batches", 2,
     columns_of({{"job", 'i'}, {"position", 'i'}, {"cell", 'b'}, {"batch", 'b'}})},
    {"models", 2,
     columns_of({{"cell", 'b'},
                 {"version", 'i'},
                 {"id", 'b'},
                 {"hash", 'b'},
                 {"level", 'b'},
                 {"batch_id", 'b'},
                 {"created_at", 'i'},
                 {"training_poses", 'i'},
                 {"validation_rms", 'n'},
                 {"content", 'b'}})},
    {"activations", 1,
     columns_of(
         {{"number", 'i'}, {"cell", 'b'}, {"version", 'i'}, {"back", 'i'}, {"activated_at", 'i'}})},
    {"diagnoses", 1,
     columns_of({{"job", 'i'}, {"csv", 'b'}, {"apply", 'i'}, {"findings", 'b'}, {"page", 'b'}})},
    {"job_times", 1, columns_of({{"job", 'i'}, {"started_at", 'i'}, {"finished_at", 'i'}})},
    {"job_outcomes", 1,
     columns_of({{"job", 'i'},
                 {"verdict", 'b'},
                 {"before_m", 'n'},
                 {"after_m", 'n'},
                 {"limit_m", 'n'},
                 {"code", 'b'},
                 {"why", 'b'},
                 {"next_step", 'b'},
                 {"peak_bytes", 'i'},
                 {"processor_s", 'n'},
                 {"held_back", 'b'}})},
    {"job_releases", 3, columns_of({{"job", 'i'}, {"cell", 'b'}, {"batch", 'b'}})},
    {"health_checks", 1, columns_of({{"job", 'i'}, {"tolerance_m", 'n'}})},
    {"activation_figures", 1,
     columns_of(
         {{"number", 'i'}, {"before_m", 'n'}, {"after_m", 'n'}, {"limit_m", 'n'}, {"why", 'b'}})},
    {"model_times", 2,
     columns_of({{"cell", 'b'}, {"version", 'i'}, {"trained_at", 'i'}, {"measured_at", 'i'}})},
    {"changes", 1,
     columns_of({{"number", 'i'},
                 {"id", 'b'},
                 {"asked", 'b'},
                 {"version", 'i'},
                 {"job", 'i'},
                 {"made_at", 'i'}})},
    {"pruned", 3, columns_of({{"kind", 'b'}, {"cell", 'b'}, {"id", 'b'}})},
    {"discarded", 2, columns_of({{"cell", 'b'}, {"batch", 'b'}})},
    {"audit", 1,
     columns_of({{"number", 'i'},
                 {"at", 'i'},
                 {"who", 'b'},
                 {"cell", 'b'},
                 {"what", 'b'},
                 {"subject", 'b'},
                 {"before", 'b'},
                 {"after", 'b'},
                 {"why", 'b'},
                 {"request", 'b'},
                 {"hash_before", 'b'},
                 {"hash", 'b'},
                 {"server", 'b'}})}};

/// `a, b, c`, or `$1, $2, $3` where `placeholders`.
std::string list_of(const StoreTable& table, std::size_t count, bool placeholders) {
  std::string list;
  for (std::size_t i = 0; i < count; ++i)
    list += (i == 0 ? "" : ", ") +
            (placeholders ? fmt::format("${}", i + 1) : std::string(table.columns[i].name));
  return list;
}

/// As list_of(); a column that an older file lacks has its value after an upgrade.
std::string selected_columns(Database& database, const StoreTable& table) {
  if (database.is_shared()) return list_of(table, table.columns.size(), false);
  std::set<std::string> there;
  Rows rows = prepare(database, "SELECT name FROM pragma_table_info($1)", table.name);
  while (rows.next()) there.insert(rows.text(0));
  std::string list;
  for (const StoreColumn& column : table.columns) {
    const bool is_there = there.empty() || there.contains(column.name);
    const char* otherwise = column.kind == Kind::kBytes ? "''" : "NULL";
    list += (list.empty() ? "" : ", ") + std::string(is_there ? column.name : otherwise);
  }
  return list;
}

StoredValue value_of(const Rows& row, int column, Kind kind) {
  if (row.is_null(column)) return nullptr;
  if (kind == Kind::kInteger) return row.integer64(column);
  if (kind == Kind::kNumber) return row.number(column);
  return row.text(column);
}

SqlValue bound(const StoredValue& value) {
  if (const auto* text = std::get_if<std::string>(&value)) return std::string_view(*text);
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return *integer;
  if (const auto* number = std::get_if<double>(&value)) return *number;
  return nullptr;
}

/// Each value with its length, so that no two rows are spelled alike.
std::string spelled(const StoredRow& row) {
  std::string text;
  for (const StoredValue& value : row) {
    std::string one = "null";
    if (const auto* bytes = std::get_if<std::string>(&value)) {
      one = "b" + *bytes;
    } else if (const auto* integer = std::get_if<std::int64_t>(&value)) {
      one = fmt::format("i{}", *integer);
    } else if (const auto* number = std::get_if<double>(&value)) {
      one = fmt::format("n{:016x}", std::bit_cast<std::uint64_t>(*number));
    }
    text += fmt::format("{}:", one.size()) + one;
  }
  return text;
}

}  // namespace

const std::vector<StoreTable>& store_tables() { return kTables; }

void each_row(Database& database, const StoreTable& table,
              const std::function<bool(const StoredRow&)>& visit) {
  const auto keys = static_cast<std::size_t>(table.keys);
  const std::string names = list_of(table, keys, false);
  const std::string all =
      fmt::format("SELECT {} FROM {} ", selected_columns(database, table), table.name);
  const std::string order = fmt::format("ORDER BY {} LIMIT {}", names, kRowsAtOnce);
  const std::string first = all + order;
  const std::string next =
      fmt::format("{}WHERE ({}) > ({}) {}", all, names, list_of(table, keys, true), order);
  for (StoredRow last;;) {
    std::vector<SqlValue> after;
    for (std::size_t i = 0; i < keys && !last.empty(); ++i) after.push_back(bound(last[i]));
    Rows rows = database.run(after.empty() ? first.c_str() : next.c_str(), Database::Values(after));
    std::vector<StoredRow> page;
    while (rows.next()) {
      StoredRow& row = page.emplace_back();
      for (std::size_t i = 0; i < table.columns.size(); ++i)
        row.push_back(value_of(rows, static_cast<int>(i), table.columns[i].kind));
    }
    for (const StoredRow& row : page) {
      if (!visit(row)) return;
    }
    if (page.size() < kRowsAtOnce) return;
    last = std::move(page.back());
  }
}

void insert_row(Database& database, const StoreTable& table, const StoredRow& row) {
  const std::size_t count = table.columns.size();
  const std::string sql = fmt::format("INSERT INTO {} ({}) VALUES ({})", table.name,
                                      list_of(table, count, false), list_of(table, count, true));
  std::vector<SqlValue> values;
  for (const StoredValue& value : row) values.push_back(bound(value));
  database.change(sql.c_str(), Database::Values(values));
}

void TableHash::add(const StoredRow& row) {
  ++rows_;
  const std::string hash = sha256_hex(spelled(row));
  for (std::size_t i = 0; i < sum_.size(); ++i) {
    std::uint8_t byte = 0;
    std::from_chars(hash.data() + 2 * i, hash.data() + 2 * i + 2, byte, 16);
    sum_[i] ^= byte;
  }
}

TableDigest TableHash::of(const StoreTable& table) const {
  TableDigest digest{table.name, rows_, ""};
  for (const std::uint8_t byte : sum_) digest.hash += fmt::format("{:02x}", byte);
  return digest;
}

}  // namespace trammel
