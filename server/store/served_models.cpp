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

Result<CompensatedModel> model_of_hash(const ModelOnDisk& on_disk, const std::string& where) {
  auto model = model_in(on_disk.text, where);
  if (model && model->provenance().hash != on_disk.hash)
    return failure(ErrorCode::kInternal, "the text is that of another model, sha256 {} instead of {}",
                   model->provenance().hash, on_disk.hash)
        .in(where);
  return model;
}

/// The copies of the store that is open.
void find_copies(Database& database, ServedCopies& copies) {
  if (!database.has_table("store_identity")) return;
  Rows id = prepare(database, "SELECT id FROM store_identity WHERE id != ''");
  if (id.next()) static_cast<void>(copies.belong_to(id.text(0), false));
}

}  // namespace

Result<ReadModel> read_model(const ModelOnDisk& on_disk, const std::string& where) {
  auto stored = model_of_hash(on_disk, where);
  if (stored) return ReadModel{std::move(*stored)};
  for (const std::string& file : on_disk.copies) {
    auto copied = model_in(read_text_file(file), file);
    if (!copied) continue;
    return ReadModel{std::move(*copied),
                     fmt::format("cell {}: version {} is served from its copy {}, since the text in "
                                 "the store is bad: {}",
                                 on_disk.cell, on_disk.version, file, sentence(stored.error()))};
  }
  return tl::make_unexpected(stored.error());
}

Result<ServedModels> ServedModels::open(const std::string& place) {
  std::error_code error;
  const bool is_file = !is_postgres_url(place);
  if (is_file && (!std::filesystem::exists(place, error) || std::filesystem::file_size(place, error) == 0))
    return ServedModels("");
  return look_into(place, [&](Database&) -> Result<ServedModels> { return ServedModels(place); });
}

Result<bool> ServedModels::has(const std::string& cell) const {
  if (path_.empty()) return false;
  return look_into(path_, [&](Database& database) -> Result<bool> {
    return exists(database, "SELECT 1 FROM activations WHERE cell = $1", cell);
  });
}

Result<bool> ServedModels::find(const std::string& cell, const ModelVisitor& serves) const {
  if (path_.empty()) return false;
  return look_into(path_, [&](Database& database) -> Result<bool> {
    ServedCopies copies(is_postgres_url(path_) ? "" : path_ + ".models");
    find_copies(database, copies);
    auto at =
        prepare(database,
                "WITH RECURSIVE chain (number, version, back, step) AS ("
                "SELECT * FROM (SELECT number, version, back, 0 FROM activations WHERE cell = $1 "
                "ORDER BY number DESC LIMIT 1) AS present UNION ALL "
                "SELECT a.number, a.version, a.back, step + 1 FROM chain JOIN activations a ON a.number = chain.back "
                "WHERE step + 1 < $2) "
                "SELECT models.version, models.content, models.hash FROM chain JOIN models "
                "ON models.cell = $1 AND models.version = chain.version ORDER BY step",
                cell, kMostLookedAt);
    while (at.next()) {
      const int version = at.integer(0);
      if (serves({cell, version, at.text(1), at.text(2), copies.files_of(cell, version)})) return true;
    }
    return false;
  });
}

}  // namespace trammel
