#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"

/// Which poses tell most about a model's parameters. Parameters count in units of their priors, measurements in units
/// of the tracker's sigma: information 1 means that the data know as much as the prior does.
namespace trammel {

/// R x P: d(measurement) / d(parameters) of one pose at the model's values; R is 6 ([position; rotation vector] in W)
/// with `orientation`, else 3. The context needs a tool and a payload of the cell.
[[nodiscard]] Eigen::MatrixXd whitened_jacobian(const PhysicalModel& model, const PoseContext& context,
                                                bool orientation);

/// P x P: what `poses` together tell of the parameters, without any prior.
[[nodiscard]] Eigen::MatrixXd information_of(const PhysicalModel& model, const std::vector<PoseContext>& poses,
                                             bool orientation);

/// log det of a symmetric positive definite matrix.
[[nodiscard]] double log_det(const Eigen::MatrixXd& matrix);

/// Where to linearise a model that knows nothing yet: its values, but a parameter that stands on its lower bound (a
/// compliance of 0) moved off it by 0.3 of its prior scale, because causes that act through it (a payload through
/// compliance) would not show at all.
[[nodiscard]] Eigen::VectorXd planning_values(const PhysicalModel& model);

/// Candidates of one experiment, each the same number of rows: `rows` is (R n) x P, candidate i has rows R i...
struct DesignCandidates {
  Eigen::MatrixXd rows;
  Eigen::Index rows_each = 0;  ///< R

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(rows.rows() / rows_each); }
};

/// Each candidate `poses_each` consecutive ones of `poses` (2: the same pose approached from both sides).
[[nodiscard]] DesignCandidates design_candidates(const PhysicalModel& model, const std::vector<PoseContext>& poses,
                                                 bool orientation, int poses_each = 1);

struct Design {
  std::vector<std::size_t> chosen;  ///< candidates, the most telling first; none twice
  double criterion = 0;             ///< reached, nat
  int exchanges = 0;                ///< poses swapped for better ones after the greedy choice
};

/// Chooses `count` candidates on top of `information` (P x P, the prior included; positive definite) so that
/// log det(information + sum of JᵀJ) is large: greedily, then by exchanging one pose at a time while that gains
/// (bounded). Directions that no candidate shows stay at their prior and cost nothing. Where `nuisance` names columns,
/// they are estimated but not asked for (D_s-optimal): log det of all minus log det of the nuisance block.
/// Refuses a count above the number of candidates and an information matrix that is not positive definite.
[[nodiscard]] Result<Design> optimal_design(const DesignCandidates& candidates, const Eigen::MatrixXd& information,
                                            int count, const std::vector<Eigen::Index>& nuisance = {});

/// Which of `candidates` to measure next, the most telling first (indices, `count` of them), for a model at its present
/// values of which `information` is known: the inverse of the parameters' posterior covariance in prior units (identity
/// before any measurement; `D C⁻¹ D` with D the prior scales and C the covariance of a calibration). D-optimal as
/// optimal_design(), which also says what is refused.
[[nodiscard]] Result<std::vector<std::size_t>> next_best_poses(const PhysicalModel& model,
                                                               const Eigen::MatrixXd& information,
                                                               const std::vector<PoseContext>& candidates, int count,
                                                               bool orientation = true);

}  // namespace trammel
