#include "server/compensate/budget/datum.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/compensate/budget/usual.h"

namespace trammel {

namespace {

constexpr double kNothingTold =
    0.1;  // of one comparison size: the poses do not determine a direction with less
constexpr double kPartner = 0.3;     // of the effect: a parameter with more is a partner
constexpr double kBeyondChance = 3;  // standard deviations
constexpr double kPull = 0.05;  // share of the single effects of two frames: together they do less
                                // than this
constexpr double kOneNumber = 0.999;  // a correlation: apart 20 times worse than together
constexpr int kSteps = 2;             // of Gauss-Newton: the change of the datum is small
constexpr double kMatched = 1e-7;     // m
constexpr double kLaterJoint =
    1e-6;  // of two equal candidates the later joint counts as being on its drawing

/// The information of the measurements about the identified parameters, F x F in units of `sizes`:
/// the inverse of the covariance without the information of the priors.
struct Told {
  std::vector<Eigen::Index> free;  // places among the model's P
  Eigen::MatrixXd information;
};

Told told_by(const Identified& parts, const Eigen::VectorXd& sizes) {
  Told told;
  for (Eigen::Index i = 0; i < parts.covariance.rows(); ++i)
    if (parts.covariance(i, i) > 0) told.free.push_back(i);
  if (told.free.empty()) return told;
  const auto F = std::ssize(told.free);
  Eigen::VectorXd prior(F);
  for (Eigen::Index k = 0; k < F; ++k)
    prior(k) = parts.parameters[static_cast<std::size_t>(told.free[static_cast<std::size_t>(k)])]
                   .parameter.prior_scale;
  const Eigen::VectorXd inverse = prior.cwiseInverse();
  const Eigen::MatrixXd scaled =
      inverse.asDiagonal() * parts.covariance(told.free, told.free) * inverse.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(scaled);
  const Eigen::VectorXd share = solved.eigenvalues().cwiseMax(1e-14);
  const Eigen::VectorXd beyond_prior = (share.cwiseInverse().array() - 1).max(0);
  const Eigen::VectorXd to_sizes = sizes(told.free).cwiseQuotient(prior);
  const Eigen::MatrixXd root = to_sizes.asDiagonal() * solved.eigenvectors();
  told.information = root * beyond_prior.asDiagonal() * root.transpose();
  return told;
}

/// The undetermined directions, as columns (F x R), in units of the sizes.
Eigen::MatrixXd untold_directions(const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(information);
  Eigen::Index count = 0;
  while (count < information.rows() && solved.eigenvalues()(count) < kNothingTold * kNothingTold)
    ++count;
  return solved.eigenvectors().leftCols(count);
}

/// The R parameters that count as being on their drawing: they have the largest parts in the
/// undetermined directions.
std::vector<Eigen::Index> chosen(const Eigen::MatrixXd& untold) {
  Eigen::MatrixXd rows = untold.transpose();
  for (Eigen::Index k = 0; k < rows.cols(); ++k)
    rows.col(k) *= 1 + kLaterJoint * static_cast<double>(k);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivots(rows);
  std::vector<Eigen::Index> all;
  for (Eigen::Index k = 0; k < untold.cols(); ++k)
    all.push_back(pivots.colsPermutation().indices()(k));
  return all;
}

/// 3N x P, m by the SI parameters, of the positions in W.
Eigen::MatrixXd jacobian_of(const PhysicalModel& model, const std::vector<PoseContext>& poses) {
  Eigen::MatrixXd all(3 * std::ssize(poses), model.parameter_count());
  Eigen::MatrixXd J;
  Eigen::Index row = 0;
  for (const PoseContext& pose : poses) {
    model.pose_W(pose, model.values, &J);
    all.middleRows(row, 3) = J.topRows(3);
    row += 3;
  }
  return all;
}

Eigen::VectorXd positions_of(const PhysicalModel& model, const std::vector<PoseContext>& poses) {
  Eigen::VectorXd all(3 * std::ssize(poses));
  Eigen::Index row = 0;
  for (const PoseContext& pose : poses) {
    all.segment<3>(row) = model.pose_W(pose).translation();
    row += 3;
  }
  return all;
}

/// Moves the parameters `kept` until the model predicts `wanted` (3N, m).
void match(PhysicalModel& model, const std::vector<Eigen::Index>& kept,
           const Eigen::VectorXd& sizes, const Eigen::VectorXd& wanted,
           const std::vector<PoseContext>& poses) {
  const Eigen::VectorXd scale = sizes(kept);
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::VectorXd missing = wanted - positions_of(model, poses);
    if (missing.cwiseAbs().maxCoeff() < kMatched) return;
    const Eigen::MatrixXd J = jacobian_of(model, poses)(Eigen::all, kept) * scale.asDiagonal();
    Eigen::MatrixXd normal = J.transpose() * J;
    normal.diagonal().array() += kMatched * kMatched;
    model.values(kept) += scale.cwiseProduct(normal.ldlt().solve(J.transpose() * missing));
  }
}

/// Shrinks weakly determined values towards the drawing if they are not beyond chance, and sets the
/// covariance of the kept ones.
void settle(Datum& datum, const std::vector<Eigen::Index>& kept, const Eigen::VectorXd& sizes,
            const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(information);
  const Eigen::VectorXd scale = sizes(kept);
  Eigen::VectorXd along =
      solved.eigenvectors().transpose() * datum.model.values(kept).cwiseQuotient(scale);
  Eigen::VectorXd variance(along.size());
  for (Eigen::Index k = 0; k < along.size(); ++k) {
    const double told = std::max(solved.eigenvalues()(k), 0.0);
    const bool beyond_chance = std::sqrt(told) * std::abs(along(k)) > kBeyondChance;
    if (!beyond_chance) along(k) *= told / (told + 1);
    variance(k) = 1 / (beyond_chance ? told : told + 1);
  }
  datum.model.values(kept) = scale.cwiseProduct(solved.eigenvectors() * along);
  const Eigen::MatrixXd root = scale.asDiagonal() * solved.eigenvectors();
  datum.covariance(kept, kept) = root * variance.asDiagonal() * root.transpose();
}

/// Widens the variance of each kept parameter by the residual at the poses that determine it,
/// relative to the average residual. It needs at least twice as many measured numbers as
/// parameters.
void widen(Datum& datum, const std::vector<Eigen::Index>& kept,
           const std::vector<PoseContext>& poses, const Eigen::Matrix3Xd& left) {
  const double whole = left.squaredNorm();
  if (whole <= 0 || left.size() < 2 * std::ssize(kept)) return;
  const Eigen::MatrixXd J = jacobian_of(datum.model, poses)(Eigen::all, kept);
  const Eigen::MatrixXd C = datum.covariance(kept, kept);
  const Eigen::MatrixXd weights = C * J.transpose();  // K x 3N: the effect of each coordinate on
                                                      // the parameters
  Eigen::VectorXd wider = Eigen::VectorXd::Ones(std::ssize(kept));
  for (Eigen::Index k = 0; k < wider.size(); ++k) {
    double moved = 0;
    for (Eigen::Index i = 0; i < left.cols(); ++i)
      moved += std::pow(weights.row(k).segment<3>(3 * i).dot(left.col(i).transpose()), 2);
    const double expected = weights.row(k).squaredNorm() * whole / static_cast<double>(left.size());
    if (expected > 0) wider(k) = std::sqrt(std::max(moved / expected, 1.0));
  }
  datum.covariance(kept, kept) = wider.asDiagonal() * C * wider.asDiagonal();
}

/// Finds pairs for which the poses determine one number: each of the two alone is far less certain
/// than that number.
void pair_up(Datum& datum, const std::vector<Eigen::Index>& kept) {
  const Eigen::VectorXd stddev = datum.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  for (std::size_t a = 0; a < kept.size(); ++a)
    for (std::size_t b = a + 1; b < kept.size(); ++b)
      if (std::abs(datum.covariance(kept[a], kept[b])) >
          kOneNumber * stddev(kept[a]) * stddev(kept[b]))
        datum.told_together.push_back({kept[a], kept[b]});
}

/// The shifts among `kept` of the frames.
std::vector<Eigen::Index> shifts_of_frames(const PhysicalModel& model,
                                           const std::vector<Eigen::Index>& kept) {
  std::vector<Eigen::Index> shifts;
  Eigen::Index place = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const causes::Part part = source->cause().part;
    for (const Parameter& parameter : source->parameters()) {
      const bool of_frame = part == causes::Part::kBase || part == causes::Part::kTool;
      if (of_frame && parameter.unit == "mm" &&
          std::find(kept.begin(), kept.end(), place) != kept.end())
        shifts.push_back(place);
      ++place;
    }
  }
  return shifts;
}

/// Removes shifts of base and tools that nearly cancel each other although each alone has a large
/// effect, as with a tool that is always held one way. The model's residual (`left`, 3 x N, m) is
/// larger than their joint effect, so more poses would not measure them.
void take_out_pulls(Datum& datum, const std::vector<Eigen::Index>& kept,
                    const Eigen::VectorXd& sizes, const std::vector<PoseContext>& poses,
                    const Eigen::Matrix3Xd& left) {
  const std::vector<Eigen::Index> shifts = shifts_of_frames(datum.model, kept);
  if (shifts.empty()) return;
  const Eigen::VectorXd scale = sizes(shifts);
  const Eigen::MatrixXd J =
      jacobian_of(datum.model, poses)(Eigen::all, shifts) * scale.asDiagonal();
  const auto n = static_cast<double>(poses.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solved(J.transpose() * J / n);
  for (Eigen::Index k = 0; k < scale.size(); ++k) {
    const Eigen::VectorXd along = solved.eigenvectors().col(k);
    const double value = along.dot(datum.model.values(shifts).cwiseQuotient(scale));
    const double together = std::sqrt(std::max(solved.eigenvalues()(k), 0.0));
    if (together > kPull * along.cwiseProduct(scale).norm() ||
        together * std::abs(value) > std::sqrt(left.squaredNorm() / n))
      continue;
    datum.model.values(shifts) -= value * scale.cwiseProduct(along);
    Eigen::MatrixXd keeps = Eigen::MatrixXd::Identity(sizes.size(), sizes.size());
    keeps(shifts, shifts) -= scale.cwiseProduct(along) * along.cwiseQuotient(scale).transpose();
    datum.covariance = keeps * datum.covariance * keeps.transpose();
    datum.told_together.push_back({});
    for (std::size_t i = 0; i < shifts.size(); ++i)
      if (std::abs(along(static_cast<Eigen::Index>(i)) * scale(static_cast<Eigen::Index>(i))) >
          kPartner * along.cwiseProduct(scale).cwiseAbs().maxCoeff())
        datum.told_together.back().push_back(shifts[i]);
  }
}

/// The parameters with the same effect as `untold` (a direction of all P, SI), except the one that
/// it is named after.
std::vector<Eigen::Index> partners(const Eigen::VectorXd& untold, Eigen::Index named,
                                   const std::vector<Eigen::Index>& not_among,
                                   const Eigen::VectorXd& effect) {
  std::vector<Eigen::Index> all;
  const double own = std::abs(untold(named)) * effect(named);
  for (Eigen::Index i = 0; i < untold.size(); ++i) {
    const bool other = std::find(not_among.begin(), not_among.end(), i) == not_among.end();
    if (other && own > 0 && std::abs(untold(i)) * effect(i) > kPartner * own) all.push_back(i);
  }
  return all;
}

}  // namespace

Datum datum_of(const Identified& found, const std::vector<PoseContext>& poses,
               const Eigen::Matrix3Xd* left) {
  const PhysicalModel& physics = found.physics;
  const Eigen::VectorXd sizes = sizes_to_compare_by(physics);
  Datum datum{
      physics, Eigen::MatrixXd::Zero(physics.parameter_count(), physics.parameter_count()), {}};
  const Told told = told_by(found, sizes);
  if (told.free.empty()) return datum;
  const Eigen::MatrixXd untold = untold_directions(told.information);
  const std::vector<Eigen::Index> gone = chosen(untold);
  std::vector<Eigen::Index> kept_of_free, kept, on_drawing;
  for (Eigen::Index k = 0; k < std::ssize(told.free); ++k) {
    const bool is_gone = std::find(gone.begin(), gone.end(), k) != gone.end();
    (is_gone ? on_drawing : kept).push_back(told.free[static_cast<std::size_t>(k)]);
    if (!is_gone) kept_of_free.push_back(k);
  }
  if (!gone.empty()) {
    // The undetermined directions do not move the poses, to first order. Along them the chosen
    // parameters move to their drawing.
    Eigen::MatrixXd of_gone(std::ssize(gone), untold.cols());
    for (Eigen::Index r = 0; r < of_gone.rows(); ++r)
      of_gone.row(r) = untold.row(gone[static_cast<std::size_t>(r)]);
    const Eigen::MatrixXd by_each =
        untold * of_gone.inverse();  // F x R: each moves one chosen parameter by its size
    const Eigen::VectorXd effect = jacobian_of(physics, poses).colwise().norm();
    for (std::size_t r = 0; r < gone.size(); ++r) {
      const Eigen::Index parameter = told.free[static_cast<std::size_t>(gone[r])];
      Eigen::VectorXd direction = Eigen::VectorXd::Zero(sizes.size());
      direction(told.free) =
          by_each.col(static_cast<Eigen::Index>(r)).cwiseProduct(sizes(told.free));
      datum.model.values -= direction * (physics.values(parameter) / direction(parameter));
      datum.on_drawing.push_back({parameter, partners(direction, parameter, on_drawing, effect)});
    }
    for (const Eigen::Index parameter : on_drawing) datum.model.values(parameter) = 0;
    if (!kept.empty()) match(datum.model, kept, sizes, positions_of(physics, poses), poses);
  }
  if (kept.empty()) return datum;
  settle(datum, kept, sizes, told.information(kept_of_free, kept_of_free));
  pair_up(datum, kept);
  if (left == nullptr) return datum;
  widen(datum, kept, poses, *left);
  take_out_pulls(datum, kept, sizes, poses, *left);
  return datum;
}

}  // namespace trammel
