#pragma once

#include <Eigen/Sparse>

#include "server/bias/coupled/coupled_likelihood.h"

namespace trammel {

/// At one joint vector, of D outputs.
struct CoupledPrediction {
  Eigen::VectorXd mean;
  Eigen::VectorXd own_mean;    ///< the part that the processes of the outputs add to H w
  Eigen::MatrixXd covariance;  ///< D x D, of the functions themselves
  Eigen::VectorXd prior;       ///< prior variances
};

/// Coupled processes, conditioned on their data. Immutable, thread-safe.
/// At a target, with h = H(q) scaled and k_d the covariance of output d with the data: R_d = h_d -
/// k_dᵀ M_d⁻¹ H_d and
///   mean_d = h_d ŵ + k_dᵀ α_d,  covariance = diag(k_d** - k_dᵀ M_d⁻¹ k_d) + R A⁻¹ Rᵀ.
/// The parts that do not mix outputs come from a GaussianProcess conditioned on y_d - H_d ŵ.
class CoupledPosterior {
 public:
  /// Empty when a covariance is not positive definite.
  [[nodiscard]] static std::optional<CoupledPosterior> condition(
      std::shared_ptr<const Kernel> kernel, const LinearBlocks& blocks, const CoupledData& data,
      const CoupledHyperparameters& at, VarianceForm form = VarianceForm::kCompressed);

  /// Predicts at the rows of `q`; `columns` is H there, not scaled, as in CoupledData. With
  /// kCompressed, training poses with a negligible covariance with the target are left out. This
  /// changes the variance of an output by less than 0.003 of its noise variance (bound: decision
  /// 46).
  [[nodiscard]] std::vector<CoupledPrediction> predict(
      const Eigen::MatrixXd& q, const std::vector<Eigen::MatrixXd>& columns) const;
  /// M x D: the contribution of the outputs' own processes, in addition to H w.
  [[nodiscard]] Eigen::MatrixXd own_mean(const Eigen::MatrixXd& q) const;

  /// The number of outputs whose uncertainty is computed from the points near a target alone.
  [[nodiscard]] Eigen::Index outputs_from_near_points() const;

  /// p: ŵ of the columns of H, not scaled.
  [[nodiscard]] const Eigen::VectorXd& weights() const { return weights_; }
  [[nodiscard]] double log_likelihood() const { return log_likelihood_; }

  /// N x D: each row predicted with all outputs of all rows of its joint vector left out; mean, and
  /// variance of the measurement (Rasmussen & Williams, eqs. 5.10-5.12, with blocks of C⁻¹ instead
  /// of its diagonal).
  [[nodiscard]] const Eigen::MatrixXd& leave_one_out_mean() const { return leave_one_out_mean_; }
  [[nodiscard]] const Eigen::MatrixXd& leave_one_out_variance() const {
    return leave_one_out_variance_;
  }
  /// Mean square of the standardised errors in threefold cross-validation by runs of ten poses,
  /// with the hyperparameters as they are: 1 where the predicted variances are right.
  [[nodiscard]] double surprise() const { return surprise_; }
  /// N x D: prior variances at the data.
  [[nodiscard]] const Eigen::MatrixXd& prior() const { return prior_; }

 private:
  CoupledPosterior() = default;
  void leave_out(const CoupledSolution& solution, const CoupledData& data);
  /// Computes R of an output from the points near a target, if these are as informative as all
  /// points.
  void explain_by_near(std::size_t output, const CoupledData& data,
                       const CoupledSolution& solution);
  /// Computes `explained_` of an output from few of its points, if these can replace all.
  void explain_by_few(std::size_t output, const Eigen::VectorXd& noise);
  /// The contribution of one output at some targets.
  struct Part {
    Eigen::MatrixXd R;      // p x M: R_dᵀ
    Eigen::VectorXd known;  // k_d** - k_dᵀ M_d⁻¹ k_d
    Eigen::VectorXd prior;  // of both parts
  };
  // The poses with a relevant covariance, in rising order.
  [[nodiscard]] std::vector<Eigen::Index> near_poses(const double* k, std::size_t output) const;
  [[nodiscard]] Part part_of(const Eigen::MatrixXd& q, const Eigen::MatrixXd& columns,
                             Eigen::Index d) const;
  // Computes the part from the points near each target.
  [[nodiscard]] Part near_part_of(const Eigen::MatrixXd& q, const Eigen::MatrixXd& columns,
                                  Eigen::Index d) const;
  // R A⁻¹ Rᵀ of target i.
  [[nodiscard]] Eigen::MatrixXd shared_covariance(const std::vector<Part>& parts,
                                                  Eigen::Index i) const;
  // Predicts a few targets at once.
  void predict_few(const Eigen::MatrixXd& q, const std::vector<Eigen::MatrixXd>& columns,
                   std::vector<CoupledPrediction>* out) const;

  std::shared_ptr<const Kernel> kernel_;
  Eigen::Index points_ = 0;
  std::vector<GpHyperparameters> hyperparameters_;
  std::vector<GaussianProcess> outputs_;  // of y_d - H_d ŵ
  std::vector<AlignedMatrix> features_;
  struct FewPoints {
    AlignedMatrix features;
    Eigen::Index size = 0;
  };
  std::vector<std::optional<FewPoints>> few_;  // D: u; empty: all points
  std::vector<Eigen::MatrixXd> explained_;  // D: Hᵀ M⁻¹, p x N; of few points Hᵀ M⁻¹ R_xu R_uu⁻¹
  // D: H scaled, N x p, if R is computed from near points; else empty
  std::vector<Eigen::SparseMatrix<double, Eigen::RowMajor>> rows_;
  std::vector<std::vector<double>>
      inverse_;                      // D: M⁻¹, lower triangle row after row; empty: not needed
  std::vector<double> passed_over_;  // D: root sum of squares of the covariances that do not matter
  AlignedMatrix packed_root_;        // L⁻¹ of A = L Lᵀ, as Numerics packs it
  Eigen::VectorXd column_scale_;
  Eigen::VectorXd weights_;
  double log_likelihood_ = 0;
  Eigen::MatrixXd leave_one_out_mean_;
  Eigen::MatrixXd leave_one_out_variance_;
  double surprise_ = 1;
  Eigen::MatrixXd prior_;
};

}  // namespace trammel
