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
#include "server/store/store_place.h"
#include "server/trainer/dark_cells.h"

namespace trammel {

namespace {

/// True if the section was read without errors. A value that was refused is not checked further.
bool was_read(const ServerReading& server, const std::string& section) {
  return std::none_of(server.problems.begin(), server.problems.end(), [&](const Error& problem) {
    return problem.field.starts_with(section + ":");
  });
}

/// The error `found` in the path or address at `key`, told as an error of the server file.
Error at_key(const std::string& key, const std::string& path, Error found) {
  const std::string named = std::exchange(found.file, "");
  if (!named.empty()) found.message = named + ": " + found.message;
  found.field.clear();
  return Failure(std::move(found)).with_text(named).under(key).in(path).value();
}

/// Looks at the models in force as this program would serve them.
void look_at_cells(const ServerConfig& config, StartCheck& check) {
  const auto cells = cells_at_start(config.store, config.cells);
  if (!cells) {
    check.notes.push_back("what the cells would be served with is not known: " +
                          sentence(cells.error()));
    return;
  }
  for (const CellAtStart& one : *cells) {
    switch (one.state) {
      case CellAtStart::State::kServed:
        break;
      case CellAtStart::State::kCopyServed:
        check.notes.push_back(one.why);
        break;
      case CellAtStart::State::kOlderServed:
        check.notes.push_back(
            fmt::format("cell {} would be served with an older version: {}", one.cell, one.why));
        break;
      case CellAtStart::State::kUntrained:
        check.notes.push_back(fmt::format("cell {} has no model yet", one.cell));
        break;
      case CellAtStart::State::kDark:
        check.dark.push_back(fmt::format("cell {} would go dark: {}", one.cell, one.why));
    }
  }
}

bool is_held(const Status& status) {
  return !status && status.error().code == ErrorCode::kConflict;
}

/// Collects the faults in the values of one server file.
class Verdict {
 public:
  Verdict(const std::string& path, StoreToCheck store, StartCheck& check)
      : path_(path), store_(store), check_(check) {}

  void add(const char* key, const Status& status) {
    if (!status) check_.problems.push_back(at_key(key, path_, status.error()));
  }
  /// If the server runs on a copy of the store, a file that another process holds is no problem.
  void add_holdable(const char* key, const Status& status) {
    if (store_ == StoreToCheck::kOwn || !is_held(status)) return add(key, status);
    check_.notes.push_back(fmt::format("{} is in use, which does not matter to this check: {}", key,
                                       sentence(status.error())));
  }

  /// A database that is away is not a problem either: the service starts without it.
  void add_store(const Status& store) {
    if (store || store.error().code != ErrorCode::kUnreachable) return add_holdable("store", store);
    check_.notes.push_back("the store is away, and the service would serve copies: " +
                           sentence(store.error()));
  }

 private:
  const std::string& path_;
  StoreToCheck store_;
  StartCheck& check_;
};

}  // namespace

StartCheck check_start(const ServerReading& server, const std::string& path, StoreToCheck whose) {
  const ServerConfig& config = server.config;
  StartCheck check{server.problems, {}, {}};
  Verdict verdict(path, whose, check);
  const Status store = config.store.empty() ? Status() : check_store(config.store);
  Status port;
  if (was_read(server, "dds"))
    port = PortLock::take(config.dds.address, config.dds.port).map([](const PortLock&) {});
  if (is_held(store) && is_held(port)) {
    check.notes.push_back(
        fmt::format("{}: runs already, it seems: {}", path, sentence(store.error())));
  } else {
    verdict.add_store(store);
    verdict.add_holdable(is_held(port) ? "dds: port" : "dds: address", port);
    const Status http = was_read(server, "http") ? check_http_options(config.http) : Status();
    verdict.add_holdable(is_held(http) ? "http: port" : "http: address", http);
  }
  if (was_read(server, "dds")) verdict.add("dds: security", check_security(config.dds.security));
  if (!config.log.file.empty()) verdict.add("log: file", check_writable(config.log.file));
  verdict.add("record: folder", check_records(config.dds.record));
  std::error_code error;
  const bool is_there = store || is_held(store);
  const bool has_content =
      is_postgres_url(config.store) || std::filesystem::exists(config.store, error);
  if (is_there && has_content) look_at_cells(config, check);
  return check;
}

}  // namespace trammel
