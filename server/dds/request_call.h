#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "idl/transport/transport.h"
#include "server/base/mutex.h"
#include "server/dds/call_report.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"
#include "server/dds/records/request_recorder.h"
#include "server/dds/reply_memory.h"
#include "server/dds/reply_sink.h"
#include "server/dds/request_weight.h"
#include "server/dds/result_words.h"
#include "server/dds/schedule/job.h"
#include "server/metrics/operation_counts.h"

namespace trammel {

/// The counts that all operations of a service keep.
struct CallCounts {
  std::atomic<std::uint64_t> requests{0};  ///< answered by a handler or from memory
  std::atomic<std::uint64_t> refused{0};   ///< those with a code other than RESULT_OK
  std::atomic<std::uint64_t> shed{0};      ///< answered with RESULT_BUSY, for lack of time or room
  std::atomic<std::uint64_t> lost{0};      ///< lost by a DDS reader, before the service saw them
  /// Not answered, since another client listens in the reply's partition.
  std::atomic<std::uint64_t> misdirected{0};
};

/// The fault of a request that names another DDS writer than its sender.
[[nodiscard]] inline std::optional<wire::Fault> fault_of_identity(
    const wire::RequestHeader& header, const eprosima::fastrtps::rtps::GUID_t& writer) {
  if (header.request_id().writer_guid() == wire::octets_of(writer)) return std::nullopt;
  return wire::Fault{wire::RESULT_WRONG_IDENTITY,
                     "request_id must hold the GUID of the writer that sends it",
                     {},
                     "writer_guid",
                     {},
                     {}};
}

/// The fault of a request whose id was used for another request.
inline const wire::Fault kIdIsUsed{
    wire::RESULT_CONFLICT, "request_id is that of another request", {}, "request_id", {}, {}};

/// A DDS participant, as request ids begin.
[[nodiscard]] inline std::string participant_text(const std::string& participant) {
  std::string text;
  for (const char byte : participant)
    text += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return text;
}

/// The parts that the calls of one operation share. They outlive the calls.
template <typename Operation>
struct CallContext {
  using Reply = typename Operation::Reply::type;
  static constexpr std::size_t kRepliesRemembered = 1024;
  static constexpr std::size_t kLately = 32;  // kept replies; replies with many targets are large

  std::string server_id;
  std::string reply_topic;
  Handlers& handlers;
  ReplySink& replies;
  CallCounts& counts;
  ReplyMemory<Reply> memory{
      kRepliesRemembered};             ///< for operations that make changes, by request id
  ReplyMemory<Reply> lately{kLately};  ///< of long computations, by writer and request id
  UnderWay under_way = {};
  RequestRecorder* recorder = nullptr;
  CallListener listener = {};  ///< receives requests for changes, and refused ones
  OperationCounts operation = {};
};

/// A request from its arrival to its reply.
template <typename Operation>
class Call final : public Job {
 public:
  using Request = wire::Received<typename Operation::Request::type>;
  using Reply = typename Operation::Reply::type;
  /// True if an answer is computed in portions. Then a repeat gets the kept reply.
  static constexpr bool kComputes = AsksForTargets<Request> || AsksForPoses<Request>;

  /// `sent`: the DDS writer of the sample with the request id: clients may reuse each other's ids.
  /// `while_under_way` is kept until the call is over.
  Call(CallContext<Operation>& context, std::unique_ptr<Request> request, ReplyAddress to,
       const std::string& sent, std::shared_ptr<void> while_under_way)
      : context_(context),
        request_(std::move(request)),
        to_(std::move(to)),
        sent_(sent),
        while_under_way_(std::move(while_under_way)),
        answering_(context.under_way, sent, request_->content) {}

  /// False: a repeat of a request that is still being answered. The answer of the first is sent
  /// once more for it.
  [[nodiscard]] bool is_first() const { return answering_.is_first(); }

  /// Replaces begin() if another request with the same id is being answered: a repeat gets the
  /// earlier answer, anything else is refused. True: it was answered in this way.
  [[nodiscard]] bool is_answered_for_its_id() {
    if (!answering_.is_other()) return false;
    if (!find_known()) refuse(kIdIsUsed);
    const bool is_good = !is_refused();
    put_identity();
    ++context_.counts.requests;
    if (!is_good) ++context_.counts.refused;
    context_.operation.answered(reply_.header().result(), 1);
    report(is_good);
    const std::size_t bytes = bytes_of_reply(reply_);
    context_.replies.post(to_, std::make_shared<Reply>(std::move(reply_)), bytes);
    return true;
  }

  std::size_t begin() override {
    if (request_->fault) {
      refuse(*request_->fault);
      return 0;
    }
    if (find_known()) return 0;
    if constexpr (!kComputes) return 1;
    guarded([this] { begin_portions(); });
    return portions_ ? portions_->items() : 0;
  }

  void compute(std::size_t first, std::size_t count) override {
    guarded([&] {
      if constexpr (kComputes) {
        portions_->compute(first, count);
      } else {
        accept(context_.handlers.answer(*request_));
      }
    });
  }

  void finish() override {
    if constexpr (kComputes) {
      if (portions_ && !is_refused()) reply_ = portions_->take();
    }
    const wire::ResultCode result = reply_.header().result();
    const bool is_good = result == wire::RESULT_OK;
    put_identity();
    if (is_good && !is_known_) remember();
    if (is_good && !is_known_) record();
    report(is_good);
    const std::uint64_t times = answer(&ReplySink::send);
    context_.counts.requests += times;
    if (!is_good) context_.counts.refused += times;
    context_.operation.answered(result, times);
    context_.operation.took(std::chrono::steady_clock::now() - arrived_);
  }

  void shed(const Shed& shed) override {
    const bool is_over = shed.too_late && request_->header().deadline_ms() > 0;
    refuse(wire::Fault{is_over ? wire::RESULT_DEADLINE_MISSED : wire::RESULT_BUSY,
                       fmt::format("{}; try again in {} ms", shed.why, shed.retry_after.count()),
                       {},
                       is_over ? "deadline_ms" : "",
                       {},
                       {}});
    reply_.header().retry_after_ms(static_cast<std::uint32_t>(shed.retry_after.count()));
    put_identity();
    const std::uint64_t times = answer(&ReplySink::post);
    context_.counts.shed += times;
    context_.operation.answered(is_over ? wire::RESULT_DEADLINE_MISSED : wire::RESULT_BUSY, times);
  }

 private:
  using Send = void (ReplySink::*)(const ReplyAddress&, std::shared_ptr<void>, std::size_t);

  [[nodiscard]] bool find_known() {
    auto known = context_.lately.find(sent_);
    if (!known && happens_once(*request_))
      known = context_.memory.find(request_id_text(request_->header().request_id()));
    if (!known) return false;
    is_known_ = true;
    if (request_->content.is_other_than(known->asked)) {
      refuse(kIdIsUsed);
    } else {
      reply_ = std::move(known->reply);
    }
    return true;
  }

  void begin_portions() {
    if constexpr (kComputes) {
      auto begun = context_.handlers.begin(*request_);
      if (begun) {
        portions_ = std::move(*begun);
      } else {
        accept(Result<Reply>(tl::make_unexpected(begun.error())));
      }
    }
  }

  void accept(Result<Reply> answer) {
    if (answer) {
      reply_ = std::move(*answer);
    } else {
      refuse(answer.error());
    }
  }

  /// `why`: an Error or a wire::Fault.
  template <typename Why>
  void refuse(const Why& why) {
    const MutexLock lock(mutex_);
    reply_ = Reply();
    put_error(why, reply_.header());
    refused_ = true;
  }

  [[nodiscard]] bool is_refused() {
    const MutexLock lock(mutex_);
    return refused_;
  }

  template <typename Work>
  void guarded(const Work& work) {
    try {
      work();
    } catch (const std::exception& failed) {
      refuse(wire::Fault{wire::RESULT_UNKNOWN_EXCEPTION, failed.what(), {}, {}, {}, {}});
    }
  }

  void put_identity() {
    reply_.header().related_request_id(request_->header().request_id());
    reply_.header().server(context_.server_id);
    reply_.header().contract_version(wire::CONTRACT_VERSION);
    reply_.header().trace_id(request_->header().trace_id());
  }

  void remember() {
    if (kComputes) context_.lately.remember(sent_, request_->content, reply_);
    if (happens_once(*request_)) {
      context_.memory.remember(request_id_text(request_->header().request_id()), request_->content,
                               reply_);
    }
  }

  void record() const {
    if constexpr (kComputes) {
      if (context_.recorder == nullptr) return;
      const auto kept =
          std::make_shared<std::pair<typename Operation::Request::type, Reply>>(*request_, reply_);
      context_.recorder->record(
          [kept, at = unix_now_s()] { return record_line(kept->first, kept->second, at); },
          bytes_of_request(*request_) + bytes_of_reply(reply_));
    }
  }

  void report(bool is_good) const {
    const bool changes = happens_once(*request_);
    if (!context_.listener || (is_good && !changes)) return;
    const wire::RequestHeader& header = request_->header();
    const std::string name = context_.handlers.name_of(to_.participant);
    context_.listener({Operation::kName, name.empty() ? participant_text(to_.participant) : name,
                       request_id_text(header.request_id()), header.trace_id().to_string(),
                       request_->about().cell(), changes, reply_.header().message(),
                       result_word(reply_.header().result())});
  }

  /// Returns how many were answered: with the repeats that have come meanwhile.
  std::uint64_t answer(Send send) {
    const auto reply = std::make_shared<Reply>(std::move(reply_));
    const std::size_t bytes = bytes_of_reply(*reply);
    std::uint64_t times = 0;
    do {
      (context_.replies.*send)(to_, reply, bytes);
      ++times;
    } while (answering_.has_repeat());
    return times;
  }

  CallContext<Operation>& context_;
  const SteadyTime arrived_ = std::chrono::steady_clock::now();
  const std::unique_ptr<Request> request_;
  const ReplyAddress to_;
  const std::string sent_;
  const std::shared_ptr<void> while_under_way_;
  UnderWay::Piece answering_;
  std::unique_ptr<PortionedAnswer<Reply>> portions_;
  Mutex mutex_;  // refused_ and reply_ while several threads compute
  bool refused_ = false;
  bool is_known_ = false;
  Reply reply_;
};

}  // namespace trammel
