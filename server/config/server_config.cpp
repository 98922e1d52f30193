#include "server/config/server_config.h"

#include <arpa/inet.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "server/base/near_miss.h"
#include "server/base/text_file.h"
#include "server/base/yaml_file.h"
#include "server/compensate/model_spec.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

constexpr std::size_t kMaxName = 64;  // likewise, bytes
constexpr int kLeastMemory =
    64;  // MiB, of a job: the program's own memory, and a minimum to compute with
constexpr int kMaxDomain = 232;  // above it the port numbers of DDS overflow

int integer_within(const YamlMap& map, const std::string& key, int otherwise, int lower,
                   int upper) {
  const int value = map.integer(key, otherwise);
  if (value < lower || value > upper)
    map.refuse(key, refused("{}, limit {} to {}", value, lower, upper)
                        .beyond(value, value < lower ? lower : upper));
  return value;
}

double number_within(const YamlMap& map, const std::string& key, double otherwise, double lower,
                     double upper) {
  const double value = map.number(key, otherwise);
  if (value < lower || value > upper)
    map.refuse(key, refused("{}, limit {} to {}", value, lower, upper)
                        .beyond(value, value < lower ? lower : upper));
  return value;
}

std::string server_id(const YamlMap& map, const std::string& key) {
  const std::string id = map.text(key);
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '-';
  };
  if (id.empty() || id.size() > kMaxName || !std::all_of(id.begin(), id.end(), allowed)) {
    map.refuse(key, refused("'{}', expected 1 to {} letters, digits, '.', '_', '-'", id, kMaxName)
                        .with_text(id));
  }
  return id;
}

/// The security settings of the file. An unreadable word is reported by itself, without a further
/// error about the address.
struct Consent {
  bool network = true;
  bool without_security = true;
};

Consent consent(const YamlMap& map) {
  Consent given;
  map.attempt([&] { given.network = map.boolean("allow_network", false); });
  map.attempt([&] { given.without_security = map.boolean("without_security", false); });
  return given;
}

/// Reads an IPv4 address. Refuses addresses other than loopback unless the network is allowed, and
/// unless the file states who may do what there, or that everybody may do everything.
std::string address(const YamlMap& map, const std::string& otherwise, const Consent& given) {
  const std::string text = map.text("address", otherwise);
  in_addr parsed{};
  if (::inet_pton(AF_INET, text.c_str(), &parsed) != 1) {
    map.refuse("address", refused("'{}' is no IPv4 address", text).with_text(text));
  }
  const bool loopback = (ntohl(parsed.s_addr) >> 24) == 127;
  if (!loopback && !given.network) {
    map.refuse("address", refused("{} leaves this host", text)
                              .with_text(text)
                              .next("say allow_network: true if that is meant"));
  }
  if (!loopback && map.is_null("security") && !given.without_security) {
    map.refuse("address",
               refused("whoever reaches {} could change models", text)
                   .with_text(text)
                   .next("name certificates (security: FOLDER, see deploy/security/README.md), or "
                         "say without_security: true if that is meant"));
  }
  return text;
}

/// The position of each entry is its number, so no number occurs twice.
std::vector<HostPort> discovery_servers(const YamlMap& map, const DdsOptions& dds) {
  const std::string key = "discovery_servers";
  std::vector<HostPort> places;
  if (!map.has(key)) return places;
  for (const std::string& text : map.texts(key)) {
    const auto place = parse_host_port(text, kDiscoveryPort);
    if (!place) map.refuse(key, refused("{}", place.error().message).with_text(text));
    if (std::find(places.begin(), places.end(), *place) != places.end())
      map.refuse(key, refused("{} is given twice", text).with_text(text));
    if (dds.address.starts_with("127.") && !place->address.starts_with("127."))
      map.refuse(
          key, refused("{} is not on this host, and nobody there can come to {}", text, dds.address)
                   .with_text(text)
                   .next("say the address that clients come to (address, allow_network)"));
    places.push_back(*place);
  }
  if (places.size() > kMostDiscoveryServers)
    map.refuse(key, refused("{} discovery servers, limit {}", places.size(), kMostDiscoveryServers)
                        .beyond(static_cast<double>(places.size()),
                                static_cast<double>(kMostDiscoveryServers)));
  return places;
}

void read_dds(const YamlMap& map, const std::filesystem::path& folder, DdsOptions& dds) {
  map.only({"domain", "address", "allow_network", "without_security", "security", "port",
            "discovery_servers", "compute_workers", "max_clients", "client_requests", "client_mb",
            "queued_requests", "queued_mb", "cell_share", "ros2"});
  map.attempt([&] {
    dds.domain = static_cast<std::uint32_t>(
        integer_within(map, "domain", static_cast<int>(dds.domain), 0, kMaxDomain));
  });
  const Consent given = consent(map);
  map.attempt([&] { dds.address = address(map, dds.address, given); });
  map.attempt([&] {
    dds.port = static_cast<std::uint16_t>(integer_within(map, "port", dds.port, 1024, 65535));
  });
  map.attempt([&] { dds.discovery_servers = discovery_servers(map, dds); });
  map.attempt([&] {
    if (!map.is_null("security")) dds.security = (folder / map.text("security")).string();
  });
  map.attempt([&] {
    dds.compute_workers = integer_within(map, "compute_workers", dds.compute_workers, 1, 64);
  });
  map.attempt(
      [&] { dds.max_clients = integer_within(map, "max_clients", dds.max_clients, 1, 10000); });
  map.attempt([&] {
    dds.client_requests = integer_within(map, "client_requests", dds.client_requests, 1, 10000);
  });
  map.attempt([&] { dds.client_mb = integer_within(map, "client_mb", dds.client_mb, 40, 65536); });
  map.attempt([&] {
    dds.queued_requests = integer_within(map, "queued_requests", dds.queued_requests, 1, 1000000);
  });
  map.attempt([&] { dds.queued_mb = integer_within(map, "queued_mb", dds.queued_mb, 80, 65536); });
  map.attempt([&] { dds.cell_share = number_within(map, "cell_share", dds.cell_share, 0.5, 1); });
  map.attempt([&] { dds.ros2 = map.boolean("ros2", dds.ros2); });
  if (dds.ros2 && !dds.security.empty())
    map.refuse(
        "ros2",
        refused("ROS 2 nodes have no role, so that nobody may let them in beside `security`"));
}

std::string word_of(const YamlMap& map, const std::string& key, const std::string& otherwise,
                    const std::vector<std::string>& known) {
  const std::string word = map.text(key, otherwise);
  if (std::find(known.begin(), known.end(), word) == known.end())
    map.refuse(
        key, refused("'{}', expected {}{}", word, fmt::join(known, ", "), did_you_mean(word, known))
                 .with_text(word));
  return word;
}

void read_record(const YamlMap& map, const std::filesystem::path& folder, RecordOptions& record) {
  map.only({"folder", "max_mb"});
  map.attempt([&] { record.folder = (folder / map.text("folder")).string(); });
  map.attempt([&] { record.max_mb = integer_within(map, "max_mb", record.max_mb, 8, 1'000'000); });
}

void read_trainer(const YamlMap& map, TrainerOptions& trainer) {
  map.only({"queue_capacity", "max_poses", "validation_share", "accept_ratio", "seed", "memory_mb",
            "cpu_s", "keep_models", "keep_batches", "keep_answers"});
  map.attempt([&] {
    trainer.queue_capacity = integer_within(map, "queue_capacity", trainer.queue_capacity, 1, 1000);
  });
  map.attempt(
      [&] { trainer.max_poses = integer_within(map, "max_poses", trainer.max_poses, 10, 20000); });
  map.attempt([&] {
    trainer.validation_share =
        number_within(map, "validation_share", trainer.validation_share, 0.05, 0.5);
  });
  map.attempt([&] {
    trainer.accept_ratio = number_within(map, "accept_ratio", trainer.accept_ratio, 0.1, 10);
  });
  map.attempt([&] {
    trainer.seed = static_cast<std::uint64_t>(integer_within(
        map, "seed", static_cast<int>(trainer.seed), 0, std::numeric_limits<int>::max()));
  });
  KeepRule& keep = trainer.keep;
  map.attempt([&] { keep.models = integer_within(map, "keep_models", keep.models, 0, 1000000); });
  map.attempt(
      [&] { keep.batches = integer_within(map, "keep_batches", keep.batches, 0, 1000000); });
  map.attempt(
      [&] { keep.answers = integer_within(map, "keep_answers", keep.answers, 0, 1000000); });
  ComputeOptions& compute = trainer.compute;
  map.attempt([&] {
    const int memory = integer_within(map, "memory_mb", compute.memory_mb, 0, 1 << 24);
    if (memory != 0 && memory < kLeastMemory)
      map.refuse("memory_mb", refused("{}, limit 0 or {} to {}", memory, kLeastMemory, 1 << 24)
                                  .beyond(memory, kLeastMemory));
    compute.memory_mb = memory;
  });
  map.attempt(
      [&] { compute.cpu_s = integer_within(map, "cpu_s", compute.cpu_s, 1, 30 * 24 * 3600); });
}

/// Reads the address of pages, metrics and requests, and what guards them. An address that leaves
/// this host needs all of it.
void read_http(const YamlMap& map, HttpOptions& http, const std::filesystem::path& folder) {
  map.only({"address", "port", "api", "allow_network", "tokens", "certificate", "key"});
  map.attempt([&] { http.api = map.boolean("api", http.api); });
  map.attempt([&] { http.allow_network = map.boolean("allow_network", http.allow_network); });
  const auto file_of = [&](const char* key, std::string& path) {
    map.attempt([&] {
      if (map.has(key) && !map.is_null(key)) path = (folder / map.text(key)).string();
    });
  };
  file_of("tokens", http.tokens);
  file_of("certificate", http.certificate);
  file_of("key", http.key);
  map.attempt([&] {
    http.address = map.text("address", http.address);
    in_addr parsed{};
    const bool is_address = ::inet_pton(AF_INET, http.address.c_str(), &parsed) == 1;
    const bool stays = is_address && ntohl(parsed.s_addr) >> 24 == 127;
    if (is_address && !stays && http.allow_network &&
        (http.tokens.empty() || !http.has_tls() || http.key.empty()))
      map.refuse("address", refused("'{}' leaves this host: it needs `tokens`, `certificate` and "
                                    "`key`",
                                    http.address)
                                .with_text(http.address));
    if (!is_address || (!stays && !http.allow_network))
      map.refuse("address", refused("'{}', expected 127.x.x.x: pages and metrics stay on this host",
                                    http.address)
                                .with_text(http.address));
  });
  map.attempt([&] {
    if (!map.is_null("port"))
      http.port = static_cast<std::uint16_t>(integer_within(map, "port", 0, 1024, 65535));
  });
}

void read_log(const YamlMap& map, LogOptions& log, const std::filesystem::path& folder) {
  map.only({"level", "file", "format"});
  map.attempt([&] {
    log.level = word_of(map, "level", log.level, {"debug", "info", "warn", "error"});
  });
  map.attempt([&] { log.format = word_of(map, "format", log.format, {"text", "json"}); });
  map.attempt([&] {
    if (!map.is_null("file")) log.file = (folder / map.text("file")).string();
  });
}

/// The server file alone, and the cell files it names.
struct ServerFile {
  ServerConfig config;
  std::vector<std::string> cell_files;
};

std::vector<std::string> cell_files_of(const YamlMap& map, const std::filesystem::path& folder) {
  std::vector<std::string> files;
  for (const std::string& cell : map.texts("cells")) files.push_back((folder / cell).string());
  if (files.empty() || files.size() > kMaxCells) {
    map.refuse("cells", refused("{} cell files, limit 1 to {}", files.size(), kMaxCells)
                            .beyond(files.size(), files.empty() ? 1 : kMaxCells));
  }
  return files;
}

std::string store_of(const YamlMap& map, const std::filesystem::path& folder) {
  const std::string store = map.text("store");
  if (store.empty()) map.refuse("store", "expected a path, or a URL of PostgreSQL");
  return is_postgres_url(store) ? store : (folder / store).string();
}

void read_server_map(const YamlMap& map, const std::filesystem::path& folder, ServerFile& file) {
  if (map.has("replica"))
    map.refuse(
        "replica",
        "no server follows another one; give all of them one `store: postgresql://...` instead");
  map.only({"version", "server", "cells", "store", "cache", "models_in_memory_mb", "serves",
            "trains", "record", "dds", "trainer", "log", "http"});
  map.attempt([&] {
    if (map.integer("version", 0) != 1)
      map.refuse("version", refused("expected 1").beyond(map.integer("version", 0), 1));
  });
  ServerConfig& config = file.config;
  map.attempt([&] { config.dds.server_id = server_id(map, "server"); });
  map.attempt([&] { file.cell_files = cell_files_of(map, folder); });
  map.attempt([&] { config.store = store_of(map, folder); });
  map.attempt([&] { config.cache = (folder / map.text("cache", "trammel-cache")).string(); });
  map.attempt([&] {
    const auto otherwise = static_cast<int>(config.models_in_memory >> 20);
    config.models_in_memory = static_cast<std::size_t>(integer_within(map, "models_in_memory_mb",
                                                                      otherwise, 64, 1'000'000))
                              << 20;
  });
  map.attempt([&] { config.serves = map.boolean("serves", true); });
  map.attempt([&] {
    config.trainer.trains = map.boolean("trains", true);
    if (!config.serves && !config.trainer.trains)
      map.refuse("trains", "a server that does not serve is there to train");
  });
  map.attempt([&] {
    if (map.has("dds")) read_dds(map.map("dds"), folder, config.dds);
  });
  map.attempt([&] {
    if (!map.is_null("record")) read_record(map.map("record"), folder, config.dds.record);
  });
  map.attempt([&] {
    if (map.has("trainer")) read_trainer(map.map("trainer"), config.trainer);
  });
  map.attempt([&] {
    if (map.has("log")) read_log(map.map("log"), config.log, folder);
  });
  map.attempt([&] {
    if (map.has("http")) read_http(map.map("http"), config.http, folder);
  });
}

/// A start waits for no pipe.
Result<Cell> read_cell_file(const std::string& cell_file) {
  std::error_code unknown;
  if (std::filesystem::exists(cell_file, unknown) &&
      !std::filesystem::is_regular_file(cell_file, unknown))
    return refused("no file, but a pipe, a device or a folder").in(cell_file);
  return read_cell(cell_file);
}

void read_cells(const std::string& path, ServerFile& file, std::vector<Error>& problems) {
  std::map<std::string, std::string> file_of;
  for (const std::string& cell_file : file.cell_files) {
    auto cell = read_cell_file(cell_file);
    if (!cell) {
      for (Error& one : apart(cell.error())) {
        problems.push_back(Failure(std::move(one))
                               .next(fmt::format("{} names it as one of its cells", path))
                               .value());
      }
      continue;
    }
    const std::string name = cell->name;
    if (name.size() > kMaxName)
      problems.push_back(refused("name of {} bytes, limit {}", name.size(), kMaxName)
                             .under("cell")
                             .in(cell_file)
                             .beyond(name.size(), kMaxName)
                             .value());
    if (const auto [other, is_new] = file_of.emplace(name, cell_file); !is_new)
      problems.push_back(refused("{} and {} are both called {}", other->second, cell_file, name)
                             .under("cells")
                             .in(path)
                             .with_text(name)
                             .value());
    for (Error& one : check_model_spec(*cell, cell_file)) problems.push_back(std::move(one));
    file.config.cells[name] = std::make_shared<const Cell>(std::move(*cell));
  }
}

}  // namespace

ServerReading read_server(const std::string& path) {
  const auto text = read_text_file(path);
  if (!text) return {{}, {text.error()}};
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  ServerFile file;
  std::vector<Error> problems;
  const auto read = read_yaml(*text, path, [&](const YamlMap& map) {
    read_server_map(map, folder, file);
    return true;
  });
  if (!read) problems = apart(read.error());
  read_cells(path, file, problems);
  return {std::move(file.config), std::move(problems)};
}

Result<ServerConfig> read_server_config(const std::string& path) {
  ServerReading reading = read_server(path);
  if (!reading.problems.empty()) return Failure(together(std::move(reading.problems)));
  return std::move(reading.config);
}

}  // namespace trammel
