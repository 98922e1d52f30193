#include "idl/repairs/guard/sequence_watch.h"

#include <algorithm>

namespace trammel::wire {

std::int64_t SequenceWatch::granted(std::int64_t wanted, std::int64_t step, std::int64_t weight,
                                    Time now) {
  if (wanted <= kFreely) return wanted;
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(now - refilled_).count();
  if (since > 0) {
    const std::int64_t refill = since >= 1'000'000 ? kBudget : kBudget / 1'000'000 * since;
    budget_ = std::min(kBudget, budget_ + refill);
    refilled_ = now;
  }
  const std::int64_t grant = std::min({wanted, step, budget_ / weight});
  budget_ -= grant * weight;
  return grant;
}

std::int64_t SequenceWatch::heartbeat(const EndpointKey& writer, std::int64_t first,
                                      std::int64_t step, Time now) {
  Known& known = known_.at(writer, now);
  const std::int64_t wanted = first - 1 - known.confirmed;
  if (wanted <= kFreely) return first;
  const std::int64_t may = std::min(first - 1, known.confirmed + step);
  if (may > known.granted) {
    const std::int64_t from = std::max(known.granted, known.confirmed);
    known.granted = from + granted(may - from, step, 1, now);
  }
  return std::min(may, known.granted) + 1;
}

SequenceWatch::Range SequenceWatch::gap(const EndpointKey& writer, Range asked, Time now) {
  if (asked.end - asked.start <= kFreely) return asked;
  Known& known = known_.at(writer, now);
  Range range = asked;
  if (known.gap.start == asked.start && known.gap.end < asked.end)
    range.start = std::max(asked.start, known.gap.end);
  range.end = range.start + granted(range.end - range.start, kGapStep, kGapWeight, now);
  known.gap = {asked.start, range.end};
  return range;
}

bool SequenceWatch::count(const EndpointKey& key, std::uint32_t count, Time now) {
  Known& known = known_.at(key, now);
  if (known.counted && count > known.count && count - known.count > kCountStep) return false;
  known.count = known.counted ? std::max(known.count, count) : count;
  known.counted = true;
  return true;
}

}  // namespace trammel::wire
