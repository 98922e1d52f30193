#include "server/store/store_texts.h"

#include "server/base/hash.h"
#include "server/compensate/model_file.h"
#include "server/store/audit.h"
#include "server/store/audit_rows.h"
#include "server/store/table_rows.h"

namespace trammel {
namespace {

/// The columns of batches, as of models: cell, name, hash, text. A file of the first schema has
/// them, too.
const StoreTable& batches() {
  using Kind = StoreColumn::Kind;
  static const StoreTable table{"batches",
                                2,
                                {{"cell", Kind::kBytes},
                                 {"id", Kind::kBytes},
                                 {"hash", Kind::kBytes},
                                 {"csv", Kind::kBytes}}};
  return table;
}

const StoreTable& models() {
  using Kind = StoreColumn::Kind;
  static const StoreTable table{"models",
                                2,
                                {{"cell", Kind::kBytes},
                                 {"version", Kind::kInteger},
                                 {"hash", Kind::kBytes},
                                 {"content", Kind::kBytes}}};
  return table;
}

const std::string& text(const StoredRow& row, std::size_t column) {
  return std::get<std::string>(row.at(column));
}

Failure damaged(const std::string& what, const std::string& place) {
  return failure(ErrorCode::kInternal, "damaged: {}", what).in(place).next("take an older copy");
}

Status check_batch(const StoredRow& batch, const std::string& place) {
  if (text(batch, 3).empty() || sha256_hex(text(batch, 3)) == text(batch, 2)) return {};
  return damaged(
      fmt::format("batch {} of cell {} is not what was accepted", text(batch, 1), text(batch, 0)),
      place);
}

/// Checks a model by its own hashes and by the one in the store.
Status check_model(const StoredRow& model, const std::string& place) {
  if (text(model, 3).empty()) return {};
  const std::string name =
      fmt::format("version {} of cell {}", std::get<std::int64_t>(model.at(1)), text(model, 0));
  const auto hash = undamaged_hash(text(model, 3), name);
  if (!hash) return damaged(fmt::format("{}: {}", name, hash.error().message), place);
  if (*hash != text(model, 2)) return damaged(name + " is not the model that was stored", place);
  return {};
}

template <typename Check>
Status check_rows(Database& database, const StoreTable& table, const Check& check) {
  Status good;
  each_row(database, table, [&](const StoredRow& row) {
    good = check(row);
    return good.has_value();
  });
  return good;
}

}  // namespace

Status check_texts(Database& database, const std::string& place) {
  const Status good = check_rows(database, batches(),
                                 [&](const StoredRow& row) { return check_batch(row, place); });
  return good ? check_rows(database, models(),
                           [&](const StoredRow& row) { return check_model(row, place); })
              : good;
}

Result<TrailEnd> check_trail(Database& database) {
  AuditChain chain;
  AuditTrail trail;
  const AuditQuery last{"", 0, 1};
  while (read_more(database, last, chain, trail)) continue;
  if (trail.broken) return tl::make_unexpected(*trail.broken);
  return TrailEnd{trail.verified, trail.rows.empty() ? "" : trail.rows.back().hash};
}

}  // namespace trammel
