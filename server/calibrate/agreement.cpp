#include "server/calibrate/agreement.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify/weighting.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

using Rows = std::vector<std::size_t>;  // rising

constexpr double kAsked = 3;        // times the stated sigma: the least that a fit leaves where bad rows are looked for
constexpr double kKept = 0.55;      // share of the rows that are fitted: with two bad ones in five, some are spared
constexpr double kAgreeing = 0.6;   // share that must agree at the end
constexpr double kMuchLess = 0.25;  // of what was left
constexpr double kEquations = 1.5;  // for each parameter, of the rows that are fitted
constexpr std::size_t kMostRows = 300;  // evenly drawn beyond, while rows are looked for
constexpr int kMostSteps = 12;

MeasurementBatch only(const MeasurementBatch& batch, const Rows& rows) {
  MeasurementBatch some = batch;
  some.measurements.clear();
  for (const std::size_t i : rows) some.measurements.push_back(batch.measurements[i]);
  return some;
}

Rows all_rows(std::size_t count) {
  Rows rows(count);
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  return rows;
}

/// About `most` of them, evenly drawn.
Rows drawn(std::size_t count, std::size_t most) {
  Rows rows = all_rows(std::min(count, most));
  for (std::size_t& row : rows) row = row * count / rows.size();
  return rows;
}

/// m, what one axis is said to be uncertain by.
double stated_sigma(const MeasurementBatch& batch, const Cell& cell) {
  std::vector<double> all;
  for (const Measurement& m : batch.measurements) all.push_back(position_sigma(m, cell));
  const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
  std::nth_element(all.begin(), middle, all.end());
  return *middle;
}

class RowSearch {
 public:
  RowSearch(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
            const MeasurementBatch& batch)
      : cell_(cell), sources_(sources), batch_(batch), sigma_(stated_sigma(batch, *cell)) {}

  /// The rows that agree; all of them where no others can be told.
  [[nodiscard]] Rows agreeing(const Result<CalibrationResult>& plain) const {
    const Rows all = all_rows(batch_.measurements.size());
    const double before = plain ? left(*plain) : kNoModelError;
    if (before < kAsked * sigma_) return all;
    const MeasurementBatch few = only(batch_, drawn(all.size(), kMostRows));
    std::optional<CalibrationResult> found;
    for (const std::vector<std::string>& start : {sources_, frames(), std::vector<std::string>()}) {
      if (found && start.empty()) break;  // the drawn arm, where rows are so bad that nothing fits all of them
      std::optional<CalibrationResult> one = concentrated(few, fitted(start, few));
      if (one && (!found || left(*one) < left(*found))) found = std::move(one);
    }
    if (!found || left(*found) > kMuchLess * before) return all;
    const Rows rows = readmitted(std::move(*found), before);
    return static_cast<double>(rows.size()) < kAgreeing * static_cast<double>(all.size()) ? all : rows;
  }

 private:
  [[nodiscard]] double left(const CalibrationResult& found) const { return std::hypot(sigma_, found.discrepancy); }

  [[nodiscard]] std::optional<CalibrationResult> fitted(const std::vector<std::string>& sources,
                                                        const MeasurementBatch& rows) const {
    Result<CalibrationResult> found = calibrate(cell_, sources, rows, {});
    return found ? std::optional(std::move(*found)) : std::nullopt;
  }

  /// Base and tool, as far as they are to be found.
  [[nodiscard]] std::vector<std::string> frames() const {
    std::vector<std::string> names;
    for (const causes::Part part : {causes::Part::kBase, causes::Part::kTool})
      if (corrects(sources_, part)) names.emplace_back(cause_correcting(part).spelling);
    return names;
  }

  /// How far each row of `rows` is off, beside how far a good one may be.
  [[nodiscard]] Eigen::VectorXd farness(const CalibrationResult& found, const MeasurementBatch& rows) const {
    return farness_of(rows, residuals_of(found.model, rows, found.model.values),
                      {found.discrepancy, found.discrepancy_rotation, true});
  }

  [[nodiscard]] static Rows nearest(const Eigen::VectorXd& farness) {
    Rows rows = all_rows(static_cast<std::size_t>(farness.size()));
    std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) {
      return farness(static_cast<Eigen::Index>(a)) < farness(static_cast<Eigen::Index>(b));
    });
    rows.resize(static_cast<std::size_t>(std::ceil(kKept * static_cast<double>(rows.size()))));
    std::sort(rows.begin(), rows.end());
    return rows;
  }

  [[nodiscard]] static bool has_enough(const MeasurementBatch& rows, const CalibrationResult& found) {
    double equations = 0;
    for (const Measurement& m : rows.measurements) equations += m.gauge ? 1 : 3;
    return equations >= kEquations * static_cast<double>(found.parameters.size());
  }

  /// What is found on the rows that fit it best.
  [[nodiscard]] std::optional<CalibrationResult> concentrated(const MeasurementBatch& few,
                                                              std::optional<CalibrationResult> start) const {
    Rows kept;
    for (int step = 0; start && step < kMostSteps; ++step) {
      Rows next = nearest(farness(*start, few));
      if (next == kept) break;
      kept = std::move(next);
      const MeasurementBatch rows = only(few, kept);
      start = fitted(sources_, rows);
      if (start && !has_enough(rows, *start)) return std::nullopt;
    }
    return start;
  }

  /// All rows that fit as well as those that were kept; all, where no more than others are left with much less.
  [[nodiscard]] Rows readmitted(CalibrationResult found, double before) const {
    Rows kept;
    for (int step = 0; step < kMostSteps; ++step) {
      const Eigen::VectorXd off = farness(found, batch_);
      Rows next;
      for (Eigen::Index i = 0; i < off.size(); ++i)
        if (off(i) <= 1) next.push_back(static_cast<std::size_t>(i));
      if (next == kept) break;
      kept = std::move(next);
      auto again = fitted(sources_, only(batch_, kept));
      if (!again) return all_rows(batch_.measurements.size());
      found = std::move(*again);
    }
    return left(found) > kMuchLess * before ? all_rows(batch_.measurements.size()) : kept;
  }

  const std::shared_ptr<const Cell>& cell_;
  const std::vector<std::string>& sources_;
  const MeasurementBatch& batch_;
  const double sigma_;
};

}  // namespace

std::optional<Agreement> agreement_of(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
                                      const MeasurementBatch& batch, const Result<CalibrationResult>& plain) {
  if (has_sessions(batch) || batch.measurements.empty()) return std::nullopt;
  const Rows rows = RowSearch(cell, sources, batch).agreeing(plain);
  if (rows.size() == batch.measurements.size()) return std::nullopt;
  Rows others;
  const Rows all = all_rows(batch.measurements.size());
  std::set_difference(all.begin(), all.end(), rows.begin(), rows.end(), std::back_inserter(others));
  return Agreement{only(batch, rows), only(batch, others)};
}

void add_suspects(const MeasurementBatch& others, CalibrationResult& found) {
  const Residuals r = residuals_of(found.model, others, found.model.values);
  std::vector<SuspectPose> named = off_by(others, r, {found.discrepancy, found.discrepancy_rotation, true});
  named.insert(named.end(), found.suspects.begin(), found.suspects.end());
  std::stable_sort(named.begin(), named.end(), [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  found.suspects = std::move(named);
}

}  // namespace trammel
