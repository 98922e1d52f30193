#include "server/calibrate/identify/scaled_parameters.h"

#include "server/calibrate/frames/frames.h"
#include "server/error_sources/anchors.h"

namespace trammel {

namespace {

constexpr double kUnknownWidening =
    500;  // times: 1 m and 2.5 rad, so that the prior of an unknown frame does not matter

}  // namespace

Eigen::VectorXd ScaledParameters::lower() const {
  Eigen::VectorXd bounds(scale.size());
  for (Eigen::Index i = 0; i < bounds.size(); ++i)
    bounds(i) = parameters[static_cast<std::size_t>(i)].lower / scale(i);
  return bounds;
}

Eigen::VectorXd ScaledParameters::values_at(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  Eigen::VectorXd all = values;
  all(free) = x.cwiseProduct(scale);
  return all;
}

ScaledParameters scaled_parameters(const PhysicalModel& model, const std::vector<bool>& held) {
  std::vector<double> scale, typical, prior;
  ScaledParameters s;
  s.values = model.values;
  Eigen::Index k = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const bool unknown =
        (source->cause().part == causes::Part::kBase && (!model.cell->X_WB || !held.empty())) ||
        (source->cause().part == causes::Part::kTool && has_unknown_tool(*model.cell)) ||
        is_of_instruments(*source);
    for (Parameter parameter : source->parameters()) {
      const Eigen::Index place = k++;
      if (!held.empty() && held[static_cast<std::size_t>(place)]) continue;
      typical.push_back(parameter.prior_scale);
      parameter.prior = model.values(place);
      parameter.prior_scale *= unknown ? kUnknownWidening : 1;
      scale.push_back(parameter.prior_scale);
      prior.push_back(parameter.prior / parameter.prior_scale);
      s.parameters.push_back(std::move(parameter));
      s.free.push_back(place);
    }
  }
  const auto F = static_cast<Eigen::Index>(scale.size());
  s.scale = Eigen::Map<const Eigen::VectorXd>(scale.data(), F);
  s.typical = Eigen::Map<const Eigen::VectorXd>(typical.data(), F);
  s.prior = Eigen::Map<const Eigen::VectorXd>(prior.data(), F);
  return s;
}

}  // namespace trammel
