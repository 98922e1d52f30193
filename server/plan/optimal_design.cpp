#include "server/plan/optimal_design.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/check.h"

namespace trammel {

namespace {

constexpr double kLeastGain =
    1e-3;  // nat: exchanges for less would never end, and the difference does not matter
constexpr int kMostExchangeScans = 200;  // poses looked at: bounds the time of a plan
constexpr double kOffTheBound = 0.3;     // of the prior scale: an ordinary value of the parameter

Eigen::VectorXd prior_scales(const PhysicalModel& model) {
  const std::vector<Parameter> parameters = model.parameters();
  Eigen::VectorXd scales(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    scales(static_cast<Eigen::Index>(i)) = parameters[i].prior_scale;
  }
  return scales;
}

/// log det(M + rowsᵀ rows) of some of the columns, while candidates are added and removed.
class GrowingDeterminant {
 public:
  GrowingDeterminant(Eigen::MatrixXd columns, Eigen::Index rows_each, Eigen::MatrixXd information)
      : columns_(std::move(columns)), rows_each_(rows_each), information_(std::move(information)) {}

  void add(std::size_t candidate, double sign = 1) {
    const auto block = block_of(columns_, candidate);
    information_.noalias() += sign * block * block.transpose();
  }
  [[nodiscard]] double value() const { return log_det(information_); }

  /// The gain of each candidate: log det(I + J M⁻¹ Jᵀ), the rank-R update of a determinant.
  [[nodiscard]] Eigen::VectorXd gains() const {
    const Eigen::LLT<Eigen::MatrixXd> factor(information_);
    const Eigen::MatrixXd whitened = factor.matrixL().solve(columns_);
    const auto count = static_cast<std::size_t>(columns_.cols() / rows_each_);
    Eigen::VectorXd gains(static_cast<Eigen::Index>(count));
    Eigen::MatrixXd gram(rows_each_, rows_each_);
    for (std::size_t i = 0; i < count; ++i) {
      const auto block = block_of(whitened, i);
      gram.noalias() = block.transpose() * block;
      gram.diagonal().array() += 1;
      gains(static_cast<Eigen::Index>(i)) = log_det(gram);
    }
    return gains;
  }

 private:
  [[nodiscard]] Eigen::Block<const Eigen::MatrixXd> block_of(const Eigen::MatrixXd& columns,
                                                             std::size_t candidate) const {
    return columns.block(0, rows_each_ * static_cast<Eigen::Index>(candidate), columns.rows(),
                         rows_each_);
  }

  Eigen::MatrixXd columns_;  // P x (R n): the candidates' rows, transposed
  Eigen::Index rows_each_;
  Eigen::MatrixXd information_;
};

/// The criterion: log det of all parameters, less that of the nuisance parameters.
class Criterion {
 public:
  Criterion(const DesignCandidates& candidates, const Eigen::MatrixXd& information,
            const std::vector<Eigen::Index>& nuisance)
      : all_(candidates.rows.transpose(), candidates.rows_each, information) {
    if (nuisance.empty()) return;
    nuisance_.emplace(Eigen::MatrixXd(candidates.rows(Eigen::all, nuisance).transpose()),
                      candidates.rows_each, Eigen::MatrixXd(information(nuisance, nuisance)));
  }
  void add(std::size_t candidate, double sign = 1) {
    all_.add(candidate, sign);
    if (nuisance_) nuisance_->add(candidate, sign);
  }
  [[nodiscard]] double value() const { return all_.value() - (nuisance_ ? nuisance_->value() : 0); }
  [[nodiscard]] Eigen::VectorXd gains() const {
    return nuisance_ ? Eigen::VectorXd(all_.gains() - nuisance_->gains()) : all_.gains();
  }

 private:
  GrowingDeterminant all_;
  std::optional<GrowingDeterminant> nuisance_;
};

std::size_t best_of(const Eigen::VectorXd& gains, const std::vector<bool>& taken) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < taken.size(); ++i) {
    if (!taken[i] &&
        (!best || gains(static_cast<Eigen::Index>(i)) > gains(static_cast<Eigen::Index>(*best))))
      best = i;
  }
  TRAMMEL_CHECK(best);
  return *best;
}

std::vector<std::size_t> greedy(Criterion& criterion, std::size_t candidates, int count) {
  std::vector<std::size_t> chosen;
  std::vector<bool> taken(candidates, false);
  while (static_cast<int>(chosen.size()) < count) {
    const std::size_t best = best_of(criterion.gains(), taken);
    criterion.add(best);
    taken[best] = true;
    chosen.push_back(best);
  }
  return chosen;
}

/// Replaces one chosen candidate after the other by the best one, until a round gains nothing.
int exchange(Criterion& criterion, std::size_t candidates, std::vector<std::size_t>& chosen) {
  std::vector<bool> taken(candidates, false);
  for (const std::size_t i : chosen) taken[i] = true;
  int exchanges = 0;
  int unchanged = 0;
  for (int scan = 0; scan < kMostExchangeScans && unchanged < static_cast<int>(chosen.size());
       ++scan) {
    std::size_t& pose = chosen[static_cast<std::size_t>(scan) % chosen.size()];
    criterion.add(pose, -1);
    const Eigen::VectorXd gains = criterion.gains();
    taken[pose] = false;
    const std::size_t best = best_of(gains, taken);
    const bool better = gains(static_cast<Eigen::Index>(best)) >
                        gains(static_cast<Eigen::Index>(pose)) + kLeastGain;
    if (better) pose = best;
    exchanges += better ? 1 : 0;
    unchanged = better ? 0 : unchanged + 1;
    taken[pose] = true;
    criterion.add(pose);
  }
  return exchanges;
}

/// The chosen ones, the most telling first: a plan that is broken off early has lost the least.
std::vector<std::size_t> most_telling_first(const DesignCandidates& candidates,
                                            const Eigen::MatrixXd& information,
                                            const std::vector<Eigen::Index>& nuisance,
                                            const std::vector<std::size_t>& chosen) {
  const Eigen::Index each = candidates.rows_each;
  DesignCandidates few{
      Eigen::MatrixXd(each * static_cast<Eigen::Index>(chosen.size()), candidates.rows.cols()),
      each};
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    few.rows.middleRows(each * static_cast<Eigen::Index>(i), each) =
        candidates.rows.middleRows(each * static_cast<Eigen::Index>(chosen[i]), each);
  }
  Criterion criterion(few, information, nuisance);
  std::vector<std::size_t> order =
      greedy(criterion, chosen.size(), static_cast<int>(chosen.size()));
  for (std::size_t& i : order) i = chosen[i];
  return order;
}

}  // namespace

Eigen::MatrixXd whitened_jacobian(const PhysicalModel& model, const PoseContext& context,
                                  bool orientation) {
  Eigen::MatrixXd J;
  (void)model.pose_W(context, model.values, &J);
  const Tracker& tracker = model.cell->tracker;
  J = J * prior_scales(model).asDiagonal();
  J.topRows<3>() /= tracker.sigma;
  J.bottomRows<3>() /= tracker.sigma_rotation;
  return orientation ? J : Eigen::MatrixXd(J.topRows<3>());
}

DesignCandidates design_candidates(const PhysicalModel& model,
                                   const std::vector<PoseContext>& poses, bool orientation,
                                   int poses_each) {
  TRAMMEL_CHECK(poses_each > 0 && poses.size() % static_cast<std::size_t>(poses_each) == 0);
  const Eigen::Index rows_each_pose = orientation ? 6 : 3;
  DesignCandidates candidates{
      Eigen::MatrixXd(rows_each_pose * static_cast<Eigen::Index>(poses.size()),
                      model.parameter_count()),
      rows_each_pose * poses_each};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    candidates.rows.middleRows(rows_each_pose * static_cast<Eigen::Index>(i), rows_each_pose) =
        whitened_jacobian(model, poses[i], orientation);
  }
  return candidates;
}

Eigen::MatrixXd information_of(const PhysicalModel& model, const std::vector<PoseContext>& poses,
                               bool orientation) {
  const Eigen::MatrixXd rows = design_candidates(model, poses, orientation).rows;
  return rows.transpose() * rows;
}

double log_det(const Eigen::MatrixXd& matrix) {
  return 2 * Eigen::LLT<Eigen::MatrixXd>(matrix).matrixLLT().diagonal().array().log().sum();
}

Eigen::VectorXd planning_values(const PhysicalModel& model) {
  Eigen::VectorXd values = model.values;
  const std::vector<Parameter> parameters = model.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    double& value = values(static_cast<Eigen::Index>(i));
    if (value == parameters[i].lower) value += kOffTheBound * parameters[i].prior_scale;
  }
  return values;
}

Result<Design> optimal_design(const DesignCandidates& candidates,
                              const Eigen::MatrixXd& information, int count,
                              const std::vector<Eigen::Index>& nuisance) {
  TRAMMEL_CHECK(information.rows() == candidates.rows.cols() &&
                information.cols() == information.rows());
  if (count < 1 || static_cast<std::size_t>(count) > candidates.size()) {
    return refused("{} poses of {} candidates; expected 1 to {}", count, candidates.size(),
                   candidates.size())
        .of("count")
        .beyond(count, count < 1 ? 1 : candidates.size());
  }
  if (!information.allFinite() ||
      Eigen::LLT<Eigen::MatrixXd>(information).info() != Eigen::Success) {
    return refused("the information to start from is not positive definite")
        .next("it needs the prior");
  }
  Criterion criterion(candidates, information, nuisance);
  Design design;
  std::vector<std::size_t> chosen = greedy(criterion, candidates.size(), count);
  if (candidates.size() > chosen.size())
    design.exchanges = exchange(criterion, candidates.size(), chosen);
  design.criterion = criterion.value();
  design.chosen = most_telling_first(candidates, information, nuisance, chosen);
  return design;
}

Result<std::vector<std::size_t>> next_best_poses(const PhysicalModel& model,
                                                 const Eigen::MatrixXd& information,
                                                 const std::vector<PoseContext>& candidates,
                                                 int count, bool orientation) {
  return optimal_design(design_candidates(model, candidates, orientation), information, count)
      .map([](Design design) { return std::move(design.chosen); });
}

}  // namespace trammel
