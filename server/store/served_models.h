#pragma once

#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The texts of the versions that a cell would be served with, the one in force first, then those before it. `serves`
/// says whether one is good, and ends it. False: none was.
using ModelVisitor = std::function<bool(int version, const std::string& text)>;

/// A store's file, read without changing it, also while a service writes it and if it is of an older schema.
class ServedModels {
 public:
  /// Refuses (kRefused) what is no store. A file that is not there has no models.
  [[nodiscard]] static Result<ServedModels> open(const std::string& path);

  /// False: nothing of the cell was ever in force.
  [[nodiscard]] Result<bool> has(const std::string& cell) const;
  [[nodiscard]] Result<bool> find(const std::string& cell, const ModelVisitor& serves) const;

 private:
  explicit ServedModels(std::string path) : path_(std::move(path)) {}
  std::string path_;  // empty: there is no file
};

}  // namespace trammel
