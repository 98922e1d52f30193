#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// A model with its place in the cell's history.
struct ServedModel {
  std::string cell;
  int version = 0;
  CompensatedModel model;
};

/// The model in force for each cell. Thread-safe: a reader gets the whole model or the one before, and keeps it for as
/// long as it holds the pointer. Readers never wait for training.
class ModelRegistry {
 public:
  /// Null when the cell has no model in force.
  [[nodiscard]] std::shared_ptr<const ServedModel> in_force(const std::string& cell) const;
  /// Puts it in the place of its cell's model; those who hold the one before keep it.
  void publish(std::shared_ptr<const ServedModel> model);
  /// Of every cell that has one in force, by cell name.
  [[nodiscard]] std::vector<std::shared_ptr<const ServedModel>> all() const;

 private:
  mutable Mutex mutex_;
  std::map<std::string, std::shared_ptr<const ServedModel>> models_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
