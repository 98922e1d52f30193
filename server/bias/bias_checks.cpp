#include "server/bias/bias_checks.h"

#include <cmath>

#include "server/base/units.h"
#include "server/bias/flange/flange_views.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFewestObservations =
    10;  // an arm of six joints has eight hyperparameters: fewer decide nothing
constexpr std::string_view kAxis[] = {"x", "y", "z"};

Status check_shape(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  const Index n = q.rows();
  if (n < kFewestObservations)
    return refused("{} observations, at least {}", n, kFewestObservations)
        .beyond(n, kFewestObservations)
        .in("bias data");
  if (q.cols() < 1) return refused("0 joints, at least 1").beyond(0, 1).in("bias data");
  if (residual_B.rows() != n || residual_B.cols() != kCoordinates)
    return refused("residual is {} x {}, should be {} x 3", residual_B.rows(), residual_B.cols(), n)
        .of("residual")
        .beyond(residual_B.rows(), n)
        .in("bias data");
  if (sigma.size() != n)
    return refused("{} sigmas for {} observations", sigma.size(), n)
        .of("sigma")
        .beyond(sigma.size(), n)
        .in("bias data");
  return {};
}

Status check_numbers(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  for (Index i = 0; i < q.rows(); ++i) {
    for (Index j = 0; j < q.cols(); ++j) {
      if (!std::isfinite(q(i, j)))
        return refused("joint {} is {}, not finite", j + 1, q(i, j))
            .in("bias data")
            .of(fmt::format("joint {}", j + 1))
            .with_value(q(i, j))
            .at_row(i + 1);
    }
    for (Index d = 0; d < kCoordinates; ++d) {
      if (!std::isfinite(residual_B(i, d)))
        return refused("residual {} is {}, not finite", kAxis[d], residual_B(i, d))
            .in("bias data")
            .of(fmt::format("residual {}", kAxis[d]))
            .with_value(residual_B(i, d))
            .at_row(i + 1);
    }
    if (!std::isfinite(sigma[i]) || sigma[i] < 0)
      return refused("sigma is {} mm, should be finite and not negative", to_mm(sigma[i]))
          .of("sigma")
          .beyond(to_mm(sigma[i]), 0)
          .in("bias data")
          .at_row(i + 1);
  }
  return {};
}

}  // namespace

Status check_observations(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  return check_shape(q, residual_B, sigma).and_then([&] {
    return check_numbers(q, residual_B, sigma);
  });
}

Status check_features(const std::string& kernel, const std::vector<BiasFeatures>& features,
                      Index n) {
  if (n > kMostCoupled)
    return refused("bias kernel `{}`: {} observations, at most {} with joint_map or parameters",
                   kernel, n, kMostCoupled)
        .of("bias")
        .with_text(kernel)
        .beyond(n, kMostCoupled);
  if (static_cast<Index>(features.size()) != n)
    return refused("features of {} poses for {} observations, kernel `{}` needs them",
                   features.size(), n, kernel)
        .in("bias data")
        .of("features")
        .beyond(features.size(), n);
  const BiasFeatures& first = features.front();
  for (std::size_t i = 0; i < features.size(); ++i) {
    const BiasFeatures& at = features[i];
    if (at.by_joint.rows() != 6 || at.by_joint.cols() != first.by_joint.cols() ||
        at.by_parameter.rows() != 6 || at.by_parameter.cols() != first.by_parameter.cols())
      return refused("features are {} x {} and {} x {}, should be 6 x {} and 6 x {}",
                     at.by_joint.rows(), at.by_joint.cols(), at.by_parameter.rows(),
                     at.by_parameter.cols(), first.by_joint.cols(), first.by_parameter.cols())
          .in("bias data")
          .of("features")
          .at_row(i + 1);
    if (!at.by_joint.allFinite() || !at.by_parameter.allFinite() || !at.lever_F.allFinite() ||
        !at.R_BF.allFinite())
      return refused("a feature is not finite").of("features").in("bias data").at_row(i + 1);
  }
  return {};
}

Status check_flange(const MatrixXd& q, const std::vector<BiasFeatures>& features) {
  const Index numbers = views_of(q, VectorXd::Ones(q.rows()), features).size;
  if (numbers > kMostFlangeNumbers)
    return refused("bias at the flange: its joint vectors tell {} numbers, at most {}", numbers,
                   kMostFlangeNumbers)
        .of("bias")
        .beyond(numbers, kMostFlangeNumbers)
        .next("take a kernel without flange, or fewer poses");
  return {};
}

Status check_hyperparameters(const BiasState& state, const SpelledBias& bias) {
  const Index rows = bias.kernel->parameter_count(state.q.cols()) + 2;
  if (state.hyperparameters.rows() != rows || state.hyperparameters.cols() != kCoordinates)
    return refused("bias state: hyperparameters are {} x {}, should be {} x 3 for kernel `{}`",
                   state.hyperparameters.rows(), state.hyperparameters.cols(), rows, state.kernel)
        .of("hyperparameters")
        .beyond(state.hyperparameters.rows(), rows);
  if (state.offset.size() != kCoordinates)
    return refused("bias state: {} offsets, should be 3", state.offset.size())
        .of("offset")
        .beyond(state.offset.size(), kCoordinates);
  Index of_blocks = bias.flange ? rows - 1 : 0;  // of the rotation: kernel parameters and its size
  for (const LinearBlockPtr& block : bias.blocks)
    of_blocks += block->parameter_count(state.features.front());
  if (state.block_hyperparameters.size() != of_blocks)
    return refused("bias state: {} hyperparameters of blocks, should be {} for kernel `{}`",
                   state.block_hyperparameters.size(), of_blocks, state.kernel)
        .of("block_hyperparameters")
        .beyond(state.block_hyperparameters.size(), of_blocks);
  if (!state.hyperparameters.allFinite() || !state.offset.allFinite() ||
      !state.block_hyperparameters.allFinite())
    return refused("bias state: a hyperparameter or offset is not finite").of("hyperparameters");
  return {};
}

}  // namespace trammel
