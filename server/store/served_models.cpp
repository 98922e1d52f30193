#include "server/store/served_models.h"

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "server/base/text_file.h"
#include "server/compensate/model_file.h"
#include "server/store/open_to_read.h"
#include "server/store/served_copies.h"
#include "server/store/statements.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

constexpr int kMostLookedAt = 100;  // versions of a cell, as at a start

Result<CompensatedModel> model_in(const Result<std::string>& text, const std::string& where) {
  if (!text) return tl::make_unexpected(text.error());
  return deserialize(*text, where, ModelTexts::kAsTheyAre);
}

/// The text in the row of a version in force.
Result<std::string> text_at(const Rows& row, const std::string& cell, int version) {
  if (row.is_null(1))
    return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version);
  return row.text(1);
}

/// The copies of the store that is open.
void find_copies(Database& database, ServedCopies& copies) {
  if (!database.has_table("store_identity")) return;
  Rows id = prepare(database, "SELECT id FROM store_identity WHERE id != ''");
  if (id.next()) static_cast<void>(copies.belong_to(id.text(0), false));
}

}  // namespace

Result<ReadModel> read_model(const ModelOnDisk& on_disk, const std::string& where) {
  auto stored = model_in(on_disk.text, where);
  if (stored && stored->provenance().hash == on_disk.hash) return ReadModel{std::move(*stored)};
  const std::string hash_of_text = stored ? stored->provenance().hash : "";
  const Error why = stored ? failure(ErrorCode::kInternal,
                                     "the text is that of another model, sha256 {} instead of {}",
                                     hash_of_text, on_disk.hash)
                                 .in(where)
                                 .value()
                           : stored.error();
  for (const std::string& file : on_disk.copies) {
    auto copied = model_in(read_text_file(file), file);
    if (!copied) continue;
    const bool same_text = copied->provenance().hash == hash_of_text;
    const std::string bad =
        same_text
            ? fmt::format(
                  "the hash in the store is bad: it is {}, its text there and the copy have {}",
                  on_disk.hash.empty() ? "empty" : on_disk.hash, hash_of_text)
            : "the text in the store is bad: " + sentence(why);
    return ReadModel{std::move(*copied),
                     fmt::format("cell {}: version {} is served from its copy {}, since {}",
                                 on_disk.cell, on_disk.version, file, bad)};
  }
  return tl::make_unexpected(why);
}

Result<ServedModels> ServedModels::open(const std::string& place) {
  std::error_code error;
  const bool is_file = !is_postgres_url(place);
  if (is_file &&
      (!std::filesystem::exists(place, error) || std::filesystem::file_size(place, error) == 0))
    return ServedModels("");
  return look_into(place, [&](Database&) -> Result<ServedModels> { return ServedModels(place); });
}

Result<bool> ServedModels::find(const std::string& cell, const ModelVisitor& serves) const {
  if (path_.empty()) return false;
  return look_into(path_, [&](Database& database) -> Result<bool> {
    ServedCopies copies(is_postgres_url(path_) ? "" : path_ + ".models");
    find_copies(database, copies);
    auto at =
        prepare(database,
                "WITH RECURSIVE chain (number, version, back, step) AS (SELECT * FROM (SELECT "
                "number, version, back, 0 FROM activations WHERE cell = $1 ORDER BY number DESC "
                "LIMIT 1) AS present UNION ALL SELECT a.number, a.version, a.back, step + 1 FROM "
                "chain JOIN activations a ON a.number = chain.back WHERE step + 1 < $2) SELECT "
                "chain.version, models.content, models.hash FROM chain LEFT JOIN models ON "
                "models.cell = $1 AND models.version = chain.version ORDER BY step",
                cell, kMostLookedAt);
    while (at.next()) {
      const int version = at.integer(0);
      ModelOnDisk on_disk{cell, version, text_at(at, cell, version), "",
                          copies.files_of(cell, version)};
      if (!at.is_null(2)) on_disk.hash = at.text(2);
      if (serves(on_disk)) return true;
    }
    return false;
  });
}

}  // namespace trammel
