#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/error_sources/physical_model.h"

/// The choice of poses with the most information about a model's parameters. Parameters are in
/// units of their priors, measurements in units of the tracker's sigma: with information 1, the
/// data tell as much as the prior.
namespace trammel {

/// R x P: d(measurement) / d(parameters) of one pose at the model's values; R is 6 ([position;
/// rotation vector] in W) with `orientation`, else 3. The context needs a tool and a payload of the
/// cell.
[[nodiscard]] Eigen::MatrixXd whitened_jacobian(const PhysicalModel& model,
                                                const PoseContext& context, bool orientation);

/// P x P: the information of all `poses` together, without the priors.
[[nodiscard]] Eigen::MatrixXd information_of(const PhysicalModel& model,
                                             const std::vector<PoseContext>& poses,
                                             bool orientation);

/// log det of a symmetric positive definite matrix.
[[nodiscard]] double log_det(const Eigen::MatrixXd& matrix);

/// The values at which to linearise a model before any measurement: its own, with each parameter at
/// its lower bound (a compliance of 0) moved off by 0.3 of its prior scale. Otherwise causes that
/// act through such a parameter, as a payload through compliance, would not show.
[[nodiscard]] Eigen::VectorXd planning_values(const PhysicalModel& model);

/// The candidates of an experiment: `rows` is (R n) x P; candidate i has the R rows from R i on.
struct DesignCandidates {
  Eigen::MatrixXd rows;
  Eigen::Index rows_each = 0;  ///< R

  [[nodiscard]] std::size_t size() const {
    return static_cast<std::size_t>(rows.rows() / rows_each);
  }
};

/// Candidates of `poses_each` consecutive poses each (2: the same pose approached from both sides).
[[nodiscard]] DesignCandidates design_candidates(const PhysicalModel& model,
                                                 const std::vector<PoseContext>& poses,
                                                 bool orientation, int poses_each = 1);

struct Design {
  std::vector<std::size_t> chosen;  ///< indices of candidates, the most telling first; none twice
  double criterion = 0;             ///< nat, of the chosen ones
  int exchanges = 0;                ///< poses swapped for better ones after the greedy choice
};

/// Chooses `count` candidates so that log det(information + sum of JᵀJ) is large: D-optimal. First
/// greedily, then by exchanging one candidate at a time while that gains. `information` (P x P,
/// positive definite) is the initial one, including the prior. Parameters in the columns `nuisance`
/// are estimated but not of interest (D_s-optimal): the criterion is log det of all minus log det
/// of the nuisance block. Directions that no candidate shows stay at their prior and cost nothing.
/// Refuses a count above the number of candidates, and an information matrix that is not positive
/// definite.
[[nodiscard]] Result<Design> optimal_design(const DesignCandidates& candidates,
                                            const Eigen::MatrixXd& information, int count,
                                            const std::vector<Eigen::Index>& nuisance = {});

/// The indices of the `count` of `candidates` to measure next, the most informative first. The
/// model is linearised at its values. `information` is the inverse of the posterior covariance in
/// prior units: the identity before any measurement, `D C⁻¹ D` with D the prior scales and C the
/// covariance of a calibration. D-optimal; refuses the same as optimal_design().
[[nodiscard]] Result<std::vector<std::size_t>> next_best_poses(
    const PhysicalModel& model, const Eigen::MatrixXd& information,
    const std::vector<PoseContext>& candidates, int count, bool orientation = true);

}  // namespace trammel
