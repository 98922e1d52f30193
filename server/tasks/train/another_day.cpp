#include "server/tasks/train/another_day.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "server/base/units.h"
#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/gauges.h"
#include "server/measurement/repeats.h"
#include "server/measurement/sessions.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::Matrix3Xd;
using Eigen::VectorXd;

constexpr std::size_t kMostBlocks = 5;
constexpr std::size_t kLeastBlocks = 3;
constexpr std::size_t kLeastRows =
    12;  // poses of a block: six of their 36 numbers locate the instrument
constexpr Index kNeighbours = 10;  // rows that count as one for the interval
constexpr double kPlace = 6;       // numbers that are fitted to each block

/// Index of each pose at which something began, in order.
std::vector<int> beginnings_of(const std::vector<std::string>& sources,
                               bool of_the_instrument_too) {
  std::vector<int> all;
  for (const std::string& source : sources) {
    const CauseRecord* cause = find_cause(source);
    const std::size_t at = source.find('@');
    if (cause == nullptr || cause->lasting != causes::Lasting::kFromAPose ||
        at == std::string::npos)
      continue;
    if (cause->scope == causes::Scope::kSession && !of_the_instrument_too) continue;
    all.push_back(std::atoi(source.c_str() + at + 1) - 1);
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// Number of the block of each row. Between two first poses of causes, a block is contiguous, and
/// takes the same share of each such stretch. So every fold sees the same share of the robot's
/// present state. No block spans sessions.
std::vector<std::size_t> blocks_of(const std::vector<Measurement>& rows,
                                   const std::vector<int>& beginnings) {
  const std::size_t n = rows.size();
  const std::size_t most = std::clamp<std::size_t>(n / kLeastRows, 1, kMostBlocks);
  const auto stretch = [&](std::size_t i) {
    return std::upper_bound(beginnings.begin(), beginnings.end(), rows[i].context.index) -
           beginnings.begin();
  };
  const bool sessions = rows.front().session != rows.back().session;
  std::vector<std::size_t> blocks(n);
  for (std::size_t first = 0, last = 0, sessions_before = 0; first < n; first = last) {
    const auto same = [&](std::size_t i) {
      return rows[i].session == rows[first].session && (sessions || stretch(i) == stretch(first));
    };
    while (last < n && same(last)) ++last;
    for (std::size_t i = first; i < last; ++i)
      blocks[i] = sessions ? sessions_before : most * (i - first) / (last - first);
    ++sessions_before;
  }
  return blocks;
}

MeasurementBatch without_session(const MeasurementBatch& rows, int session) {
  std::vector<bool> kept(rows.sessions.size(), true);
  kept[static_cast<std::size_t>(session)] = false;
  return only_sessions(rows, kept);
}

/// Identifies the sources as train() does.
Result<CalibrationResult> identified(const std::shared_ptr<const Cell>& cell,
                                     const std::vector<std::string>& sources,
                                     const MeasurementBatch& train) {
  return calibrate(cell, with_unknown_tool(sources, *cell), train,
                   {.held = {}, .weigh_links = true});
}

PoseContext as_served(PoseContext context) {
  context.served = true;
  return context;
}

/// The point as an instrument would have seen it that did not move meanwhile.
Vector3 seen_standing(const PhysicalModel& model, const Measurement& m) {
  const Pose X_moved = model.pose_W(m.context) * model.pose_W(as_served(m.context)).inverse();
  return X_moved.inverse() * m.p_W;
}

/// The errors that a model leaves in a block, wherever the instrument stands. With fewer numbers
/// than errors, the errors are scaled to the size they would have on rows that no fit has seen.
Result<Matrix3Xd> left_of(const PhysicalModel& model, const MeasurementBatch& block) {
  const auto n = static_cast<Index>(block.measurements.size());
  Matrix3Xd measured(3, n);
  Matrix3Xd predicted(3, n);
  for (Index i = 0; i < n; ++i) {
    const Measurement& m = block.measurements[static_cast<std::size_t>(i)];
    measured.col(i) = m.p_W;
    predicted.col(i) = model.pose_W(as_served(m.context)).translation();
  }
  const Pose X = TRY(fit_transform(predicted, measured));
  const double numbers = 3 * static_cast<double>(n);
  return Matrix3Xd(std::sqrt(numbers / (numbers - kPlace)) *
                   (((X.linear() * measured).colwise() + X.translation()) - predicted));
}

}  // namespace

DayGain day_gain(const Matrix3Xd& before, const Matrix3Xd& after) {
  DayGain day{paired_gain(before, after), 0, 0, 0, 0};
  const double ratio = day.gain.rms_after / day.gain.rms_before;
  const VectorXd b = before.colwise().squaredNorm();
  const VectorXd a = after.colwise().squaredNorm();
  const VectorXd influence =
      0.5 * (a / a.sum() - b / b.sum());  // of each row, on the logarithm of the ratio
  double variance = 0;
  for (Index first = 0; first < influence.size(); first += kNeighbours) {
    const double sum =
        influence.segment(first, std::min(kNeighbours, influence.size() - first)).sum();
    variance += sum * sum;
  }
  const double spread = 2 * std::sqrt(variance);
  day.share = 1 - ratio;
  day.lower = 1 - ratio * std::exp(spread);
  day.upper = 1 - ratio * std::exp(-spread);
  return day;
}

std::string to_string(const DayGain& day) {
  const auto percent = [](double share) { return std::round(100 * share); };
  return fmt::format(
      "another day ({} blocks of time held out, instrument set up anew): {:.4f} mm rms, before "
      "{:.4f} mm: {:.0f} % {}, 95 % between {:.0f} and {:.0f} %",
      day.blocks, to_mm(day.gain.rms_after), to_mm(day.gain.rms_before),
      std::abs(percent(day.share)), day.carries() ? "less" : "more", percent(day.lower),
      percent(day.upper));
}

std::optional<AnotherDay> AnotherDay::make(const std::shared_ptr<const Cell>& cell,
                                           const MeasurementBatch& rows,
                                           const std::vector<std::string>& with,
                                           const std::set<int>& suspects) {
  if (has_gauges(rows)) return std::nullopt;
  if (rows.measurements.size() < kLeastBlocks * kLeastRows) return std::nullopt;
  const std::vector<std::size_t> block = blocks_of(rows.measurements, beginnings_of(with, true));
  const std::vector<int> begun = beginnings_of(with, false);
  AnotherDay day;
  day.cell_ = cell;
  for (std::size_t k = 0; k <= *std::max_element(block.begin(), block.end()); ++k) {
    Fold fold{rows, rows};
    fold.train.measurements.clear();
    auto& judges = fold.judges.measurements;
    judges.clear();
    for (std::size_t i = 0; i < block.size(); ++i) {
      const Measurement& m = rows.measurements[i];
      const bool earlier = !begun.empty() && m.context.index < begun.back();
      if (block[i] != k) fold.train.measurements.push_back(m);
      if (block[i] == k && !earlier && !suspects.contains(m.row)) judges.push_back(m);
    }
    if (judges.size() < kLeastRows) continue;
    if (has_sessions(rows)) fold.train = without_session(rows, judges.front().session);
    fold.train = merge_repeats(fold.train, cell->tracker.sigma).batch;
    const auto model = identified(cell, with, fold.train);
    if (!model) continue;
    if (!has_sessions(rows)) {
      for (Measurement& m : judges) m.p_W = seen_standing(model->model, m);
    }
    day.folds_.push_back(std::move(fold));
  }
  if (day.folds_.empty()) return std::nullopt;
  return day;
}

Result<Matrix3Xd> AnotherDay::left_by(const std::vector<std::string>& sources) const {
  Matrix3Xd all(3, 0);
  for (const Fold& fold : folds_) {
    const auto model = TRY(identified(cell_, sources, fold.train));
    const Matrix3Xd left = TRY(left_of(model.model, fold.judges));
    Matrix3Xd longer(3, all.cols() + left.cols());
    longer << all, left;
    all = std::move(longer);
  }
  return all;
}

}  // namespace trammel
