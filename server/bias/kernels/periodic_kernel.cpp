#include <numbers>

#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::VectorXd;

constexpr double kLeastPeriod = 0.15;  // over a joint's range: poses can hardly show shorter ones

// With u = 2πq/p the kernel is the squared exponential of (cos u, sin u) / l, and is computed in
// that form. Features: cos u / l of each joint, sin u / l of each, half the sum of their squares,
// and u of each for the slope by p.
class PeriodicKernel : public Kernel {
 public:
  std::string_view name() const override { return "periodic"; }
  Index parameter_count(Index joints) const override { return 2 * joints; }
  Index feature_count(Index joints) const override { return 3 * joints + 1; }

  SearchBox search_box(const Eigen::MatrixXd& q) const override {
    const Index joints = q.cols();
    SearchBox box{VectorXd::Constant(2 * joints, std::log(0.5)),
                  VectorXd::Constant(2 * joints, std::log(10.0))};
    for (Index k = 0; k < joints; ++k) {
      const double range = q.col(k).maxCoeff() - q.col(k).minCoeff();
      const double longest =
          range > 1e-6 ? range : 1.0;  // a joint that never moved has no period to find
      box.low[joints + k] = std::log(kLeastPeriod * longest);
      box.high[joints + k] = std::log(longest);
    }
    return box;
  }

  void features(const VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                Index ld) const override {
    const Index joints = q.cols();
    auto columns = columns_of(table, q.rows(), 3 * joints + 1, ld).array();
    columns.col(2 * joints).setZero();
    for (Index k = 0; k < joints; ++k) {
      const double inverse_scale = std::exp(-parameters[k]);
      const ArrayXd u =
          q.col(k).array() * (2.0 * std::numbers::pi * std::exp(-parameters[joints + k]));
      columns.col(k) = inverse_scale * u.cos();
      columns.col(joints + k) = inverse_scale * u.sin();
      columns.col(2 * joints) += 0.5 * (columns.col(k).square() + columns.col(joints + k).square());
      columns.col(2 * joints + 1 + k) = u;
    }
  }

  void diagonal(const VectorXd& /*parameters*/, const FeatureBlock& a, double* k) const override {
    std::fill_n(k, a.rows, 1.0);
  }

  void tile(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    numerics().radial_tile(RadialShape::kSquaredExponential, parameters.size(), a.rows, a.data,
                           a.ld, b.rows, b.data, b.ld, k, ldk);
  }

  // dk/dlog l = k |Δz|², dk/dlog p = k Δu sin Δu / l².
  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    const Index joints = parameters.size() / 2;
    const AlignedMatrix k = tile_of(*this, parameters, a, b);
    const auto x = columns_of(a, 3 * joints + 1).array();
    const auto y = columns_of(b, 3 * joints + 1).array();
    const auto weight = columns_of(g, a.rows, b.rows, ldg).array();
    for (Index j = 0; j < b.rows; ++j) {
      const ArrayXd slope = weight.col(j) * k.map().col(j).head(a.rows).array();
      for (Index d = 0; d < joints; ++d) {
        const Index sine = joints + d;
        const Index angle = 2 * joints + 1 + d;
        const ArrayXd square = (x.col(d) - y(j, d)).square() + (x.col(sine) - y(j, sine)).square();
        const ArrayXd sine_of_difference = x.col(sine) * y(j, d) - x.col(d) * y(j, sine);
        gradient[d] += (slope * square).sum();
        gradient[joints + d] += (slope * (x.col(angle) - y(j, angle)) * sine_of_difference).sum();
      }
    }
  }

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    numerics().radial_weighted_sum(RadialShape::kSquaredExponential, parameters.size(), a.rows,
                                   a.data, a.ld, b.rows, b.data, b.ld, weights, out);
  }
};

}  // namespace

KernelPtr make_periodic_kernel() { return std::make_shared<PeriodicKernel>(); }

}  // namespace trammel
