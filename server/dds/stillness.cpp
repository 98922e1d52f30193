#include "server/dds/stillness.h"

#include <algorithm>
#include <utility>

namespace trammel {

Stillness::Stillness(std::vector<MovingPart> parts, Duration tick, Duration limit)
    : tick_(tick), limit_(limit) {
  for (MovingPart& part : parts) watched_.push_back({std::move(part), std::nullopt, Duration(0)});
}

std::vector<const char*> Stillness::look(Duration since_last) {
  std::vector<const char*> stopped;
  for (Watched& watched : watched_) {
    const auto mark = watched.part.mark();
    const bool moved = !mark || mark != watched.mark;
    watched.mark = mark;
    watched.still = moved ? Duration(0) : watched.still + std::min(since_last, tick_);
    if (watched.still >= limit_ && watched.part.ends_process) stopped.push_back(watched.part.name);
  }
  return stopped;
}

std::uint64_t Stillness::still_for(Duration time) const {
  std::uint64_t still = 0;
  for (std::size_t i = 0; i < watched_.size(); ++i) {
    if (watched_[i].still >= time) still |= std::uint64_t{1} << i;
  }
  return still;
}

WorkUnderWay::Piece WorkUnderWay::begin() {
  const std::uint64_t number = ++begun_;
  for (auto& place : places_) {
    std::uint64_t free = 0;
    if (place.load(std::memory_order_relaxed) == 0 && place.compare_exchange_strong(free, number)) {
      return Piece(&place);
    }
  }
  return Piece(nullptr);
}

std::optional<std::uint64_t> WorkUnderWay::oldest() const {
  std::uint64_t oldest = 0;
  for (const auto& place : places_) {
    const std::uint64_t number = place;
    if (number != 0 && (oldest == 0 || number < oldest)) oldest = number;
  }
  return oldest == 0 ? std::nullopt : std::optional(oldest);
}

}  // namespace trammel
