#pragma once

#include <cstddef>

namespace trammel {

/// An answer that is computed in portions. All of it comes from the one model that was taken at the
/// beginning, and each item is the same whoever computes it beside which others.
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
