#include "server/diagnose/evidence/effect.h"

#include <algorithm>

namespace trammel::cause_search {

using Eigen::Index;
using Eigen::VectorXd;

std::vector<Index> places_of_source(const PhysicalModel& model, const std::string& source) {
  std::vector<Index> places;
  Index next = 0;
  for (const ErrorSourcePtr& one : model.sources) {
    for (std::size_t k = 0; k < one->parameters().size(); ++k, ++next) {
      if (one->name() == source) places.push_back(next);
    }
  }
  return places;
}

PhysicalModel without_source(const PhysicalModel& model, const std::string& source) {
  PhysicalModel less = model;
  const std::vector<Index> gone = places_of_source(model, source);
  std::vector<Index> kept;
  for (Index k = 0; k < model.values.size(); ++k) {
    if (std::find(gone.begin(), gone.end(), k) == gone.end()) kept.push_back(k);
  }
  less.values = VectorXd(model.values(kept));
  std::erase_if(less.sources, [&](const ErrorSourcePtr& one) { return one->name() == source; });
  return less;
}

VectorXd effect_of_source(const LinearProblem& problem, const std::string& source) {
  const PhysicalModel less = without_source(problem.model(), source);
  VectorXd effect(problem.rows());
  for (Index i = 0; i < problem.poses(); ++i) {
    const PoseContext& context = problem.batch().measurements[static_cast<std::size_t>(i)].context;
    const Pose with = problem.model().pose_W(context);
    const Pose without = less.pose_W(context);
    const Index row = problem.first_row(i);
    effect.segment<3>(row) = with.translation() - without.translation();
    if (problem.row_count(i) == 6)
      effect.segment<3>(row + 3) = rotation_log(with.linear() * without.linear().transpose());
  }
  return effect.cwiseProduct(problem.weight());
}

OwnEstimate own_estimate(const LinearProblem& problem, const std::string& source,
                         const VectorXd& change, const Eigen::MatrixXd& covariance) {
  const std::vector<Index> places = places_of_source(problem.model(), source);
  OwnEstimate own{VectorXd(change(places)), Eigen::MatrixXd(covariance(places, places))};
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Parameter& parameter = problem.nuisance_parameters()[static_cast<std::size_t>(places[k])];
    // An order gives the place of an oscillation, not its size.
    if (parameter.is_place) {
      own.size(static_cast<Index>(k)) = 0;
    } else {
      own.size(static_cast<Index>(k)) += problem.model().values(places[k]) / parameter.prior_scale;
    }
  }
  own.precision = own.precision.inverse().eval();
  return own;
}

}  // namespace trammel::cause_search
