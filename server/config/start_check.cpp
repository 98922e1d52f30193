#include "server/config/start_check.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "server/base/text_file.h"
#include "server/dds/dds_service.h"
#include "server/dds/port_lock.h"
#include "server/http/http_server.h"
#include "server/store/store_check.h"
#include "server/trainer/dark_cells.h"

namespace trammel {

namespace {

/// Whether the section was read without errors. A value that was refused is not checked further.
bool was_read(const ServerReading& server, const std::string& section) {
  return std::none_of(server.problems.begin(), server.problems.end(),
                      [&](const Error& problem) { return problem.field.starts_with(section + ":"); });
}

/// The error `found` in the path or address at `key`, told as an error of the server file.
Error at_key(const std::string& key, const std::string& path, Error found) {
  const std::string named = std::exchange(found.file, "");
  if (!named.empty()) found.message = named + ": " + found.message;
  found.field.clear();
  return Failure(std::move(found)).with_text(named).under(key).in(path).value();
}

/// What this program would make of the models in force.
void look_at_cells(const ServerConfig& config, StartCheck& check) {
  const auto cells = cells_at_start(config.store, config.cells);
  if (!cells) {
    check.notes.push_back("what the cells would be served with is not known: " + sentence(cells.error()));
    return;
  }
  for (const CellAtStart& one : *cells) {
    switch (one.state) {
      case CellAtStart::State::kServed:
        break;
      case CellAtStart::State::kOlderServed:
        check.notes.push_back(fmt::format("cell {} would be served with an older version: {}", one.cell, one.why));
        break;
      case CellAtStart::State::kUntrained:
        check.notes.push_back(fmt::format("cell {} has no model yet", one.cell));
        break;
      case CellAtStart::State::kDark:
        check.dark.push_back(fmt::format("cell {} would go dark: {}", one.cell, one.why));
    }
  }
}

}  // namespace

StartCheck check_start(const ServerReading& server, const std::string& path) {
  const ServerConfig& config = server.config;
  StartCheck check{server.problems, {}, {}};
  const auto wrong = [&](const char* key, const Error& error) { check.problems.push_back(at_key(key, path, error)); };
  const Status store = config.store.empty() ? Status() : check_store(config.store);
  Status port;
  if (was_read(server, "dds")) port = PortLock::take(config.dds.address, config.dds.port).map([](const PortLock&) {});
  const bool store_held = !store && store.error().code == ErrorCode::kConflict;
  if (store_held && !port && port.error().code == ErrorCode::kConflict) {
    check.notes.push_back(fmt::format("{}: runs already, it seems: {}", path, sentence(store.error())));
  } else {
    if (!store) wrong("store", store.error());
    if (!port) wrong(port.error().code == ErrorCode::kConflict ? "dds: port" : "dds: address", port.error());
    const Status http = was_read(server, "http") ? check_http_options(config.http) : Status();
    if (!http) wrong(http.error().code == ErrorCode::kConflict ? "http: port" : "http: address", http.error());
  }
  const Status security = was_read(server, "dds") ? check_security(config.dds.security) : Status();
  if (!security) wrong("dds: security", security.error());
  if (!config.log.file.empty()) {
    if (const Status log = check_writable(config.log.file); !log) wrong("log: file", log.error());
  }
  if (const Status folder = check_records(config.dds.record); !folder) wrong("record: folder", folder.error());
  std::error_code error;
  const bool is_there = store || store_held;
  if (is_there && std::filesystem::exists(config.store, error)) look_at_cells(config, check);
  return check;
}

}  // namespace trammel
