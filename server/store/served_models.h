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
  std::string hash;                 ///< that the store knows it by
  std::vector<std::string> copies;  ///< files beside the store
};
/// A model, and why it was not read from the store but from a copy: one sentence, or empty. Also
/// where only the hash that the store has of it is bad.
struct ReadModel {
  CompensatedModel model;
  std::string damage = {};
};
/// From the store or, where its text is bad or that of another model, from a copy. `where`: for
/// what is wrong.
[[nodiscard]] Result<ReadModel> read_model(const ModelOnDisk& on_disk, const std::string& where);

/// The versions that a cell would be served with, the one in force first, then those before it. The
/// visitor says whether one is good, and ends it. False: none was.
using ModelVisitor = std::function<bool(const ModelOnDisk&)>;

/// A store, a file or a database by its URL, read without changing it, also while services write
/// it. A file may be of an older schema.
class ServedModels {
 public:
  /// Refuses (kRefused) what is no store. A file that is not there has no models.
  [[nodiscard]] static Result<ServedModels> open(const std::string& place);

  /// A version that was in force and is not in the store has an error (kNotFound) as its text.
  [[nodiscard]] Result<bool> find(const std::string& cell, const ModelVisitor& serves) const;

 private:
  explicit ServedModels(std::string path) : path_(std::move(path)) {}
  std::string path_;  // empty: there is no file
};

}  // namespace trammel
