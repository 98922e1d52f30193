#pragma once

#include <cstddef>

namespace trammel {

/// An answer that is computed in portions. All portions use the one model that was taken at the
/// beginning. Each item is the same whichever worker computes it, together with any others.
template <typename Reply>
class PortionedAnswer {
 public:
  virtual ~PortionedAnswer() = default;
  [[nodiscard]] virtual std::size_t items() const = 0;
  /// The items [first, first + count). Several threads may call it at once, each with other items.
  virtual void compute(std::size_t first, std::size_t count) = 0;
  /// When all items are computed.
  [[nodiscard]] virtual Reply take() = 0;
};

}  // namespace trammel
