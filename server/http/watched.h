#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "server/metrics/service_figures.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"

namespace trammel {

/// The phase of a server's life. Only while it serves may its parts be asked from other threads.
enum class ServerPhase { kStarting, kServing, kStopping };

/// The server whose state is shown. All references outlive their users.
struct Watched {
  std::string server_id;
  std::string program_version;
  std::string store_path;
  const Trainer& trainer;
  const Store& store;
  const ModelRegistry& registry;
  std::function<ServiceFigures()> figures;
  std::function<Movement()> movement;  ///< waits for nothing
};

}  // namespace trammel
