#include "server/health/examination/examination.h"

#include <algorithm>
#include <cmath>

#include "server/health/examination/seen_change.h"

namespace trammel::health {

using Eigen::Index;

Eigen::MatrixXd joined(const Eigen::MatrixXd& one, const Eigen::MatrixXd& other) {
  Eigen::MatrixXd both(one.rows(), one.cols() + other.cols());
  both << one, other;
  return both;
}

Examination::Examination(const HealthOptions& options, const CauseEffects& effects,
                         const WorkingPoses& working, CheckRows rows, int tail_freedom,
                         const Chain& robot)
    : options_(options),
      effects_(effects),
      working_(working),
      rows_(std::move(rows)),
      signals_(working.signals(effects, options.seed)),
      questions_(questions()),
      healthy_(rows_, frames_of(rows_), questions_, tail_freedom, options.seed),
      zeros_(effects_, rows_, zeros_of(robot), options.new_tool),
      covariance_(rows_.covariance) {}

HealthCheck Examination::result(const CheckTimes& times) {
  check_.poses = static_cast<int>(rows_.poses());
  check_.tolerance = options_.tolerance;
  check_.not_asked = effects_.not_asked();
  sifted_ = healthy_.sifted(rows_.residual);
  const std::optional<ZerosFit> zeros = lost_zeros();
  for (const int pose : sifted_.bad)
    check_.suspects.push_back(rows_.pose_ids[static_cast<std::size_t>(pose)]);
  check_.p_value = healthy_.chance_of(sifted_.smallest_p);
  const CheckTests& tests = healthy_.tests(sifted_.bad);
  if (zeros) {
    tell_zeros(*zeros);
  } else {
    look_for_changes(tests);
  }
  tell_rms(tests.rows());
  tell_smallest(tests);
  const auto misfits = [&] {
    return misfits_of_drift(drift(tests.rows()), tests.rows().left(rows_.residual));
  };
  tell_due(options_, times, misfits, check_);
  tell_verdict(options_, doubt_, check_);
  if (!rows_.base_turns())
    check_.sentence +=
        "; poses at one place do not say which way the base is turned: it is taken to be turned as "
        "in the model";
  return std::move(check_);
}

Questions Examination::questions() const {
  Questions questions{cause_hypotheses(effects_, rows_, signals_), 0};
  questions.causes = questions.hypotheses.size();
  for (Hypothesis& pose : pose_hypotheses(rows_)) questions.hypotheses.push_back(std::move(pose));
  return questions;
}

Eigen::MatrixXd Examination::frames_of(const CheckRows& rows) const {
  if (!options_.new_tool) return rows.by_base;
  return joined(rows.by_base, rows.by_cause(Eigen::all, effects_.tool_columns()));
}

std::vector<std::size_t> Examination::zeros_of(const Chain& robot) const {
  std::vector<std::size_t> zeros;
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const SingleCause& cause = effects_.causes()[questions_.hypotheses[h].cause].cause;
    if (is_zero(cause) && robot.joint(cause.joint).type == JointType::kRevolute)
      zeros.push_back(questions_.hypotheses[h].cause);
  }
  return zeros;
}

double Examination::distance_of(const RefittedRows& refitted) const {
  const Eigen::VectorXd left = refitted.unwhitened(refitted.left(rows_.residual));
  double square = 0;
  for (const Index first : rows_.first) square += left.segment<3>(first).squaredNorm();
  return std::sqrt(square / static_cast<double>(rows_.poses()));
}

/// Sets the rms of the counted poses, and that of a healthy robot.
void Examination::tell_rms(const RefittedRows& refitted) {
  const Eigen::VectorXd left = refitted.unwhitened(refitted.left(rows_.residual));
  const Eigen::MatrixXd expected = refitted.unwhitened_covariance();
  double square = 0, expected_square = 0;
  const auto& bad = check_.suspects;
  for (std::size_t i = 0; i < rows_.poses(); ++i) {
    const Eigen::Index row = rows_.first[i];
    const bool suspect = std::find(bad.begin(), bad.end(), rows_.pose_ids[i]) != bad.end();
    // The refit takes a suspect pose out whole: its own distance is in the rows before it.
    const Vector3 off = suspect ? rows_.residual.segment<3>(row) : left.segment<3>(row);
    const double variance = expected.diagonal().segment<3>(row).sum();
    check_.at_poses.push_back({rows_.pose_ids[i], rows_.predicted[i].translation(), off,
                               std::sqrt(std::max(0.0, variance)), suspect});
    if (suspect) continue;
    square += off.squaredNorm();
    expected_square += variance;
  }
  const auto count =
      static_cast<double>(std::max<std::size_t>(rows_.poses() - check_.suspects.size(), 1));
  check_.rms = std::sqrt(square / count);
  check_.expected_rms = std::sqrt(expected_square / count);
}

Eigen::VectorXd Examination::rows_of(const CauseSignal& signal) const {
  const SingleCause& asked = effects_.causes()[signal.cause].cause;
  Eigen::VectorXd rows = rows_.by_cause * signal.weights;
  for (std::size_t i = 0; asked.any_function && i < rows_.poses(); ++i) {
    const double q = rows_.contexts[i].q(asked.joint);
    rows.segment(rows_.first[i], rows_.count[i]) *= std::sin(signal.order * q + signal.phase);
  }
  return rows;
}

std::vector<double> Examination::strengths(std::size_t cause, const RefittedRows& refitted) const {
  std::vector<double> strengths;
  for (const CauseSignal& signal : signals_) {
    if (signal.cause == cause) strengths.push_back(refitted.left(rows_of(signal)).squaredNorm());
  }
  return strengths;
}

Eigen::MatrixXd Examination::drift(const RefittedRows& refitted) const {
  Eigen::MatrixXd drift(rows_.residual.size(), static_cast<Index>(signals_.size()));
  for (std::size_t s = 0; s < signals_.size(); ++s)
    drift.col(static_cast<Index>(s)) = refitted.left(rows_of(signals_[s]));
  return drift;
}

void Examination::tell_smallest(const CheckTests& tests) {
  const double limit = healthy_.limit(options_.false_alarm);
  bool all_seen = tests.rows().freedom() >= 1 && questions_.causes > 0;
  for (std::size_t h = 0; h < questions_.causes; ++h) {
    const std::size_t cause = questions_.hypotheses[h].cause;
    const auto rms =
        smallest_seen(strengths(cause, tests.rows()), tests.freedom(h), limit, options_.power);
    all_seen = all_seen && rms.has_value();
    check_.smallest.push_back({effects_.causes()[cause].cause, rms});
  }
  std::stable_sort(check_.smallest.begin(), check_.smallest.end(),
                   [](const auto& a, const auto& b) {
                     constexpr double kUnseen = 1e9;
                     return a.rms.value_or(kUnseen) > b.rms.value_or(kUnseen);
                   });
  if (all_seen) check_.would_have_seen = check_.smallest.front().rms;
}

}  // namespace trammel::health
