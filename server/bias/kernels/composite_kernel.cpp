#include <utility>

#include "server/bias/kernels/kernel_tiles.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastAmplitude =
    0.05;  // least share of the first part's size with which a search starts

std::string joined(const std::vector<KernelPtr>& parts, std::string_view separator) {
  std::string name = "(";
  for (const KernelPtr& part : parts)
    name.append(name.size() == 1 ? "" : separator).append(part->name());
  return name + ")";
}

/// Has the parameters and features of its parts side by side. A part may have a log amplitude
/// before its parameters.
class CompositeKernel : public Kernel {
 public:
  CompositeKernel(std::vector<KernelPtr> parts, std::string_view separator)
      : parts_(std::move(parts)), name_(joined(parts_, separator)) {}

  std::string_view name() const override { return name_; }

  Index parameter_count(Index joints) const override {
    Index count = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i)
      count += amplitudes(i) + parts_[i]->parameter_count(joints);
    return count;
  }

  Index feature_count(Index joints) const override {
    Index count = 0;
    for (const KernelPtr& part : parts_) count += part->feature_count(joints);
    return count;
  }

  SearchBox search_box(const MatrixXd& q) const override {
    SearchBox box{VectorXd(parameter_count(q.cols())), VectorXd(parameter_count(q.cols()))};
    box.low.setConstant(std::log(kLeastAmplitude));
    box.high.setZero();
    for (const Place& place : places(q.cols())) {
      const SearchBox own = place.kernel->search_box(q);
      box.low.segment(place.parameter, place.parameters) = own.low;
      box.high.segment(place.parameter, place.parameters) = own.high;
    }
    return box;
  }

  void features(const VectorXd& parameters, const MatrixXd& q, double* table,
                Index ld) const override {
    for (const Place& place : places(q.cols()))
      place.kernel->features(place.of(parameters), q, table + place.feature * ld, ld);
  }

  void diagonal(const VectorXd& parameters, const FeatureBlock& a, double* k) const override {
    auto total = columns_of(k, a.rows, 1, a.rows).array();
    total = neutral();
    MatrixXd own(a.rows, 1);
    for (const Place& place : places_for(parameters)) {
      place.kernel->diagonal(place.of(parameters), place.of(a), own.data());
      join(place, parameters, own.array(), total);
    }
  }

  void tile(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
            Index ldk) const override {
    auto total = columns_of(k, a.rows, b.rows, ldk).array();
    total = neutral();
    for (const Place& place : places_for(parameters)) {
      const AlignedMatrix own =
          tile_of(*place.kernel, place.of(parameters), place.of(a), place.of(b));
      join(place, parameters, own.map().topRows(a.rows).array(), total);
    }
  }

 protected:
  /// The places of one part's parameters and features.
  struct Place {
    const Kernel* kernel;
    Index parameter;  // its first, after the amplitude
    Index parameters;
    Index feature;

    VectorXd of(const VectorXd& all) const { return all.segment(parameter, parameters); }
    FeatureBlock of(const FeatureBlock& all) const {
      return {all.data + feature * all.ld, all.rows, all.ld};
    }
  };

  std::vector<Place> places(Index joints) const {
    std::vector<Place> places;
    Index parameter = 0;
    Index feature = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const Index count = parts_[i]->parameter_count(joints);
      places.push_back({parts_[i].get(), parameter + amplitudes(i), count, feature});
      parameter += amplitudes(i) + count;
      feature += parts_[i]->feature_count(joints);
    }
    return places;
  }

  std::vector<Place> places_for(const VectorXd& parameters) const {
    return places(joints_of(*this, parameters.size()));
  }

  using Table = Eigen::Ref<Eigen::ArrayXXd, 0, Eigen::OuterStride<>>;
  using ConstTable = Eigen::Ref<const Eigen::ArrayXXd, 0, Eigen::OuterStride<>>;

 private:
  // The number of log amplitudes before the parameters of a part: 0 or 1.
  virtual Index amplitudes(std::size_t part) const = 0;
  // `total` before any part, and with one more part.
  virtual double neutral() const = 0;
  virtual void join(const Place& place, const VectorXd& parameters, const ConstTable& own,
                    Table total) const = 0;

  std::vector<KernelPtr> parts_;
  std::string name_;
};

class SumKernel : public CompositeKernel {
 public:
  explicit SumKernel(std::vector<KernelPtr> parts) : CompositeKernel(std::move(parts), " + ") {}

  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    for (const Place& place : places_for(parameters)) {
      const VectorXd own_parameters = place.of(parameters);
      const double v = variance(place, parameters);
      VectorXd own = VectorXd::Zero(place.parameters);
      place.kernel->tile_gradient(own_parameters, place.of(a), place.of(b), g, ldg, own.data());
      Eigen::Map<VectorXd>(gradient + place.parameter, place.parameters) += v * own;
      if (is_first(place)) continue;
      const AlignedMatrix k = tile_of(*place.kernel, own_parameters, place.of(a), place.of(b));
      const auto weights = columns_of(g, a.rows, b.rows, ldg);
      gradient[place.parameter - 1] +=
          2.0 * v * weights.cwiseProduct(k.map().topRows(a.rows)).sum();
    }
  }

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    Eigen::Map<VectorXd> total(out, b.rows);
    VectorXd own(b.rows);
    total.setZero();
    for (const Place& place : places_for(parameters)) {
      place.kernel->weighted_sum(place.of(parameters), place.of(a), place.of(b), weights,
                                 own.data());
      total += variance(place, parameters) * own;
    }
  }

 private:
  static bool is_first(const Place& place) { return place.feature == 0; }

  // Amplitude squared, relative to the first part.
  static double variance(const Place& place, const VectorXd& parameters) {
    return is_first(place) ? 1.0 : std::exp(2.0 * parameters[place.parameter - 1]);
  }

  Index amplitudes(std::size_t part) const override { return part == 0 ? 0 : 1; }
  double neutral() const override { return 0; }
  void join(const Place& place, const VectorXd& parameters, const ConstTable& own,
            Table total) const override {
    total += variance(place, parameters) * own;
  }
};

class ProductKernel : public CompositeKernel {
 public:
  explicit ProductKernel(std::vector<KernelPtr> parts) : CompositeKernel(std::move(parts), " * ") {}

  // Each part's slope is weighted by the tiles of all the others.
  void tile_gradient(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                     const double* g, Index ldg, double* gradient) const override {
    const std::vector<Place> all = places_for(parameters);
    std::vector<AlignedMatrix> tiles;
    for (const Place& place : all)
      tiles.push_back(tile_of(*place.kernel, place.of(parameters), place.of(a), place.of(b)));
    for (std::size_t i = 0; i < all.size(); ++i) {
      AlignedMatrix weights(padded_rows(a.rows), b.rows);
      auto inside = weights.map().topRows(a.rows).array();
      inside = columns_of(g, a.rows, b.rows, ldg);
      for (std::size_t other = 0; other < all.size(); ++other) {
        if (other != i) inside *= tiles[other].map().topRows(a.rows).array();
      }
      all[i].kernel->tile_gradient(all[i].of(parameters), all[i].of(a), all[i].of(b),
                                   weights.data(), weights.rows(), gradient + all[i].parameter);
    }
  }

  void weighted_sum(const VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    const double* weights, double* out) const override {
    weighted_sum_by_tiles(*this, parameters, a, b, weights, out);
  }

 private:
  Index amplitudes(std::size_t /*part*/) const override { return 0; }
  double neutral() const override { return 1; }
  void join(const Place& /*place*/, const VectorXd& /*parameters*/, const ConstTable& own,
            Table total) const override {
    total *= own;
  }
};

}  // namespace

KernelPtr sum_of(std::vector<KernelPtr> parts) {
  return std::make_shared<SumKernel>(std::move(parts));
}

KernelPtr product_of(std::vector<KernelPtr> parts) {
  return std::make_shared<ProductKernel>(std::move(parts));
}

}  // namespace trammel
