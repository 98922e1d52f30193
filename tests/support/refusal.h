#pragma once

#include <optional>
#include <ostream>
#include <string>

#include "server/base/result.h"

namespace trammel::test {

/// The data that a refusal must have, whatever its words: `Refusal("b.csv", 3,
/// "q1_deg").beyond(241.2, 70)`.
class Refusal {
 public:
  Refusal() = default;
  explicit Refusal(std::string file, std::optional<long> row = std::nullopt,
                   std::string field = "");
  [[nodiscard]] static Refusal none();  ///< nothing is refused

  [[nodiscard]] Refusal of(ErrorCode code) const;
  [[nodiscard]] Refusal value(double is) const;
  [[nodiscard]] Refusal beyond(double is, double limit) const;
  [[nodiscard]] Refusal text(std::string is) const;

  /// The data of an error; its words and its advice are left out.
  explicit Refusal(const Error& error);
  /// Numbers to six digits.
  friend bool operator==(const Refusal& a, const Refusal& b);
  friend std::ostream& operator<<(std::ostream& out, const Refusal& refusal);

 private:
  bool refused_ = true;
  ErrorCode code_ = ErrorCode::kRefused;
  std::string file_, field_, text_;
  std::optional<long> row_;
  std::optional<double> value_, limit_;
};

template <typename T>
[[nodiscard]] Refusal refusal_of(const Result<T>& result) {
  return result ? Refusal::none() : Refusal(result.error());
}

}  // namespace trammel::test
