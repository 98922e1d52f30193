#pragma once

#include <string>
#include <utility>

#include "manage_models.h"

/// ManageModelsRequest::text means another thing for each action: here each meaning has its name.
namespace trammel::wire {

/// MANAGE_LIST, MANAGE_ACTIVATE, MANAGE_ROLLBACK, MANAGE_EXPORT: no text.
[[nodiscard]] inline ManageModelsRequest manage_version(ManageAction action, int version = 0) {
  ManageModelsRequest request;
  request.action(action);
  request.version(version);
  return request;
}

[[nodiscard]] inline ManageModelsRequest import_of_model(std::string model_text) {
  ManageModelsRequest request;
  request.action(MANAGE_IMPORT);
  request.text(std::move(model_text));
  return request;
}
[[nodiscard]] inline const std::string& imported_model(const ManageModelsRequest& import) { return import.text(); }

[[nodiscard]] inline ManageModelsRequest release_of_batch(std::string batch_id) {
  ManageModelsRequest request;
  request.action(MANAGE_RELEASE);
  request.text(std::move(batch_id));
  return request;
}
[[nodiscard]] inline const std::string& released_batch(const ManageModelsRequest& release) { return release.text(); }

/// `training_json`: see the action.
[[nodiscard]] inline ManageModelsRequest release_and_train_of(std::string training_json) {
  ManageModelsRequest request;
  request.action(MANAGE_RELEASE_AND_TRAIN);
  request.text(std::move(training_json));
  return request;
}
[[nodiscard]] inline const std::string& released_training(const ManageModelsRequest& release) { return release.text(); }

}  // namespace trammel::wire
