#include "server/dds/packet_report.h"

#include <fmt/format.h>

namespace trammel {

std::optional<std::string> PacketReport::due(Time now) {
  if (told_at_ && now - *told_at_ < kAtMostEvery) return std::nullopt;
  std::string reasons;
  for (std::size_t i = 0; i < told_.size(); ++i) {
    const auto reason = static_cast<wire::Dropped>(i);
    const std::uint64_t count = counts_->of(reason);
    if (count == told_[i]) continue;
    reasons += fmt::format("{}{} ({})", reasons.empty() ? "" : ", ", wire::name_of(reason), count - told_[i]);
    told_[i] = count;
  }
  if (reasons.empty()) return std::nullopt;
  told_at_ = now;
  return "packets were dropped unread: " + reasons;
}

std::optional<std::string> StrangerReport::due(const Strangers& strangers, PacketReport::Time now) {
  if (strangers.count == told_ || (told_at_ && now - *told_at_ < PacketReport::kAtMostEvery)) return std::nullopt;
  const std::uint64_t more = strangers.count - told_;
  told_ = strangers.count;
  told_at_ = now;
  return fmt::format("participants without the right certificate or permissions were refused: {} tries, the last of {}",
                     more, strangers.last);
}

}  // namespace trammel
