#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// A version of a cell's model as it is on disk.
struct ModelOnDisk {
  std::string cell;
  int version = 0;
  Result<std::string> text;         ///< in the store
  std::string hash;                 ///< the hash in the store's record
  std::vector<std::string> copies;  ///< files beside the store
};
/// A model, and, if it was read from a copy instead of the store, the reason: one sentence, or
/// empty. A bad hash in the store is also such a reason.
struct ReadModel {
  CompensatedModel model;
  std::string damage = {};
};
/// Reads a model from the store. If its text is bad or belongs to another model, reads a copy.
/// `where`: the place in error messages.
[[nodiscard]] Result<ReadModel> read_model(const ModelOnDisk& on_disk, const std::string& where);

/// The versions with which a cell could be served, the one in force first, then earlier ones. The
/// visitor returns true for a good one, which ends the visit. False: none was good.
using ModelVisitor = std::function<bool(const ModelOnDisk&)>;

/// A store, a file or a database by its URL, read without changing it, also while services write
/// it. A file may be of an older schema.
class ServedModels {
 public:
  /// Refuses (kRefused) a place that is not a store. A missing file has no models.
  [[nodiscard]] static Result<ServedModels> open(const std::string& place);

  /// A version that was in force and is not in the store has an error (kNotFound) as its text.
  [[nodiscard]] Result<bool> find(const std::string& cell, const ModelVisitor& serves) const;

 private:
  explicit ServedModels(std::string path) : path_(std::move(path)) {}
  std::string path_;  // empty: there is no file
};

}  // namespace trammel
