#include "server/health/evidence/tests_beside_poses.h"

#include <algorithm>

namespace trammel::health {

namespace {

using Eigen::Index;

constexpr double kLeastSquare = kLeastLeft * kLeastLeft;

using Spectrum = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

}  // namespace

TestsBesidePoses::TestsBesidePoses(const std::vector<Eigen::MatrixXd>& directions,
                                   std::size_t causes, int freedom)
    : causes_(causes), freedom_(freedom), first_{0} {
  for (const Eigen::MatrixXd& own : directions) first_.push_back(first_.back() + own.cols());
  directions_.resize(directions.empty() ? 0 : directions.front().rows(), first_.back());
  for (std::size_t h = 0; h < directions.size(); ++h)
    directions_.middleCols(first_[h], directions[h].cols()) = directions[h];
  by_pose_ = directions_.transpose() * directions_.rightCols(first_.back() - first_[causes_]);
}

TestsBesidePoses::Seen TestsBesidePoses::seen(const Eigen::VectorXd& left) const {
  return {left.squaredNorm(), directions_.transpose() * left};
}

TestsBesidePoses::Beside TestsBesidePoses::beside(const std::vector<int>& bad) const {
  Beside beside;
  const Index poses = first_[causes_];
  for (const int pose : bad) {
    const std::size_t h = causes_ + static_cast<std::size_t>(pose);
    for (Index k = first_[h]; k < first_[h + 1]; ++k) beside.own_.push_back(k);
  }
  std::vector<Index> columns;
  for (const Index own : beside.own_) columns.push_back(own - poses);
  const Eigen::MatrixXd by_own = by_pose_(Eigen::all, columns);
  beside.root_.resize(by_own.cols(), 0);
  if (!bad.empty()) {
    const Spectrum spectrum(by_own(beside.own_, Eigen::all));
    const Index rank = (spectrum.eigenvalues().array() > kLeastSquare).count();
    beside.root_ = spectrum.eigenvectors().rightCols(rank) *
                   spectrum.eigenvalues().tail(rank).cwiseSqrt().cwiseInverse().asDiagonal();
  }
  beside.by_poses_ = by_own * beside.root_;
  beside.whole_freedom_ = freedom_ - static_cast<int>(beside.root_.cols());
  for (std::size_t h = 0; h < size(); ++h) {
    const Index count = first_[h + 1] - first_[h];
    Beside::Part part = part_of(beside.by_poses_.middleRows(first_[h], count));
    part.first = first_[h];
    part.count = count;
    beside.parts_.push_back(std::move(part));
  }
  return beside;
}

/// Uses the eigenvalues 1 - d of I - M M', or d of M' M, whichever matrix is smaller.
TestsBesidePoses::Beside::Part TestsBesidePoses::part_of(const Eigen::MatrixXd& M) {
  Beside::Part part;
  part.freedom = static_cast<int>(M.rows());
  if (M.size() == 0) return part;
  const bool is_tall = M.rows() > M.cols();
  const Spectrum spectrum(is_tall ? Eigen::MatrixXd(M.transpose() * M)
                                  : Eigen::MatrixXd(M * M.transpose()));
  part.turn = spectrum.eigenvectors().transpose();
  if (is_tall) part.turn = part.turn * M.transpose();
  part.weight = Eigen::VectorXd::Zero(spectrum.eigenvalues().size());
  for (Index k = 0; k < part.weight.size(); ++k) {
    const double taken = std::max(spectrum.eigenvalues()(k), 0.0);
    const bool is_lost = 1 - taken <= kLeastSquare;
    part.freedom -= is_lost ? 1 : 0;
    // The length of a row of `turn` is sqrt(taken) if M is tall, else 1.
    const double weight = is_lost ? -1 : taken / (1 - taken);
    part.weight(k) = is_tall && taken > 0 ? weight / taken : is_tall ? 0 : weight;
  }
  return part;
}

TestsBesidePoses::Seen TestsBesidePoses::Beside::left(const Seen& seen) const {
  if (own_.empty()) return seen;
  const Eigen::VectorXd taken = root_.transpose() * seen.along(own_);
  return {seen.square - taken.squaredNorm(), seen.along - by_poses_ * taken};
}

double TestsBesidePoses::Beside::explained(std::size_t hypothesis, const Seen& left) const {
  const Part& part = parts_[hypothesis];
  const auto v = left.along.segment(part.first, part.count);
  double square = v.squaredNorm();
  if (part.weight.size() > 0) square += part.weight.dot((part.turn * v).cwiseAbs2());
  return part.freedom > 0 ? square : 0;
}

std::size_t TestsBesidePoses::Beside::size() const {
  Index numbers = by_poses_.size() + root_.size();
  for (const Part& part : parts_) numbers += part.turn.size() + part.weight.size();
  return static_cast<std::size_t>(numbers);
}

}  // namespace trammel::health
