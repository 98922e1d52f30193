#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "idl/repairs/guard/recent_table.h"
#include "idl/repairs/guard/rtps_bytes.h"
#include "server/base/mutex.h"

namespace trammel::wire {

/// Thins what the library tells everybody of its own endpoints. With each announcement that it
/// repeats to one newcomer it sends a HEARTBEAT to all participants, as long as one of them (a
/// client that was killed, say) has not confirmed everything. Everybody answers each. With 30
/// participants, clients that come and go cost 100,000 packets a second, and the lock that every
/// reply needs. One HEARTBEAT of a writer within kBetween says the same; while anything is
/// unconfirmed the library repeats it by itself.
///
/// And thins what the library asks of a writer that has not offered anything yet: every 20 ms,
/// until the writer offers something or its lease is over. Each question leaves when the time since
/// the first has doubled.
///
/// And thins what the library offers again, every 10 ms, to a reader that does not confirm it:
/// whoever has not answered for kPatience is told five times a second. Thread-safe.
class HeartbeatPace {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kBetween{20}, kBetweenQuestions{2}, kNewSeries{1000};
  static constexpr std::chrono::milliseconds kPatience{500}, kBetweenUnanswered{200};

  /// True if a message of our own is to leave. False only for one that holds nothing but a
  /// HEARTBEAT of discovery to everybody, soon after another of the same writer, nothing but a
  /// question for the first sample of a writer, or nothing but a HEARTBEAT to one that does not
  /// answer.
  [[nodiscard]] bool lets_out(Bytes message, Time now = std::chrono::steady_clock::now());
  /// A message of another participant has come: it answers where it confirms or asks for something.
  void heard(Bytes message, Time now = std::chrono::steady_clock::now());

 private:
  static constexpr std::uint32_t kPublications = 0x000003c2,
                                 kSubscriptions = 0x000004c2;  // writers of endpoints
  static constexpr std::array<std::uint32_t, 2> kWriters{kPublications, kSubscriptions};

  struct Questions {
    Time first{}, last{};  // that left
    Time asked{};          // the last one, whether it left or not
  };
  static constexpr std::size_t kAskedWriters = 512;  // times eight
  struct Offers {
    Time since{};  // the last answer, or the first offer after it
    Time last{};   // that left
    Time made{};   // the last one, whether it left or not
  };

  [[nodiscard]] bool lets_heartbeat_out(std::uint32_t writer, Time now);
  [[nodiscard]] bool lets_question_out(const EndpointKey& asked, Time now);
  [[nodiscard]] bool lets_offer_out(Bytes to, std::uint32_t writer, Time now);

  std::array<std::atomic<Time::rep>, kWriters.size()> last_{};
  Mutex mutex_;
  RecentTable<Questions, kAskedWriters> questions_
      TRAMMEL_GUARDED_BY(mutex_);  // by writer and reader
  RecentTable<Offers, kAskedWriters> offers_
      TRAMMEL_GUARDED_BY(mutex_);  // by reader's participant and writer
  RecentTable<Time, kAskedWriters> answered_ TRAMMEL_GUARDED_BY(mutex_);  // by participant
};

}  // namespace trammel::wire
