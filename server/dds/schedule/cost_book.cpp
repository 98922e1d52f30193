#include "server/dds/schedule/cost_book.h"

#include <cmath>

namespace trammel {
namespace {

constexpr double kNewest = 0.25;  // weight of the newest measurement
constexpr std::chrono::duration<double> kHalfLife{2};
constexpr std::size_t kMostKinds = 16384;  // cells times operations

}  // namespace

Cost CostBook::per_item(const std::string& work, SteadyTime now) const {
  const auto found = figures_.find(work);
  if (found == figures_.end()) return Cost(0);
  const auto age = std::chrono::duration<double>(now - found->second.measured_at);
  return found->second.per_item * std::exp2(-age / kHalfLife);
}

void CostBook::measured(const std::string& work, std::size_t items, Cost took, SteadyTime now) {
  if (work.empty() || items == 0) return;
  const Cost newest = took / static_cast<double>(items);
  const auto found = figures_.find(work);
  if (found != figures_.end()) {
    found->second = {found->second.per_item + kNewest * (newest - found->second.per_item), now};
  } else if (figures_.size() < kMostKinds) {
    figures_[work] = {newest, now};
  }
}

}  // namespace trammel
