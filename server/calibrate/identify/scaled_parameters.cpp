#include "server/calibrate/identify/scaled_parameters.h"

#include "server/calibrate/frames/frames.h"

namespace trammel {

namespace {

constexpr double kUnknownWidening =
    500;  // times: 1 m and 2.5 rad, so that the prior of an unknown frame does not matter

}  // namespace

Eigen::VectorXd ScaledParameters::lower() const {
  Eigen::VectorXd bounds(scale.size());
  for (Eigen::Index i = 0; i < bounds.size(); ++i) bounds(i) = parameters[static_cast<std::size_t>(i)].lower / scale(i);
  return bounds;
}

ScaledParameters scaled_parameters(const PhysicalModel& model, const std::vector<bool>& held) {
  const Eigen::Index P = model.parameter_count();
  ScaledParameters s{model.parameters(), Eigen::VectorXd(P), Eigen::VectorXd(P), Eigen::VectorXd(P), held};
  Eigen::Index k = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const bool unknown = (source->cause().part == causes::Part::kBase && (!model.cell->X_WB || !held.empty())) ||
                         (source->cause().part == causes::Part::kTool && has_unknown_tool(*model.cell));
    for (std::size_t i = 0; i < source->parameters().size(); ++i, ++k) {
      Parameter& parameter = s.parameters[static_cast<std::size_t>(k)];
      s.typical(k) = parameter.prior_scale;
      parameter.prior = model.values(k);
      parameter.prior_scale *= unknown ? kUnknownWidening : 1;
      s.scale(k) = parameter.prior_scale;
      s.prior(k) = parameter.prior / parameter.prior_scale;
    }
  }
  return s;
}

}  // namespace trammel
