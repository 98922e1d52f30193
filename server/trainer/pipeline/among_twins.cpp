#include "server/trainer/pipeline/among_twins.h"

#include <algorithm>

namespace trammel {

namespace {

constexpr int kMostUnlike = 8;  // parameters; a robot that differs in more is none of this fleet

}  // namespace

Result<CalibrationResult> calibrate_among_twins(const std::shared_ptr<const Cell>& cell,
                                                const std::vector<std::string>& sources, const MeasurementBatch& batch,
                                                const FleetPrior& fleet) {
  CalibrateOptions options;
  for (const FleetParameter& one : fleet.parameters) options.priors.push_back({one.name, one.mean, one.next_stddev()});
  for (int given_back = 0;; ++given_back) {
    Result<CalibrationResult> result = calibrate(cell, sources, batch, options);
    if (!result) return result;
    const std::vector<Unlike> unlike = unlike_twins(result->parameters, result->covariance, fleet);
    const auto drawn = std::find_if(unlike.begin(), unlike.end(), [&](const Unlike& one) {
      return std::any_of(options.priors.begin(), options.priors.end(),
                         [&](const ParameterPrior& prior) { return prior.name == one.parameter; });
    });
    if (drawn == unlike.end()) return result;
    if (given_back == kMostUnlike) return calibrate(cell, sources, batch, {});
    std::erase_if(options.priors, [&](const ParameterPrior& prior) { return prior.name == drawn->parameter; });
  }
}

}  // namespace trammel
