#include "server/trainer/compute/frames.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <utility>

#include "server/base/json_guard.h"

namespace trammel {

namespace {

constexpr const char* kWhere = "message of the computing process";

using Sizes = std::array<std::uint64_t, 2>;  // of head and text

Result<nlohmann::json> head_of(const std::string& text) {
  JsonLimits limits;
  limits.depth = 8;
  TRY(check_json_limits(text, kWhere, limits));
  nlohmann::json head = nlohmann::json::parse(text, nullptr, false);
  if (!head.is_object()) return failure(ErrorCode::kInternal, "not a JSON object").in(kWhere);
  return head;
}

}  // namespace

std::string encoded(const Frame& frame) {
  const std::string head =
      frame.head.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const Sizes sizes = {head.size(), frame.text.size()};
  std::string bytes(sizeof(Sizes), '\0');
  std::memcpy(bytes.data(), sizes.data(), sizeof(Sizes));
  return bytes + head + frame.text;
}

Result<std::optional<Frame>> FrameReader::next() {
  if (buffer_.size() < sizeof(Sizes)) return std::nullopt;
  Sizes sizes{};
  std::memcpy(sizes.data(), buffer_.data(), sizeof(Sizes));
  const auto [head_bytes, text_bytes] = sizes;
  if (head_bytes > limits_.head_bytes || text_bytes > limits_.text_bytes) {
    return failure(ErrorCode::kTooLarge, "{} and {} bytes, limit {} and {}", head_bytes, text_bytes,
                   limits_.head_bytes, limits_.text_bytes)
        .in(kWhere);
  }
  const std::size_t whole = sizeof(Sizes) + head_bytes + text_bytes;
  if (buffer_.size() < whole) return std::nullopt;
  auto head = TRY(head_of(buffer_.substr(sizeof(Sizes), head_bytes)));
  Frame frame{std::move(head), buffer_.substr(sizeof(Sizes) + head_bytes, text_bytes)};
  buffer_.erase(0, whole);
  return frame;
}

}  // namespace trammel
