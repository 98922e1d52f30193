#include <bit>
#include <cstdint>

#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// 53 bits made from all joints, which a double holds exactly. Two of 50,000 different poses share
// them in one of 10 million such sets. Mixed as in SplitMix64. Adding 0 makes -0 and 0 equal.
double fingerprint(const Eigen::RowVectorXd& q) {
  std::uint64_t state = 0;
  for (Index k = 0; k < q.size(); ++k) {
    std::uint64_t mixed = (state ^ std::bit_cast<std::uint64_t>(q[k] + 0.0)) + 0x9e3779b97f4a7c15U;
    mixed = (mixed ^ (mixed >> 30U)) * 0xbf58476d1ce4e5b9U;
    mixed = (mixed ^ (mixed >> 27U)) * 0x94d049bb133111ebU;
    state = mixed ^ (mixed >> 31U);
  }
  return static_cast<double>(state >> 11U);
}

class WhiteKernel : public Kernel {
 public:
  std::string_view name() const override { return "white"; }
  Index parameter_count(Index /*joints*/) const override { return 0; }
  Index feature_count(Index /*joints*/) const override { return 1; }
  SearchBox search_box(const Eigen::MatrixXd& /*q*/) const override {
    return {VectorXd(0), VectorXd(0)};
  }

  void features(const VectorXd& /*parameters*/, const Eigen::MatrixXd& q, double* table,
                Index /*ld*/) const override {
    for (Index i = 0; i < q.rows(); ++i) table[i] = fingerprint(q.row(i));
  }

  void diagonal(const VectorXd& /*parameters*/, const FeatureBlock& a, double* k) const override {
    std::fill_n(k, a.rows, 1.0);
  }

  void tile(const VectorXd& /*parameters*/, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    for (Index j = 0; j < b.rows; ++j) {
      for (Index i = 0; i < a.rows; ++i) k[i + j * ldk] = a.data[i] == b.data[j] ? 1.0 : 0.0;
    }
  }

  void tile_gradient(const VectorXd& /*parameters*/, const FeatureBlock& /*a*/,
                     const FeatureBlock& /*b*/, const double* /*g*/, Index /*ldg*/,
                     double* /*gradient*/) const override {}

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    weighted_sum_by_tiles(*this, parameters, a, b, weights, out);
  }
};

}  // namespace

KernelPtr make_white_kernel() { return std::make_shared<WhiteKernel>(); }

}  // namespace trammel
