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
    reasons += fmt::format("{}{} ({})", reasons.empty() ? "" : ", ", wire::name_of(reason),
                           count - told_[i]);
    told_[i] = count;
  }
  if (reasons.empty()) return std::nullopt;
  told_at_ = now;
  return "packets were dropped unread: " + reasons;
}

void StrangerReport::refused(const std::string& who, const std::string& guid) {
  ++tries_;
  const bool is_told = strangers_.contains(who) || strangers_.size() < kTold;
  Stranger& stranger = strangers_[is_told ? who : "others"];
  ++stranger.tries;
  stranger.guid = guid;
}

std::vector<std::string> StrangerReport::due(PacketReport::Time now) {
  if (strangers_.empty() || (told_at_ && now - *told_at_ < PacketReport::kAtMostEvery)) return {};
  std::vector<std::string> lines;
  for (const auto& [who, stranger] : strangers_) {
    lines.push_back(
        fmt::format("a participant without the right certificate or permissions was refused: {} "
                    "({} {}, the last of {})",
                    who, stranger.tries, stranger.tries == 1 ? "try" : "tries", stranger.guid));
  }
  strangers_.clear();
  told_at_ = now;
  return lines;
}

}  // namespace trammel
