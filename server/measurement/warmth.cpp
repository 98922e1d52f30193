#include "server/measurement/warmth.h"

#include <algorithm>

namespace trammel {

namespace {

constexpr double kWarmer = 2;  // K

}  // namespace

bool shows_warmth(const MeasurementBatch& batch) {
  const auto& rows = batch.measurements;
  if (std::any_of(rows.begin(), rows.end(),
                  [](const Measurement& m) { return !m.context.temperature; }))
    return false;
  const auto [coldest, warmest] =
      std::minmax_element(rows.begin(), rows.end(), [](const Measurement& a, const Measurement& b) {
        return *a.context.temperature < *b.context.temperature;
      });
  return coldest != rows.end() &&
         *warmest->context.temperature - *coldest->context.temperature > kWarmer;
}

}  // namespace trammel
