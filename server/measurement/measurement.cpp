#include "server/measurement/measurement.h"

#include <algorithm>
#include <optional>

#include "server/base/hash.h"

namespace trammel {

namespace {

constexpr double kOldestUnixTime =
    1e9;                               // s: September 2001; smaller times count from another start
constexpr double kClockAhead = 86400;  // s by which the instrument's clock may be ahead of ours

}  // namespace

MeasurementBatch dated(MeasurementBatch batch, std::int64_t taken_in) {
  std::optional<double> newest;
  for (const Measurement& m : batch.measurements) {
    const double time = m.context.time.value_or(0);
    if (time < kOldestUnixTime || time > static_cast<double>(taken_in) + kClockAhead) continue;
    newest = std::max(newest.value_or(time), time);
  }
  if (newest) batch.clock = static_cast<std::int64_t>(*newest);
  batch.measured_at = newest ? static_cast<std::int64_t>(*newest) : taken_in;
  return batch;
}

std::string batch_hash(const MeasurementBatch& batch) {
  return sha256_hex(batch.source_text.empty() ? to_csv(batch) : batch.source_text);
}

}  // namespace trammel
