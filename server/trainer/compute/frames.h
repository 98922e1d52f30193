#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "server/base/result.h"

/// The protocol between the service and its computing process: frames over a pair of sockets.
namespace trammel {

/// A small JSON object, and up to one long text: a batch, a model, a page.
struct Frame {
  nlohmann::json head;
  std::string text;
};

/// The limits of a frame. A process that has lost its mind may send anything.
struct FrameLimits {
  std::size_t head_bytes = std::size_t{4} << 20;
  std::size_t text_bytes = std::size_t{1} << 30;
};

/// Sizes (8 bytes each, as this host writes them), head, text. Text in the head that is not UTF-8
/// is replaced.
[[nodiscard]] std::string encoded(const Frame& frame);

/// Makes frames of the bytes that come, however they are cut.
class FrameReader {
 public:
  explicit FrameReader(FrameLimits limits = {}) : limits_(limits) {}

  void feed(std::string_view bytes) { buffer_.append(bytes); }
  /// The next whole frame; empty if there is none yet. Refuses sizes beyond the limits and a head
  /// that is not a JSON object; later data are then meaningless.
  [[nodiscard]] Result<std::optional<Frame>> next();

 private:
  const FrameLimits limits_;
  std::string buffer_;
};

}  // namespace trammel
