#include "server/health/evidence/check_tests.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/numerics/chi_square.h"
#include "server/numerics/seeded_random.h"

namespace trammel::health {

namespace {

using Eigen::Index;

constexpr int kSimulated = 3000;              // healthy checks
constexpr double kLookCloser = 2e-4;          // the search for bad poses begins at this p-value
constexpr std::size_t kMostHeld = 8'000'000;  // numbers of sets of bad poses that are kept: 64 MB
constexpr double kBadPoseShare = 1 / 6.0;     // of the poses, at least one; more are not single bad
                                              // poses

double normal(SeededRandom& random) {
  const double radius = std::sqrt(-2 * std::log(random.uniform(1e-300, 1)));
  return radius * std::cos(2 * kPi * random.uniform(0, 1));
}

/// A random factor on one pose's errors, mean square 1.
double disturbance(int freedom, SeededRandom& random) {
  if (freedom <= 2) return 1;
  double square = 0;
  for (int k = 0; k < freedom; ++k) square += std::pow(normal(random), 2);
  return std::sqrt((freedom - 2) / square);
}

}  // namespace

CheckTests::CheckTests(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& refitted,
                       const Questions& questions)
    : rows_(covariance, refitted), causes_(questions.causes) {
  for (const Hypothesis& one : questions.hypotheses)
    directions_.push_back(rows_.directions(one.columns));
}

double CheckTests::p_value(std::size_t hypothesis, const Eigen::VectorXd& left) const {
  const Eigen::MatrixXd& own = directions_[hypothesis];
  return own.cols() == 0 ? 1
                         : chi_square_tail((own.transpose() * left).squaredNorm(),
                                           static_cast<int>(own.cols()));
}

double CheckTests::whole_p(const Eigen::VectorXd& left) const {
  return rows_.freedom() < 1 ? 1 : chi_square_tail(left.squaredNorm(), rows_.freedom());
}

double CheckTests::smallest_p(const Eigen::VectorXd& left) const {
  if (rows_.freedom() < 1) return 1;
  double smallest = whole_p(left);
  for (std::size_t h = 0; h < causes_; ++h) smallest = std::min(smallest, p_value(h, left));
  return smallest;
}

std::vector<double> CheckTests::scores(const Eigen::VectorXd& left) const {
  const double price = std::log(static_cast<double>(left.size()));
  std::vector<double> scores;
  for (const Eigen::MatrixXd& own : directions_)
    scores.push_back((own.transpose() * left).squaredNorm() -
                     price * static_cast<double>(own.cols()));
  return scores;
}

HealthyChecks::HealthyChecks(const CheckRows& rows, Eigen::MatrixXd frames,
                             const Questions& questions, int tail_freedom, std::uint64_t seed)
    : rows_(rows),
      frames_(std::move(frames)),
      questions_(questions),
      tail_freedom_(tail_freedom),
      beside_poses_(tests({}).directions(), questions.causes, tests({}).rows().freedom()) {
  const Eigen::MatrixXd root = rows.covariance.llt().matrixL();
  for (int k = 0; k < kSimulated; ++k)
    smallest_.push_back(sifted(simulated(root, seed + static_cast<std::uint64_t>(k))).smallest_p);
  std::sort(smallest_.begin(), smallest_.end());
}

Eigen::VectorXd HealthyChecks::simulated(const Eigen::MatrixXd& root, std::uint64_t seed) const {
  SeededRandom random(seed * 0x9e3779b97f4a7c15U);
  Eigen::VectorXd noise(root.rows());
  for (Index i = 0; i < noise.size(); ++i) noise(i) = normal(random);
  Eigen::VectorXd residual = root * noise;
  for (std::size_t i = 0; i < rows_.poses(); ++i)
    residual.segment(rows_.first[i], rows_.count[i]) *= disturbance(tail_freedom_, random);
  return residual;
}

const CheckTests& HealthyChecks::tests(const std::vector<int>& bad) {
  std::vector<int> key = bad;
  std::sort(key.begin(), key.end());
  const auto known = tests_.find(key);
  if (known != tests_.end()) return known->second;
  Eigen::MatrixXd refitted = frames_;
  for (const int pose : key) {
    const Eigen::MatrixXd& own =
        questions_.hypotheses[questions_.causes + static_cast<std::size_t>(pose)].columns;
    Eigen::MatrixXd more(refitted.rows(), refitted.cols() + own.cols());
    more << refitted, own;
    refitted = std::move(more);
  }
  return tests_.emplace(key, CheckTests(rows_.covariance, refitted, questions_)).first->second;
}

const HealthyChecks::Beside& HealthyChecks::beside(std::vector<int> bad) {
  std::sort(bad.begin(), bad.end());
  if (const auto known = beside_.find(bad); known != beside_.end()) return known->second;
  passing_ = beside_poses_.beside(bad);
  if (held_ + passing_->size() > kMostHeld) return *passing_;
  held_ += passing_->size();
  return beside_.emplace(std::move(bad), std::move(*passing_)).first->second;
}

double HealthyChecks::smallest_p(const Beside& beside, const Seen& left) const {
  if (beside.whole_freedom() < 1) return 1;
  double smallest = chi_square_tail(left.square, beside.whole_freedom());
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const int freedom = beside.freedom(h);
    if (freedom > 0)
      smallest = std::min(smallest, chi_square_tail(beside.explained(h, left), freedom));
  }
  return smallest;
}

std::size_t HealthyChecks::most_explained(const Beside& beside, const Seen& left) const {
  const double price = std::log(static_cast<double>(rows_.residual.size()));
  std::vector<double> scores;
  for (std::size_t h = 0; h < questions_.hypotheses.size(); ++h)
    scores.push_back(beside.explained(h, left) - price * beside.freedom(h));
  return static_cast<std::size_t>(std::max_element(scores.begin(), scores.end()) - scores.begin());
}

Sifted HealthyChecks::sifted(const Eigen::VectorXd& residual) {
  const auto most = std::max<std::size_t>(
      1, static_cast<std::size_t>(kBadPoseShare * static_cast<double>(rows_.poses())));
  const Seen seen = beside_poses_.seen(tests({}).rows().left(residual));
  Sifted sifted;
  while (true) {
    const Beside& now = beside(sifted.bad);
    const Seen left = now.left(seen);
    sifted.smallest_p = smallest_p(now, left);
    if (sifted.smallest_p > kLookCloser || sifted.bad.size() == most) return sifted;
    const std::size_t best = most_explained(now, left);
    if (best < questions_.causes) return sifted;
    sifted.bad.push_back(questions_.hypotheses[best].pose);
  }
}

double HealthyChecks::limit(double false_alarm) const {
  const auto at = static_cast<std::size_t>(false_alarm * kSimulated);
  return smallest_[std::min(at, smallest_.size() - 1)];
}

double HealthyChecks::chance_of(double p) const {
  const auto below = std::upper_bound(smallest_.begin(), smallest_.end(), p) - smallest_.begin();
  return static_cast<double>(below + 1) / (kSimulated + 1);
}

int tail_freedom_of(double p997_over_rms, int poses) {
  constexpr int kFewest = 60;  // poses
  constexpr int kDraws = 4000;
  constexpr double kByChance = 0.2;  // of the ratio
  if (poses < kFewest) return 0;
  const double level = std::min(0.997, 1 - 1.0 / poses);
  SeededRandom random(1);
  for (const int freedom : {0, 20, 10, 6, 4}) {
    std::vector<double> sizes;
    for (int k = 0; k < kDraws; ++k) {
      const double size = disturbance(freedom, random);
      double square = 0;
      for (int axis = 0; axis < 3; ++axis) square += std::pow(normal(random), 2) / 3;
      sizes.push_back(size * std::sqrt(square));
    }
    const auto at = sizes.begin() + static_cast<std::ptrdiff_t>(level * kDraws);
    std::nth_element(sizes.begin(), at, sizes.end());
    if (*at > p997_over_rms - kByChance) return freedom;
  }
  return 4;
}

}  // namespace trammel::health
