#include "server/config/reload.h"

namespace trammel {
namespace {

template <typename Value>
void take(const char* key, Value& present, const Value& file, std::vector<std::string>* changed) {
  if (present == file) return;
  present = file;
  changed->emplace_back(key);
}

template <typename Value>
void leave(const char* key, const Value& present, const Value& file,
           std::vector<std::string>* later) {
  if (present != file) later->emplace_back(key);
}

bool same_files(const Cell& a, const Cell& b) {
  return a.cell_yaml == b.cell_yaml && a.robot_yaml == b.robot_yaml;
}

void take_cells(ServedCells& present, const ServedCells& file, ReloadPlan* plan) {
  for (const auto& [name, cell] : file) {
    if (present.contains(name)) continue;
    const bool has_room = present.size() < kMaxCells;
    (has_room ? plan->now : plan->later).push_back(fmt::format("cells: {}", name));
    if (has_room) present[name] = cell;
  }
}

void leave_cells(const ServedCells& present, const ServedCells& file,
                 std::vector<std::string>* later) {
  for (const auto& [name, cell] : present) {
    const auto found = file.find(name);
    if (found == file.end()) later->push_back(fmt::format("cells: {} (left out)", name));
    if (found != file.end() && !same_files(*cell, *found->second))
      later->push_back(fmt::format("cells: {} (its file)", name));
  }
}

}  // namespace

ReloadPlan plan_reload(const ServerConfig& present, const ServerConfig& file) {
  ReloadPlan plan{present, {}, {}};
  ServerConfig& now = plan.config;
  take_cells(now.cells, file.cells, &plan);
  take("log: level", now.log.level, file.log.level, &plan.now);
  take("log: format", now.log.format, file.log.format, &plan.now);
  take("dds: client_requests", now.dds.client_requests, file.dds.client_requests, &plan.now);
  take("dds: client_mb", now.dds.client_mb, file.dds.client_mb, &plan.now);
  take("dds: queued_requests", now.dds.queued_requests, file.dds.queued_requests, &plan.now);
  take("dds: queued_mb", now.dds.queued_mb, file.dds.queued_mb, &plan.now);
  take("dds: cell_share", now.dds.cell_share, file.dds.cell_share, &plan.now);
  take("trainer: queue_capacity", now.trainer.queue_capacity, file.trainer.queue_capacity,
       &plan.now);
  take("trainer: keep_models", now.trainer.keep.models, file.trainer.keep.models, &plan.now);
  take("trainer: keep_batches", now.trainer.keep.batches, file.trainer.keep.batches, &plan.now);
  take("trainer: keep_answers", now.trainer.keep.answers, file.trainer.keep.answers, &plan.now);

  leave("server", present.dds.server_id, file.dds.server_id, &plan.later);
  leave("store", present.store, file.store, &plan.later);
  leave("cache", present.cache, file.cache, &plan.later);
  leave("serves", present.serves, file.serves, &plan.later);
  leave("trains", present.trainer.trains, file.trainer.trains, &plan.later);
  leave("dds: address", present.dds.address, file.dds.address, &plan.later);
  leave("dds: port", present.dds.port, file.dds.port, &plan.later);
  leave("dds: domain", present.dds.domain, file.dds.domain, &plan.later);
  leave("http: port", present.http.port, file.http.port, &plan.later);
  leave("http: api", present.http.api, file.http.api, &plan.later);
  leave("http: tokens", present.http.tokens, file.http.tokens, &plan.later);
  leave("http: certificate", present.http.certificate, file.http.certificate, &plan.later);
  leave("record", present.dds.record, file.dds.record, &plan.later);
  leave("models_in_memory_mb", present.models_in_memory, file.models_in_memory, &plan.later);
  leave("dds: discovery_servers", present.dds.discovery_servers, file.dds.discovery_servers,
        &plan.later);
  leave("dds: ros2", present.dds.ros2, file.dds.ros2, &plan.later);
  leave("dds: security", present.dds.security, file.dds.security, &plan.later);
  leave("dds: compute_workers", present.dds.compute_workers, file.dds.compute_workers, &plan.later);
  leave("dds: max_clients", present.dds.max_clients, file.dds.max_clients, &plan.later);
  leave("trainer: max_poses", present.trainer.max_poses, file.trainer.max_poses, &plan.later);
  leave("trainer: validation_share", present.trainer.validation_share,
        file.trainer.validation_share, &plan.later);
  leave("trainer: accept_ratio", present.trainer.accept_ratio, file.trainer.accept_ratio,
        &plan.later);
  leave("trainer: memory_mb", present.trainer.compute.memory_mb, file.trainer.compute.memory_mb,
        &plan.later);
  leave("trainer: cpu_s", present.trainer.compute.cpu_s, file.trainer.compute.cpu_s, &plan.later);
  leave("log: file", present.log.file, file.log.file, &plan.later);
  leave_cells(present.cells, file.cells, &plan.later);
  return plan;
}

}  // namespace trammel
