#include "tests/support/fleet_client.h"

#include <poll.h>

#include <algorithm>

#include "server/base/hash.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/virtual_cell.h"

namespace trammel::test {
namespace {

using nlohmann::json;

constexpr std::int64_t kUntilAnsweredUs = 90'000'000;  // then it stays unknown
constexpr int kMostPauseMs = 120;                      // between two questions
constexpr std::size_t kHashDigits = 16;                // of a hash, in the history

std::string short_hash(const std::string& hash) { return hash.substr(0, kHashDigits); }

void pause(int milliseconds) { ::poll(nullptr, 0, milliseconds); }

}  // namespace

std::optional<SharedBatches::Batch> SharedBatches::next(const std::string& cell) {
  const std::lock_guard lock(mutex_);
  auto& known = batches_[cell];
  if (known.size() >= static_cast<std::size_t>(most_)) return std::nullopt;
  const std::size_t number = known.size() + 1;
  known.push_back({fmt::format("b{}", number), number});
  return known.back();
}

std::optional<SharedBatches::Batch> SharedBatches::any(const std::string& cell,
                                                       std::mt19937_64& random) const {
  const std::lock_guard lock(mutex_);
  const auto known = batches_.find(cell);
  if (known == batches_.end() || known->second.empty()) return std::nullopt;
  return known
      ->second[std::uniform_int_distribution<std::size_t>(0, known->second.size() - 1)(random)];
}

std::string text_of(const AskedCell& cell, std::uint64_t seed) {
  SmallBatch small;
  small.seed = seed;
  std::string text = cell.small ? small_batch_csv(*cell.small, small) : virtual_batch_csv(60, seed);
  const std::string columns = "x_mm,y_mm", exchanged = "y_mm,x_mm";
  if (seed % 7 == 0) text.replace(text.find(columns), columns.size(), exchanged);
  return text;
}

FleetClient::FleetClient(int number, const client::SessionOptions& first,
                         const client::SessionOptions& other, const std::vector<AskedCell>& cells,
                         SharedBatches& batches, History& history, std::uint64_t seed)
    : number_(number),
      first_(opened(first)),
      other_(opened(other)),
      cells_(cells),
      batches_(batches),
      history_(history),
      random_(seed) {}

std::unique_ptr<client::Session> FleetClient::opened(const client::SessionOptions& options) {
  return demand(client::Session::open(options));
}

void FleetClient::work(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    one(cells_[std::uniform_int_distribution<std::size_t>(0, cells_.size() - 1)(random_)]);
    pause(std::uniform_int_distribution<int>(0, kMostPauseMs)(random_));
  }
}

void FleetClient::one(const AskedCell& cell) {
  using Ask = void (*)(FleetClient&, const AskedCell&);
  static const std::vector<std::pair<int, Ask>> kAsks = {
      {10, [](FleetClient& my, const AskedCell& its) { my.submit(its); }},
      {6, [](FleetClient& my, const AskedCell& its) { my.submit_again(its); }},
      {24, [](FleetClient& my, const AskedCell& its) { my.activate(its); }},
      {14, [](FleetClient& my, const AskedCell& its) { my.rollback(its); }},
      {5, [](FleetClient& my, const AskedCell& its) { my.train(its); }},
      {5, [](FleetClient& my, const AskedCell& its) { my.keep_out(its, false); }},
      {2, [](FleetClient& my, const AskedCell& its) { my.keep_out(its, true); }},
      {8, [](FleetClient& my, const AskedCell& its) { my.read_batch(its); }},
      {26, [](FleetClient& my, const AskedCell& its) { my.read_models(its.name); }}};
  int drawn = std::uniform_int_distribution<int>(0, 99)(random_);
  for (const auto& [share, ask] : kAsks) {
    if (drawn < share) return ask(*this, cell);
    drawn -= share;
  }
}

bool FleetClient::by_chance(double share) {
  return std::uniform_real_distribution<double>(0, 1)(random_) < share;
}

json FleetClient::record_of(const char* operation, const std::string& cell) const {
  return {{"op", operation}, {"cell", cell}, {"client", number_}};
}

void FleetClient::send_batch(const AskedCell& cell, const SharedBatches::Batch& batch,
                             const std::string& text) {
  json record = record_of("submit", cell.name);
  record["batch"] = batch.id;
  record["hash"] = sha256_hex(text);
  const std::int64_t until = monotonic_us() + kUntilAnsweredUs;
  std::string answer = "unknown";
  for (int tries = 0; answer == "unknown" && monotonic_us() < until; ++tries) {
    answer = history_.ask(record, [&]() -> Result<json> {
      return session(tries % 2 == 0 ? Server::kFirst : Server::kOther)
          .submit_measurements(cell.name, batch.id, text)
          .map([](std::int64_t job) {
            return json{{"value", job}};
          });
    });
  }
}

void FleetClient::submit(const AskedCell& cell) {
  if (const auto batch = batches_.next(cell.name))
    send_batch(cell, *batch, text_of(cell, batch->seed));
}

void FleetClient::submit_again(const AskedCell& cell) {
  const auto batch = batches_.any(cell.name, random_);
  if (!batch) return;
  const bool the_same = by_chance(0.6);
  send_batch(cell, *batch, text_of(cell, the_same ? batch->seed : batch->seed + 100'000));
}

template <typename Call>
void FleetClient::change(json record, const Call& call) {
  client::ChangeOptions options;
  options.force = true;
  options.id = fmt::format("client-{}-{}", number_, ++changes_);
  record["id"] = options.id;
  if (by_chance(0.6)) {
    options.expected_version = seen_[record["cell"].get<std::string>()].in_force;
    record["expected"] = *options.expected_version;
  }
  const std::int64_t until = monotonic_us() + kUntilAnsweredUs;
  std::string answer = "unknown";
  for (int tries = 0; answer == "unknown" && monotonic_us() < until; ++tries) {
    answer = history_.ask(record, [&] {
      return call(session(tries % 2 == 0 ? Server::kFirst : Server::kOther), options);
    });
  }
  if (by_chance(0.15))
    history_.ask(record, [&] {
      return call(session(by_chance(0.5) ? Server::kFirst : Server::kOther), options);
    });
}

void FleetClient::activate(const AskedCell& cell) {
  const int newest = seen_[cell.name].newest;
  if (newest == 0) return read_models(cell.name);
  const int version = std::uniform_int_distribution<int>(
      std::max(1, newest - 3), newest + (by_chance(0.1) ? 5 : 0))(random_);
  json record = record_of("activate", cell.name);
  record["version"] = version;
  change(std::move(record),
         [&](client::Session& session, const client::ChangeOptions& options) -> Result<json> {
           return session.activate(cell.name, version, options).map([](int now) {
             return json{{"value", now}};
           });
         });
}

void FleetClient::rollback(const AskedCell& cell) {
  change(record_of("rollback", cell.name),
         [&](client::Session& session, const client::ChangeOptions& options) -> Result<json> {
           return session.rollback(cell.name, options).map([](int now) {
             return json{{"value", now}};
           });
         });
}

void FleetClient::train(const AskedCell& cell) {
  const auto batch = batches_.any(cell.name, random_);
  if (!batch) return;
  json record = record_of("train", cell.name);
  record["batch"] = batch->id;
  change(std::move(record),
         [&](client::Session& session, const client::ChangeOptions& options) -> Result<json> {
           return session.train(cell.name, {batch->id}, "", "", options).map([](std::int64_t job) {
             return json{{"value", job}};
           });
         });
}

void FleetClient::keep_out(const AskedCell& cell, bool for_ever) {
  const auto batch = batches_.any(cell.name, random_);
  if (!batch) return;
  json record = record_of(for_ever ? "discard" : "release", cell.name);
  record["batch"] = batch->id;
  change(std::move(record),
         [&](client::Session& session, const client::ChangeOptions& options) -> Result<json> {
           return (for_ever ? session.discard(cell.name, batch->id, options)
                            : session.release(cell.name, batch->id, options))
               .map([] { return json::object(); });
         });
}

void FleetClient::read_batch(const AskedCell& cell) {
  const auto batch = batches_.any(cell.name, random_);
  if (!batch) return;
  json record = record_of("read", cell.name);
  record["batch"] = batch->id;
  record["state"] = "absent";
  history_.ask(record, [&]() -> Result<json> {
    return session(by_chance(0.5) ? Server::kFirst : Server::kOther)
        .export_batch(cell.name, batch->id)
        .map([](const std::string& text) {
          return json{{"state", "present"}, {"hash", sha256_hex(text)}};
        });
  });
}

void FleetClient::read_models(const std::string& cell) {
  history_.ask(record_of("models", cell), [&]() -> Result<json> {
    const auto models = session(by_chance(0.5) ? Server::kFirst : Server::kOther).models(cell);
    if (!models) return tl::make_unexpected(models.error());
    Seen& seen = seen_[cell];
    seen = {};
    json versions = json::object();
    for (const exchange::ModelInfo& model : *models) {
      versions[std::to_string(model.version)] = short_hash(model.hash);
      seen.newest = std::max(seen.newest, model.version);
      if (model.in_force) seen.in_force = model.version;
    }
    return json{{"in_force", seen.in_force}, {"newest", seen.newest}, {"versions", versions}};
  });
}

}  // namespace trammel::test
