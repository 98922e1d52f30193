#pragma once

#include <cstddef>
#include <string>
#include <unordered_map>

#include "server/dds/schedule/job.h"

namespace trammel {

/// The recent cost of an item, by the kind of work. A figure fades while nothing is measured: a
/// figure from a stalled machine must not refuse work for ever. Not thread-safe.
class CostBook {
 public:
  /// 0 for work that was never measured.
  [[nodiscard]] Cost per_item(const std::string& work, SteadyTime now) const;
  /// Does nothing for an empty `work`.
  void measured(const std::string& work, std::size_t items, Cost took, SteadyTime now);

 private:
  struct Figure {
    Cost per_item{0};
    SteadyTime measured_at{};
  };
  std::unordered_map<std::string, Figure> figures_;
};

}  // namespace trammel
