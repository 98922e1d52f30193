#include <algorithm>
#include <cmath>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/numerics.h"

namespace trammel {
namespace {

class RadialKernel : public Kernel {
 public:
  RadialKernel(std::string_view name, RadialShape shape) : name_(name), shape_(shape) {}

  std::string_view name() const override { return name_; }
  Eigen::Index parameter_count(Eigen::Index joints) const override { return joints; }
  Eigen::Index feature_count(Eigen::Index joints) const override { return joints + 1; }

  SearchBox search_box(const Eigen::MatrixXd& q) const override {
    const Eigen::RowVectorXd mean = q.colwise().mean();
    SearchBox box{Eigen::VectorXd(q.cols()), Eigen::VectorXd(q.cols())};
    for (Eigen::Index k = 0; k < q.cols(); ++k) {
      const double spread = std::sqrt((q.col(k).array() - mean[k]).square().mean());
      const double scale =
          spread > 1e-6 ? spread : 1.0;  // a joint that never moved has no length scale to find
      box.low[k] = std::log(0.5 * scale);
      box.high[k] = std::log(10.0 * scale);
    }
    return box;
  }

  // z = q / l, and |z|²/2 so that a squared distance is a dot product.
  void features(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                Eigen::Index ld) const override {
    const Eigen::VectorXd inverse_scale = (-parameters).array().exp();
    const Eigen::Index n = q.cols();
    Eigen::Map<Eigen::VectorXd> half_square(table + n * ld, q.rows());
    half_square.setZero();
    for (Eigen::Index k = 0; k < n; ++k) {
      Eigen::Map<Eigen::VectorXd> z(table + k * ld, q.rows());
      z = q.col(k) * inverse_scale[k];
      half_square += 0.5 * z.cwiseAbs2();
    }
  }

  void diagonal(const Eigen::VectorXd& /*parameters*/, const FeatureBlock& a,
                double* k) const override {
    std::fill_n(k, a.rows, 1.0);
  }

  void tile(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
            double* k, Eigen::Index ldk) const override {
    numerics().radial_tile(shape_, parameters.size(), a.rows, a.data, a.ld, b.rows, b.data, b.ld, k,
                           ldk);
  }

  void tile_gradient(const Eigen::VectorXd& parameters, const FeatureBlock& a,
                     const FeatureBlock& b, const double* g, Eigen::Index ldg,
                     double* gradient) const override {
    numerics().radial_gradient(shape_, parameters.size(), a.rows, a.data, a.ld, b.rows, b.data,
                               b.ld, g, ldg, gradient);
  }

  void weighted_sum(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    numerics().radial_weighted_sum(shape_, parameters.size(), a.rows, a.data, a.ld, b.rows, b.data,
                                   b.ld, weights, out);
  }

 private:
  std::string_view name_;
  RadialShape shape_;
};

}  // namespace

std::shared_ptr<const Kernel> make_radial_kernel(std::string_view name) {
  if (name == "se") return std::make_shared<RadialKernel>("se", RadialShape::kSquaredExponential);
  if (name == "matern32") return std::make_shared<RadialKernel>("matern32", RadialShape::kMatern32);
  if (name == "matern52") return std::make_shared<RadialKernel>("matern52", RadialShape::kMatern52);
  return nullptr;
}

}  // namespace trammel
