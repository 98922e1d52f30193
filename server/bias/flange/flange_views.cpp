#include "server/bias/flange/flange_views.h"

#include <algorithm>
#include <cmath>

#include "server/measurement/pose_groups.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSameLever = 1e-3;  // m: levers that differ by less, as after a calibration of the
                                     // tool, show no rotation
constexpr double kLeastSeen =
    1e-9;  // singular value over the largest: a smaller one counts as not seen

Vector3 mean_lever(const std::vector<BiasFeatures>& features) {
  Vector3 sum = Vector3::Zero();
  for (const BiasFeatures& one : features) sum += one.lever_F;
  return sum / static_cast<double>(features.size());
}

FlangeView view_of(std::vector<Index> rows, const FlangeViews& all) {
  MatrixXd seen(3 * static_cast<Index>(rows.size()), 6);
  for (std::size_t k = 0; k < rows.size(); ++k)
    seen.middleRows<3>(3 * static_cast<Index>(k)) =
        all.seen[static_cast<std::size_t>(rows[k])] / std::sqrt(all.noise_shape[rows[k]]);
  FlangeView view;
  if (rows.size() == 1) {
    view.view = seen;
    view.basis = MatrixXd::Identity(3, 3);
  } else {
    const Eigen::JacobiSVD<MatrixXd> svd(seen, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const VectorXd& s = svd.singularValues();
    const Index rank = (s.array() > kLeastSeen * s[0]).count();
    view.basis = svd.matrixU().leftCols(rank);
    view.view = s.head(rank).asDiagonal() * svd.matrixV().leftCols(rank).transpose();
  }
  view.rows = std::move(rows);
  return view;
}

void take(FlangeViews* views, FlangeView view) {
  view.first = views->size;
  views->size += view.view.rows();
  views->views.push_back(std::move(view));
}

}  // namespace

TwistRow seen_through(const BiasFeatures& features, const Vector3& reference_F) {
  TwistRow seen;
  seen << Matrix3::Identity(), -skew(features.R_BF * (features.lever_F - reference_F));
  return seen;
}

bool has_several_levers(const std::vector<BiasFeatures>& features) {
  return std::any_of(features.begin(), features.end(), [&](const BiasFeatures& one) {
    return (one.lever_F - features.front().lever_F).norm() > kSameLever;
  });
}

FlangeViews views_of(const MatrixXd& q, const VectorXd& noise_shape,
                     const std::vector<BiasFeatures>& features) {
  FlangeViews all;
  all.noise_shape = noise_shape;
  all.reference_F = mean_lever(features);
  for (const BiasFeatures& one : features) all.seen.push_back(seen_through(one, all.reference_F));
  std::vector<Index> first;
  for (std::vector<Index>& rows : pose_groups(q)) {
    first.push_back(rows.front());
    take(&all, view_of(std::move(rows), all));
  }
  all.q = q(first, Eigen::all);
  return all;
}

FlangeViews some_of(const FlangeViews& all, const std::vector<Index>& views) {
  FlangeViews some;
  some.q = all.q(views, Eigen::all);
  some.noise_shape = all.noise_shape;
  some.seen = all.seen;
  some.reference_F = all.reference_F;
  for (const Index i : views) take(&some, all.views[static_cast<std::size_t>(i)]);
  return some;
}

VectorXd even_rows(const FlangeViews& views, const FlangeView& view, const MatrixXd& y) {
  VectorXd even(3 * static_cast<Index>(view.rows.size()));
  for (std::size_t k = 0; k < view.rows.size(); ++k)
    even.segment<3>(3 * static_cast<Index>(k)) =
        y.row(view.rows[k]).transpose() / std::sqrt(views.noise_shape[view.rows[k]]);
  return even;
}

SeenNumbers numbers_of(const FlangeViews& views, const MatrixXd& y) {
  SeenNumbers numbers{VectorXd(views.size)};
  for (const FlangeView& view : views.views) {
    const VectorXd even = even_rows(views, view, y);
    const VectorXd seen = view.basis.transpose() * even;
    numbers.of_twist.segment(view.first, seen.size()) = seen;
    numbers.beside += (even - view.basis * seen).squaredNorm();
    numbers.beside_freedom += even.size() - seen.size();
    for (const Index row : view.rows) numbers.log_shape += 3 * std::log(views.noise_shape[row]);
  }
  return numbers;
}

}  // namespace trammel
