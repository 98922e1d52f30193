#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "clients/session/caller.h"
#include "clients/session/convert.h"
#include "clients/session/parts.h"
#include "clients/session/server_watch.h"
#include "clients/session/session.h"
#include "idl/exchange/wire_values.h"
#include "idl/limits.h"
#include "idl/repairs/quiet_library.h"
#include "server/base/mutex.h"

namespace trammel::client {

/// A unique name, also across hosts: 128 random bits.
[[nodiscard]] std::string make_name(const char* what);
[[nodiscard]] std::string change_id(const ChangeOptions& options);
[[nodiscard]] wire::Change to_wire(const ChangeOptions& options);
/// The options with every server as a place, and with this host's address on the route there.
[[nodiscard]] Result<SessionOptions> completed(SessionOptions options);
[[nodiscard]] Result<wire::ParticipantPtr> participant_of(const SessionOptions& options);

/// Share of the timeout that one part of a long call should take. It is far below the half after
/// which a request is sent again.
inline constexpr double kShareOfTimeout = 0.1;
inline constexpr std::uint32_t kLeastPatience = 10;  // ms, before a busy server is asked again

/// An operation's endpoints, made at its first call, since the server announces each of its
/// endpoints to every client.
template <typename Operation>
struct Endpoints {
  Mutex mutex;
  std::unique_ptr<Caller<Operation>> caller TRAMMEL_GUARDED_BY(mutex);
};

/// The parts of a session, and how its requests are sent. Members are destroyed from the last to
/// the first.
struct Session::Participant {
  SessionOptions options;
  wire::ParticipantPtr participant;
  std::unique_ptr<ServerWatch> watch;
  std::string partition;
  wire::dds::Publisher* request_publisher = nullptr;
  wire::dds::Subscriber* reply_subscriber = nullptr;
  std::tuple<Endpoints<wire::PredictError>, Endpoints<wire::CorrectTarget>,
             Endpoints<wire::SubmitMeasurements>, Endpoints<wire::Train>, Endpoints<wire::Diagnose>,
             Endpoints<wire::CheckHealth>, Endpoints<wire::ReadModels>,
             Endpoints<wire::ManageModels>, Endpoints<wire::ReleaseBatches>>
      endpoints;
  Mutex homes_mutex;
  std::map<std::int64_t, std::set<std::string>> homes
      TRAMMEL_GUARDED_BY(homes_mutex);  // this session's jobs' servers

  [[nodiscard]] Clock::time_point deadline() const { return Clock::now() + options.timeout; }

  /// For error messages: the duration of the search, the ports, the domain.
  [[nodiscard]] std::string where_it_looked() const;
  /// The error if no server answered. A server that refuses a certificate is as silent as an absent
  /// one.
  [[nodiscard]] Error not_answered(Error error) const;
  [[nodiscard]] Failure not_allowed(const char* operation) const;
  [[nodiscard]] Error no_server() const;

  /// An error reply becomes an error here. Without a server the error says where it was searched.
  template <typename Reply>
  [[nodiscard]] Result<Reply> as_result(Result<Reply> reply) const {
    if (!reply && reply.error().code == ErrorCode::kUnreachable) {
      Error error = reply.error();
      error.message += fmt::format(" ({})", where_it_looked());
      return Failure(not_answered(std::move(error))).of("server").with_text(where_it_looked());
    }
    if (reply && reply->header().result() != wire::RESULT_OK)
      return tl::make_unexpected(error_of(reply->header()));
    return reply;
  }

  /// Refused where the permissions do not allow it.
  template <typename Operation>
  [[nodiscard]] Result<Caller<Operation>*> caller_of() {
    auto& made = std::get<Endpoints<Operation>>(endpoints);
    const MutexLock lock(made.mutex);
    if (made.caller) return made.caller.get();
    const bool may_be_forbidden = !options.security.empty();
    std::optional<wire::QuietLibrary> quiet;
    if (may_be_forbidden) quiet.emplace();
    auto opened = Caller<Operation>::open(*participant, *request_publisher, *reply_subscriber,
                                          partition, *watch);
    if (!opened && may_be_forbidden) return not_allowed(Operation::kName);
    if (!opened) return tl::make_unexpected(opened.error());
    made.caller = std::move(*opened);
    return made.caller.get();
  }

  /// Sends one request. A busy server has not done it, and gets it again after its stated pause,
  /// until the deadline; a change keeps its id.
  template <typename Operation>
  [[nodiscard]] Result<typename Operation::Reply::type> call(
      const typename Operation::Request::type& request, const Route& route) {
    using Reply = typename Operation::Reply::type;
    const auto caller = caller_of<Operation>();
    if (!caller) return tl::make_unexpected(caller.error());
    const auto until = deadline();
    std::optional<Reply> busy;
    while (true) {
      Result<Reply> reply = (*caller)->call(request, route, until);
      const bool too_late = reply && reply->header().result() == wire::RESULT_DEADLINE_MISSED;
      // The reason why it was busy is more useful than the message that too little time was left.
      if (busy && too_late) return as_result<Reply>(*std::move(busy));
      if (busy && !reply)
        reply.error().message += "; before, it was busy: " + error_of(busy->header()).message;
      if (!reply || reply->header().result() != wire::RESULT_BUSY)
        return as_result<Reply>(std::move(reply));
      const auto again = Clock::now() + std::chrono::milliseconds(std::max(
                                            reply->header().retry_after_ms(), kLeastPatience));
      if (again >= until) return as_result<Reply>(std::move(reply));
      busy = *std::move(reply);
      watch->wait_until(again);
    }
  }

  /// From `server`, or from another one of its `record`; empty: from any.
  [[nodiscard]] Result<wire::ReadModelsReply> read(const std::string& cell,
                                                   const std::string& server, wire::ReadKind what,
                                                   wire::ReadModelsRequest request = {},
                                                   const std::string& record = {});
  [[nodiscard]] std::string record_of(const std::string& server) const;
  /// From every server.
  [[nodiscard]] Result<std::vector<wire::ReadModelsReply>> read_all(
      const std::string& cell, wire::ReadKind what, const wire::ReadModelsRequest& asked = {});
  [[nodiscard]] Result<wire::ManageModelsReply> manage(const std::string& cell,
                                                       wire::ManageAction action,
                                                       const ChangeOptions& change,
                                                       wire::ManageModelsRequest request = {},
                                                       const std::string& server = {});
  [[nodiscard]] Result<std::int64_t> release(const std::string& cell,
                                             const std::vector<std::string>& batch_ids,
                                             const ChangeOptions& change,
                                             wire::ReleaseBatchesRequest request);

  /// Remembers the server that accepted the job, since every server numbers its own jobs.
  template <typename Reply>
  [[nodiscard]] std::int64_t accepted(const Reply& reply) {
    remember(reply.job(), reply.header().server().to_string());
    return reply.job();
  }
  void remember(std::int64_t job, const std::string& server);
  /// Records that this session has seen the end of the job.
  void told(std::int64_t number, const std::string& server);
  /// The servers that accepted a job of this number in this session and have not reported its end;
  /// if there are none, all known servers.
  [[nodiscard]] std::set<std::string> may_have(std::int64_t number);
  /// The job as `server`, or another one of its record, knows it.
  [[nodiscard]] Result<wire::Job> job(const std::string& server, std::int64_t number);
  [[nodiscard]] Result<wire::Job> job_of_cell(const std::string& server, std::int64_t number,
                                              const std::string& cell);
  /// The server that has the job (of `cell`; empty: of any), and its present state. Refused where
  /// several have one.
  [[nodiscard]] Result<std::pair<std::string, wire::Job>> find_job(std::int64_t number,
                                                                   const std::string& cell = {});

  /// Sends `items` in parts, all to be answered by one model.
  template <typename Operation, typename Item, typename Asked, typename Put, typename Get,
            typename Told>
  [[nodiscard]] Result<exchange::Answer<Item>> call_in_parts(const CallContext& context,
                                                             const std::vector<Asked>& items,
                                                             const ShareListener& progress,
                                                             const Put& put, const Get& get,
                                                             const Told& told_as) {
    const AskPart<Item> ask = [&](std::size_t first,
                                  std::size_t count) -> Result<exchange::Answer<Item>> {
      typename Operation::Request::type request;
      request.about(to_wire(context));
      for (std::size_t i = first; i < first + count; ++i)
        put(request).push_back(wire::to_wire(items[i]));
      const auto reply = call<Operation>(request, {context.cell, {}});
      if (!reply) return tl::make_unexpected(reply.error());
      if (get(*reply).size() != count) {
        return failure(ErrorCode::kInternal, "server {} answered {} items for {}",
                       reply->header().server().to_string(), get(*reply).size(), count);
      }
      exchange::Answer<Item> answer;
      answer.model = from_wire(reply->model());
      for (const auto& item : get(*reply)) answer.items.push_back(told_as(item));
      return answer;
    };
    const PartSize size(kShareOfTimeout * PartSize::Seconds(options.timeout),
                        wire::kTargetsPerRequest);
    return ask_in_parts<Item>(items.size(), context.cell, size, ask, progress,
                              [] { return PartSize::Seconds(Clock::now().time_since_epoch()); });
  }
};

}  // namespace trammel::client
