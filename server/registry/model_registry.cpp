#include "server/registry/model_registry.h"

#include "server/base/check.h"

namespace trammel {

std::shared_ptr<const ServedModel> ModelRegistry::in_force(const std::string& cell) const {
  const MutexLock lock(mutex_);
  const auto found = models_.find(cell);
  return found == models_.end() ? nullptr : found->second;
}

void ModelRegistry::publish(std::shared_ptr<const ServedModel> model) {
  TRAMMEL_CHECK(model != nullptr);
  const MutexLock lock(mutex_);
  models_[model->cell].swap(model);  // the model before is let go after the lock, with `model`
}

std::vector<std::shared_ptr<const ServedModel>> ModelRegistry::all() const {
  const MutexLock lock(mutex_);
  std::vector<std::shared_ptr<const ServedModel>> models;
  models.reserve(models_.size());
  for (const auto& [cell, model] : models_) models.push_back(model);
  return models;
}

}  // namespace trammel
