#pragma once

#include <chrono>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "server/base/mutex.h"
#include "server/base/result.h"

namespace trammel {

/// A refusal that passes by itself: the same copy may be taken later.
[[nodiscard]] bool passes(const Error& refusal);

/// What each follower was told last of each batch, and what it has said to that. No DDS. Thread-safe.
class BatchCopies {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Key {
    std::string participant;  ///< of the follower
    std::string cell, batch;
    auto operator<=>(const Key&) const = default;
  };

  enum class Lacks {
    kNothing,   ///< it has answered what it was told, which is still so, or is about to
    kStanding,  ///< what became of the batch; it has the text
    kText       ///< the text, too
  };
  /// `standing`: all that it is to be told beside the text, in any spelling.
  [[nodiscard]] Lacks lacks(const Key& key, const std::string& standing) const;
  /// It is told now; the number of this copy. From now on nothing counts but the answer to this one.
  [[nodiscard]] std::uint64_t tell(const Key& key, const std::string& standing);
  /// A follower's answer; nothing happens where it was told something newer since, or was not told.
  void answered(const std::string& participant, std::uint64_t number, const Status& outcome);
  /// Waits for the answers to what was told last, each under the name of its follower; what is wrong by follower,
  /// nothing where the batch is there. What was not answered is lacking from now on.
  [[nodiscard]] std::map<std::string, Error> wait(const std::map<std::string, Key>& told, Time until);
  /// From now on nobody waits longer than until then.
  void close(Time until);

  /// The participant (empty: each one) may have been told something else meanwhile, by another server: it lacks what
  /// became of each batch. Texts stay where they are.
  void doubt(const std::string& participant = {});
  /// Forgets what any others were told, as far as nobody waits for them.
  void forget_all_but(const std::set<std::string>& participants);

 private:
  struct Told {
    std::uint64_t number = 0;
    std::optional<std::size_t> standing;  // its hash; empty: in doubt
    bool has_text = false;
    bool overdue = false;           // somebody has waited for the answer in vain
    std::optional<Status> outcome;  // empty: no answer yet
  };

  mutable Mutex mutex_;
  Condition changed_;
  std::optional<Time> closing_ TRAMMEL_GUARDED_BY(mutex_);
  std::uint64_t last_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::map<Key, Told> told_ TRAMMEL_GUARDED_BY(mutex_);
  std::map<std::uint64_t, Key> unanswered_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
