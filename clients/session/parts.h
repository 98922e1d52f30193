#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <utility>

#include "clients/session/session_types.h"
#include "server/base/result.h"

/// Long calls, sent in parts.
namespace trammel::client {

/// The number of items in the next part: as many as are answered in the wanted time, judged by the
/// part before. Starts small and grows at most eightfold from one part to the next.
class PartSize {
 public:
  using Seconds = std::chrono::duration<double>;

  PartSize(Seconds wanted, std::size_t most) : wanted_(wanted), most_(most) {}

  [[nodiscard]] std::size_t next() const { return next_; }
  void took(std::size_t items, Seconds time) {
    const double rate =
        static_cast<double>(items) / std::max(time.count(), 1e-9);  // items a second
    const double fits = std::min(rate * wanted_.count(), static_cast<double>(kGrowth * next_));
    next_ = std::clamp(static_cast<std::size_t>(fits), std::size_t{1}, most_);
  }
  /// A part of so many items got no answer in time, since its items take longer than earlier ones.
  /// Later parts are shorter.
  void timed_out(std::size_t items) {
    most_ = std::max(std::size_t{1}, items / 2);
    next_ = std::max(std::size_t{1}, items / kGrowth);
  }

 private:
  static constexpr std::size_t kFirst = 16;
  static constexpr std::size_t kGrowth = 8;

  const Seconds wanted_;
  std::size_t most_;
  std::size_t next_ = std::min(kFirst, most_);
};

/// Asks for the items [first, first + count).
template <typename Item>
using AskPart = std::function<Result<exchange::Answer<Item>>(std::size_t first, std::size_t count)>;

/// The answers to `items` items, all from one model. If the model changes between two parts, all
/// items are requested again. A part without an answer in time, or one that a busy server rejects,
/// is repeated in smaller parts, a few times. kBusy: that did not help, or the model kept changing.
/// `progress` may be empty; `now` is the clock.
template <typename Item>
[[nodiscard]] Result<exchange::Answer<Item>> ask_in_parts(
    std::size_t items, const std::string& cell, PartSize size, const AskPart<Item>& ask,
    const std::function<void(double)>& progress, const std::function<PartSize::Seconds()>& now) {
  constexpr int kAttempts = 5;
  int smaller_parts_left = 3;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    exchange::Answer<Item> answer;
    bool one_model = true;
    std::size_t done = 0;
    do {
      if (progress)
        progress(items == 0 ? 0 : static_cast<double>(done) / static_cast<double>(items));
      const std::size_t count = std::min(size.next(), items - done);
      const PartSize::Seconds begun = now();
      auto part = ask(done, count);
      const bool too_late = !part && (part.error().code == ErrorCode::kUnreachable ||
                                      part.error().code == ErrorCode::kBusy);
      if (too_late && done > 0 && count > 1 && smaller_parts_left-- > 0) {
        size.timed_out(count);
        continue;
      }
      if (!part && (done == 0 || too_late)) return part;
      if (!part) return Failure(part.error()).in(fmt::format("after the first {}", done));
      size.took(count, now() - begun);
      one_model = done == 0 || (part->model.hash == answer.model.hash &&
                                part->model.version == answer.model.version);
      if (done == 0) answer.model = part->model;
      std::move(part->items.begin(), part->items.end(), std::back_inserter(answer.items));
      done += count;
    } while (one_model && done < items);
    if (one_model) return answer;
  }
  return failure(ErrorCode::kBusy, "cell {}: the model changed during each of {} attempts", cell,
                 kAttempts);
}

}  // namespace trammel::client
