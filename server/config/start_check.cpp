#include "server/config/start_check.h"

#include <algorithm>
#include <utility>

#include "server/base/text_file.h"
#include "server/dds/port_lock.h"
#include "server/store/store_check.h"

namespace trammel {

namespace {

/// A value that was refused is not looked for.
bool was_read(const ServerReading& server, const std::string& section) {
  return std::none_of(server.problems.begin(), server.problems.end(),
                      [&](const Error& problem) { return problem.field.starts_with(section + ":"); });
}

/// What is wrong with the path or address that stands at `key` of the server file.
Error at_key(const std::string& key, const std::string& path, Error found) {
  const std::string named = std::exchange(found.file, "");
  if (!named.empty()) found.message = named + ": " + found.message;
  found.field.clear();
  return Failure(std::move(found)).with_text(named).under(key).in(path).value();
}

}  // namespace

StartCheck check_start(const ServerReading& server, const std::string& path) {
  const ServerConfig& config = server.config;
  StartCheck check{server.problems, {}};
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
  }
  if (!config.log.file.empty()) {
    if (const Status log = check_writable(config.log.file); !log) wrong("log: file", log.error());
  }
  return check;
}

}  // namespace trammel
