#include "server/measurement/repeats.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "server/base/check.h"

namespace trammel {

namespace {

constexpr double kSameJoint = 1e-6;  // rad, m
constexpr int kLeastDegreesOfFreedom = 6;
constexpr int kMaxRotationSteps = 20;
constexpr double kRotationStep = 1e-14;  // rad

using Group = std::vector<const Measurement*>;

bool are_repeats(const Measurement& a, const Measurement& b) {
  if (a.gauge || b.gauge) return false;  // at one pose, several instruments give different numbers
  if (a.context.velocity || b.context.velocity || a.set != b.set || a.session != b.session)
    return false;
  if (a.context.tool != b.context.tool || a.context.payload != b.context.payload) return false;
  if (a.context.direction != b.context.direction || a.context.q.size() != b.context.q.size())
    return false;
  return ((a.context.q - b.context.q).array().abs() <= kSameJoint).all();
}

/// A number that is nearly equal for nearly equal joints and rarely for others. It finds candidates
/// without comparing every pair.
double joint_key(const JointVector& q) {
  double key = 0;
  for (Eigen::Index j = 0; j < q.size(); ++j) key += std::sqrt(static_cast<double>(j) + 2) * q(j);
  return key;
}

double key_tolerance(const JointVector& q) {
  double sum = 1;  // for rounding
  for (Eigen::Index j = 0; j < q.size(); ++j) sum += std::sqrt(static_cast<double>(j) + 2);
  return sum * kSameJoint;
}

/// Groups of repeats, in the order of their first measurement.
std::vector<Group> group_repeats(const MeasurementBatch& batch) {
  std::vector<Group> groups;
  std::multimap<double, std::size_t> group_of_key;
  for (const Measurement& m : batch.measurements) {
    const double key = joint_key(m.context.q);
    const double tolerance = key_tolerance(m.context.q);
    const auto end = group_of_key.upper_bound(key + tolerance);
    const auto found = std::find_if(
        group_of_key.lower_bound(key - tolerance), end,
        [&](const auto& entry) { return are_repeats(*groups[entry.second].front(), m); });
    if (found != end) {
      groups[found->second].push_back(&m);
    } else {
      group_of_key.emplace(key, groups.size());
      groups.push_back({&m});
    }
  }
  return groups;
}

double weight(const Measurement& m, double default_sigma) {
  const double sigma = m.sigma.value_or(default_sigma);
  return 1 / (sigma * sigma);
}

/// The mean on SO(3) with the least sum of squared angles, equal weights.
Matrix3 mean_rotation(const std::vector<Matrix3>& rotations) {
  Matrix3 mean = rotations.front();
  for (int step = 0; step < kMaxRotationSteps; ++step) {
    Vector3 turn = Vector3::Zero();
    for (const Matrix3& R : rotations) turn += rotation_log(R * mean.transpose());
    turn /= static_cast<double>(rotations.size());
    mean = rotation_exp(turn) * mean;
    if (turn.norm() < kRotationStep) break;
  }
  return nearest_rotation(mean);
}

std::vector<Matrix3> rotations_of(const Group& group) {
  std::vector<Matrix3> rotations;
  for (const Measurement* m : group) {
    if (m->R_WT) rotations.push_back(*m->R_WT);
  }
  return rotations;
}

/// Mean of the recorded values.
template <typename Field>
std::optional<double> mean_of(const Group& group, Field field) {
  double sum = 0;
  int count = 0;
  for (const Measurement* m : group) {
    if (const std::optional<double>& value = field(*m)) {
      sum += *value;
      ++count;
    }
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

/// The mean, if each of the group has one.
std::optional<JointVector> mean_before(const Group& group) {
  JointVector sum = JointVector::Zero(group.front()->context.q.size());
  for (const Measurement* m : group) {
    if (!m->context.before) return std::nullopt;
    sum += *m->context.before;
  }
  return sum / static_cast<double>(group.size());
}

std::vector<double> mean_lagged(const Group& group) {
  std::vector<double> mean(kHeatLags.size());
  for (const Measurement* m : group) {
    if (m->context.lagged.size() != mean.size()) return {};
    for (std::size_t k = 0; k < mean.size(); ++k)
      mean[k] += m->context.lagged[k] / static_cast<double>(group.size());
  }
  return mean;
}

Measurement average(const Group& group, double default_sigma) {
  Measurement mean = *group.front();
  if (group.size() == 1) return mean;
  Vector3 sum = Vector3::Zero();
  double weights = 0;
  for (const Measurement* m : group) {
    sum += weight(*m, default_sigma) * m->p_W;
    weights += weight(*m, default_sigma);
  }
  mean.p_W = sum / weights;
  if (const std::vector<Matrix3> rotations = rotations_of(group); !rotations.empty()) {
    mean.R_WT = mean_rotation(rotations);
  }
  mean.context.time = mean_of(group, [](const Measurement& m) { return m.context.time; });
  mean.context.temperature =
      mean_of(group, [](const Measurement& m) { return m.context.temperature; });
  mean.context.before = mean_before(group);
  mean.context.lagged = mean_lagged(group);
  return mean;
}

/// Sums of squares within the groups.
struct Scatter {
  double squares = 0;     // m²
  double chi_square = 0;  // in units of the stated sigmas, about the weighted mean
  double rotation = 0;    // rad²

  void add(const Group& group, const Measurement& weighted_mean, double default_sigma) {
    Vector3 centre = Vector3::Zero();
    for (const Measurement* m : group) centre += m->p_W / static_cast<double>(group.size());
    for (const Measurement* m : group) {
      squares += (m->p_W - centre).squaredNorm();
      chi_square += weight(*m, default_sigma) * (m->p_W - weighted_mean.p_W).squaredNorm();
      if (m->R_WT)
        rotation += rotation_log(*m->R_WT * weighted_mean.R_WT->transpose()).squaredNorm();
    }
  }
};

RepeatStatistics statistics_of(const std::vector<Group>& groups,
                               const std::vector<Measurement>& means, double default_sigma) {
  RepeatStatistics statistics;
  Scatter scatter;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto size = static_cast<int>(groups[g].size());
    if (size < 2) continue;
    const auto rotations = static_cast<int>(rotations_of(groups[g]).size());
    statistics.groups += 1;
    statistics.measurements += size;
    statistics.degrees_of_freedom += 3 * (size - 1);
    statistics.rotation_degrees_of_freedom += 3 * std::max(0, rotations - 1);
    scatter.add(groups[g], means[g], default_sigma);
  }
  if (statistics.degrees_of_freedom > 0)
    statistics.sigma = std::sqrt(scatter.squares / statistics.degrees_of_freedom);
  if (statistics.rotation_degrees_of_freedom > 0) {
    statistics.sigma_rotation =
        std::sqrt(scatter.rotation / statistics.rotation_degrees_of_freedom);
  }
  if (statistics.degrees_of_freedom >= kLeastDegreesOfFreedom) {
    statistics.sigma_factor =
        std::max(1.0, std::sqrt(scatter.chi_square / statistics.degrees_of_freedom));
  }
  return statistics;
}

}  // namespace

MergedRepeats merge_repeats(const MeasurementBatch& batch, double default_sigma) {
  TRAMMEL_CHECK(default_sigma > 0);
  const std::vector<Group> groups = group_repeats(batch);
  if (groups.size() == batch.measurements.size()) return {batch, {}};
  std::vector<Measurement> means;
  for (const Group& group : groups) means.push_back(average(group, default_sigma));
  MergedRepeats merged{batch, statistics_of(groups, means, default_sigma)};
  for (std::size_t g = 0; g < groups.size(); ++g) {
    double weights = 0;
    for (const Measurement* m : groups[g]) weights += weight(*m, default_sigma);
    means[g].sigma = merged.statistics.sigma_factor / std::sqrt(weights);
  }
  merged.batch.measurements = std::move(means);
  return merged;
}

}  // namespace trammel
