#include "server/plan/separation.h"

#include <algorithm>
#include <cmath>

#include "server/plan/optimal_design.h"

namespace trammel {

Result<CausePair> make_cause_pair(const std::shared_ptr<const Cell>& cell, const std::string& cause,
                                  const std::string& other) {
  const ErrorSourcePtr first = TRY(make_error_source(cause, *cell));
  const ErrorSourcePtr second = TRY(make_error_source(other, *cell));
  if (first->name() == second->name()) {
    return failure(ErrorCode::kUsage, "'{}' and '{}' are the same cause", cause, other)
        .of("--criterion")
        .with_text(cause);
  }
  std::vector<std::string> specs = cell->model.error_sources;
  for (const std::string& spec : {cause, other}) {
    const std::string name = (*make_error_source(spec, *cell))->name();
    const bool known = std::any_of(specs.begin(), specs.end(), [&](const std::string& own) {
      const Result<ErrorSourcePtr> source = make_error_source(own, *cell);
      return source && (*source)->name() == name;
    });
    if (!known) specs.push_back(spec);
  }
  PhysicalModel model = TRY(make_physical_model(cell, specs));
  CausePair pair{std::move(model), cause, other, {}, {}};
  pair.model.values = planning_values(pair.model);
  Eigen::Index column = 0;
  for (const ErrorSourcePtr& source : pair.model.sources) {
    std::vector<Eigen::Index>& into = source->name() == first->name() ? pair.columns : pair.rest;
    for (std::size_t i = 0; i < source->parameters().size(); ++i) into.push_back(column++);
  }
  return pair;
}

Separability separability(const CausePair& pair, const Eigen::MatrixXd& information) {
  Eigen::MatrixXd rest = information(pair.rest, pair.rest);
  rest.diagonal().array() += 1;
  const Eigen::MatrixXd effect = information(pair.columns, pair.columns);
  const Eigen::MatrixXd shared = information(pair.rest, pair.columns);
  Eigen::MatrixXd left = effect - shared.transpose() * rest.llt().solve(shared);
  left = 0.5 * (left + left.transpose()).eval();
  left.diagonal().array() += 1;

  Separability result;
  // The strength of one parameter while the others are free: 1 / (its posterior variance), less the
  // prior's 1.
  const Eigen::VectorXd variance =
      left.llt().solve(Eigen::MatrixXd::Identity(left.rows(), left.rows())).diagonal();
  const std::vector<Parameter> parameters = pair.model.parameters();
  for (Eigen::Index k = 0; k < left.rows(); ++k) {
    const double strength = std::max(1 / variance(k) - 1, 0.0);
    const double share = effect(k, k) > 0 ? std::sqrt(strength / effect(k, k)) : 0.0;
    const auto column = static_cast<std::size_t>(pair.columns[static_cast<std::size_t>(k)]);
    result.parameters.push_back(
        {parameters[column].name, effect(k, k), strength, std::min(share, 1.0)});
  }
  result.strength = std::expm1(log_det(left) / static_cast<double>(left.rows()));
  return result;
}

std::string what_would_separate(const std::string& cause, const std::string& other) {
  const auto remedy = [](const std::string& spelling) {
    const CauseRecord* record = find_cause(spelling);
    return record == nullptr ? causes::remedies::kWiderRange : record->told_apart_by;
  };
  const causes::Remedy one = remedy(cause);
  const causes::Remedy another = remedy(other);
  return std::string(one.rank <= another.rank ? one.text : another.text);
}

}  // namespace trammel
