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

/// The model in force for each cell. Thread-safe. A reader gets the new model or the previous one, never a mixture, and
/// keeps it while it holds the pointer. Readers never wait for training.
class ModelRegistry {
 public:
  /// Null when the cell has no model in force.
  [[nodiscard]] std::shared_ptr<const ServedModel> in_force(const std::string& cell) const;
  /// Replaces the model of its cell. Readers that hold the previous one keep it.
  void publish(std::shared_ptr<const ServedModel> model);
  /// The model in force of every cell that has one, ordered by cell name.
  [[nodiscard]] std::vector<std::shared_ptr<const ServedModel>> all() const;

 private:
  mutable Mutex mutex_;
  std::map<std::string, std::shared_ptr<const ServedModel>> models_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
