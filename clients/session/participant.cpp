#include "clients/session/participant.h"

#include <fmt/format.h>

#include <random>

#include "idl/transport/places.h"

namespace trammel::client {
namespace {

constexpr std::uint32_t kHighestDomain = 232;   // above it, the ports of DDS exceed those of UDP
constexpr std::size_t kHomesRemembered = 1000;  // of a session's jobs
constexpr int kShareOfLooking = 2;  // of the timeout: its half at most, for discovery servers

/// Adds the servers that the discovery servers announce. If other servers are named, none of these
/// is needed.
Status add_found_places(SessionOptions& options) {
  const auto places = wire::look_for_places(options.discovery_servers, options.domain,
                                            options.timeout / kShareOfLooking);
  if (!places)
    return options.servers.empty() ? Status(tl::make_unexpected(places.error())) : Status();
  for (const HostPort& place : *places) {
    if (std::find(options.servers.begin(), options.servers.end(), place) == options.servers.end())
      options.servers.push_back(place);
  }
  return {};
}

Failure ambiguous(std::int64_t number, const std::string& one, const std::string& other) {
  return refused("servers {} and {} both have a job {}: each counts its own", one, other, number)
      .next("name one of them alone");
}

}  // namespace

std::string make_name(const char* what) {
  std::random_device random;
  return fmt::format("{}-{:08x}{:08x}{:08x}{:08x}", what, random(), random(), random(), random());
}

std::string change_id(const ChangeOptions& options) {
  return options.id.empty() ? make_name("change") : options.id;
}

wire::Change to_wire(const ChangeOptions& options) {
  wire::Change change;
  change.id(change_id(options));
  change.expected_version(options.expected_version.value_or(-1));
  return change;
}

Result<SessionOptions> completed(SessionOptions options) {
  if (!options.discovery_servers.empty()) {
    TRY(add_found_places(options));
  }
  if (options.servers.empty()) {
    for (const std::uint16_t port : options.server_ports)
      options.servers.push_back({options.address, port});
    return options;
  }
  return own_address_towards(options.servers.front().address).map([&](std::string address) {
    options.address = std::move(address);
    return options;
  });
}

Result<wire::ParticipantPtr> participant_of(const SessionOptions& options) {
  if (options.domain > kHighestDomain)
    return failure(ErrorCode::kUsage, "domain is {}, limit {}", options.domain, kHighestDomain)
        .of("domain")
        .beyond(options.domain, kHighestDomain);
  wire::ParticipantOptions how;
  how.name = "trammel client";
  how.domain = options.domain;
  how.address = options.address;
  how.peers = options.servers;
  if (!options.security.empty()) {
    auto security = TRY(wire::read_security(options.security));
    how.security = std::move(security);
  }
  return wire::make_participant(how);
}

std::string Session::Participant::where_it_looked() const {
  std::string places;
  for (const HostPort& place : options.servers) places += " " + to_string(place);
  return fmt::format("{} ms, looking at{} in domain {}", options.timeout.count(), places,
                     options.domain);
}

Error Session::Participant::not_answered(Error error) const {
  if (options.security.empty()) return error;
  return Failure(std::move(error))
      .next(fmt::format("see that one runs there, and that its certificates and those in {} are of "
                        "the same plant and not over: the server's log names whom it refused",
                        options.security))
      .value();
}

Failure Session::Participant::not_allowed(const char* operation) const {
  return refused("these permissions do not allow {}", operation)
      .in(options.security)
      .next("whoever issues permissions gives a role that may; see deploy/security/README.md");
}

Error Session::Participant::no_server() const {
  if (auto other = watch->other_contract()) return *other;
  return not_answered(
      failure(ErrorCode::kUnreachable, "no server found ({})", where_it_looked()).value());
}

Result<wire::ReadModelsReply> Session::Participant::read(const std::string& cell,
                                                         const std::string& server,
                                                         wire::ReadKind what,
                                                         wire::ReadModelsRequest request,
                                                         const std::string& record) {
  request.about().cell(cell);
  request.what(what);
  return call<wire::ReadModels>(request, {cell, server, false, true, record});
}

std::string Session::Participant::record_of(const std::string& server) const {
  return server.empty() ? std::string() : watch->record_of(server);
}

Result<std::vector<wire::ReadModelsReply>> Session::Participant::read_all(
    const std::string& cell, wire::ReadKind what, const wire::ReadModelsRequest& asked) {
  const auto known = watch->wait_for_servers(options.servers.size(), deadline());
  if (known.empty()) return tl::make_unexpected(no_server());
  std::vector<wire::ReadModelsReply> replies;
  for (const KnownServer& server : known) {
    auto reply = TRY(read(cell, server.id(), what, asked));
    replies.push_back(std::move(reply));
  }
  return replies;
}

Result<wire::ManageModelsReply> Session::Participant::manage(const std::string& cell,
                                                             wire::ManageAction action,
                                                             const ChangeOptions& change,
                                                             wire::ManageModelsRequest request,
                                                             const std::string& server) {
  request.about().cell(cell);
  request.action(action);
  request.change(to_wire(change));
  request.reason(change.reason);
  return call<wire::ManageModels>(request, {cell, server, true, false, record_of(server)});
}

Result<std::int64_t> Session::Participant::release(const std::string& cell,
                                                   const std::vector<std::string>& batch_ids,
                                                   const ChangeOptions& change,
                                                   wire::ReleaseBatchesRequest request) {
  request.about().cell(cell);
  request.batch_ids(batch_ids);
  request.change(to_wire(change));
  request.reason(change.reason);
  const auto reply = TRY(call<wire::ReleaseBatches>(request, {cell, {}, true}));
  return accepted(reply);
}

void Session::Participant::remember(std::int64_t job, const std::string& server) {
  const MutexLock lock(homes_mutex);
  homes[job].insert(server);
  if (homes.size() > kHomesRemembered) homes.erase(homes.begin());
}

void Session::Participant::told(std::int64_t number, const std::string& server) {
  const MutexLock lock(homes_mutex);
  const auto found = homes.find(number);
  if (found != homes.end() && found->second.erase(server) > 0 && found->second.empty())
    homes.erase(found);
}

std::set<std::string> Session::Participant::may_have(std::int64_t number) {
  {
    const MutexLock lock(homes_mutex);
    if (const auto found = homes.find(number); found != homes.end()) return found->second;
  }
  std::set<std::string> servers;
  for (const KnownServer& server : watch->wait_for_servers(options.servers.size(), deadline()))
    servers.insert(server.id());
  return servers;
}

Result<wire::Job> Session::Participant::job(const std::string& server, std::int64_t number) {
  wire::ReadModelsRequest request;
  request.job(number);
  auto reply = TRY(read({}, server, wire::READ_JOB, std::move(request), record_of(server)));
  if (reply.jobs().size() != 1)
    return failure(ErrorCode::kInternal, "server {} answered no job", server);
  return reply.jobs().front();
}

Result<wire::Job> Session::Participant::job_of_cell(const std::string& server, std::int64_t number,
                                                    const std::string& cell) {
  auto asked = job(server, number);
  if (!asked || cell.empty() || asked->cell() == cell) return asked;
  return failure(ErrorCode::kNotFound, "job {} of server {} is of cell {}, not of {}", number,
                 server, asked->cell(), cell);
}

Result<std::pair<std::string, wire::Job>> Session::Participant::find_job(std::int64_t number,
                                                                         const std::string& cell) {
  std::optional<std::pair<std::string, wire::Job>> found;
  Error last = no_server();
  for (const std::string& server : may_have(number)) {
    const std::string record = record_of(server);
    if (found && !record.empty() && record == record_of(found->first)) continue;
    auto asked = job_of_cell(server, number, cell);
    if (!asked) last = asked.error();
    if (!asked) continue;
    if (found) return ambiguous(number, found->first, server);
    found = std::pair(server, std::move(*asked));
  }
  if (!found) return tl::make_unexpected(last);
  return *std::move(found);
}

}  // namespace trammel::client
