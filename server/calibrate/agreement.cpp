#include "server/calibrate/agreement.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "server/calibrate/calibrate.h"
#include "server/calibrate/frames/frames.h"
#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/sessions/session_setting.h"
#include "server/error_sources/catalogue.h"
#include "server/measurement/gauges.h"
#include "server/measurement/sessions.h"

namespace trammel {

namespace {

using Rows = std::vector<std::size_t>;  // rising

constexpr double kAsked =
    3;  // times the stated sigma: with a smaller misfit no bad rows are searched
constexpr double kKept =
    0.55;  // share of the rows that are fitted: with two bad ones in five, some are spared
constexpr double kAgreeing = 0.6;       // share that must agree at the end
constexpr double kMuchLess = 0.25;      // share of the earlier misfit
constexpr double kEquations = 1.5;      // for each parameter, of the rows that are fitted
constexpr std::size_t kMostRows = 300;  // evenly drawn beyond, while rows are looked for
constexpr int kMostSteps = 12;
constexpr std::size_t kPlacing = 4,
                      kPlacingTool = 3;  // rows that place the base, and so many more for each tool
constexpr int kDraws =
    300;  // with two of five rows bad, all of seven drawn rows are good in 1 of 36 draws
constexpr double kNear = 3e-3, kNearTurn = 5e-3;  // m, rad: by so much an arm is off its drawing

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

/// The stated uncertainty of one axis, m.
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

  /// The rows that agree; all rows where the search cannot separate bad ones.
  [[nodiscard]] Rows agreeing(const Result<CalibrationResult>& plain) const {
    const Rows all = all_rows(batch_.measurements.size());
    const double before = plain ? left(*plain) : kNoModelError;
    if (before < kAsked * sigma_) return all;
    const MeasurementBatch few = only(batch_, drawn(all.size(), kMostRows));
    std::optional<CalibrationResult> found;
    const auto begin_at = [&](std::optional<CalibrationResult> start) {
      std::optional<CalibrationResult> one = concentrated(few, std::move(start), sources_);
      if (one && (!found || left(*one) < left(*found))) found = std::move(one);
    };
    begin_at(fitted(sources_, few));
    begin_at(fitted(frames(), few));
    if (!found) begin_at(placed_by_few(few));
    if (!found) return led_to_by_frames(few);
    const std::optional<Readmitted> settled =
        left(*found) > kMuchLess * before ? std::nullopt : readmitted(std::move(*found), sources_);
    if (settled && left(settled->found) <= kMuchLess * before) return enough(settled->rows);
    return has_gauges(batch_) ? led_to_by_frames(few) : all;
  }

 private:
  [[nodiscard]] double left(const CalibrationResult& found) const {
    return std::hypot(sigma_, found.discrepancy);
  }

  [[nodiscard]] std::optional<CalibrationResult> fitted(const std::vector<std::string>& sources,
                                                        const MeasurementBatch& rows) const {
    Result<CalibrationResult> found = calibrate(cell_, sources, rows, {});
    return found ? std::optional(std::move(*found)) : std::nullopt;
  }

  /// The sources of base and tool that the model identifies.
  [[nodiscard]] std::vector<std::string> frames() const {
    std::vector<std::string> names;
    for (const causes::Part part : {causes::Part::kBase, causes::Part::kTool})
      if (corrects(sources_, part)) names.emplace_back(cause_correcting(part).spelling);
    return names;
  }

  [[nodiscard]] std::size_t rows_that_place() const {
    const auto& tools = cell_->tools;
    const auto unknown =
        std::count_if(tools.begin(), tools.end(), [](const auto& tool) { return !tool.second; });
    return kPlacing + kPlacingTool * static_cast<std::size_t>(unknown);
  }

  /// Finds base and tools from a few rows. Of many draws it keeps the one with the most rows
  /// nearby.
  [[nodiscard]] std::optional<CalibrationResult> placed_by_few(const MeasurementBatch& rows) const {
    std::optional<CalibrationResult> best;
    std::ptrdiff_t most = 0;
    std::mt19937_64 random(1);
    for (int draw = 0; draw < kDraws; ++draw) {
      std::optional<CalibrationResult> one =
          fitted(frames(), only(rows, some_of(rows.measurements.size(), random)));
      if (!one) continue;
      const Eigen::VectorXd off = farness_of(
          rows, residuals_of(one->model, rows, one->model.values), {kNear, kNearTurn, true});
      const auto near = std::count_if(off.begin(), off.end(), [](double far) { return far <= 1; });
      if (near <= most) continue;
      most = near;
      best = std::move(one);
    }
    return best;
  }

  /// Random rows, just enough to place base and tools.
  [[nodiscard]] Rows some_of(std::size_t count, std::mt19937_64& random) const {
    Rows rows = all_rows(count);
    const std::size_t wanted = std::min(count, rows_that_place());
    for (std::size_t i = 0; i < wanted; ++i)
      std::swap(rows[i], rows[i + static_cast<std::size_t>(random() % (count - i))]);
    rows.resize(wanted);
    std::sort(rows.begin(), rows.end());
    return rows;
  }

  /// The misfit of each row of `rows`, relative to the largest misfit of a good row.
  [[nodiscard]] Eigen::VectorXd farness(const CalibrationResult& found,
                                        const MeasurementBatch& rows) const {
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

  [[nodiscard]] static bool has_enough(const MeasurementBatch& rows,
                                       const CalibrationResult& found) {
    double equations = 0;
    for (const Measurement& m : rows.measurements) equations += m.gauge ? m.gauge->numbers() : 3;
    return equations >= kEquations * static_cast<double>(found.parameters.size());
  }

  /// The values of `sources` found on the rows that fit them best.
  [[nodiscard]] std::optional<CalibrationResult> concentrated(
      const MeasurementBatch& few, std::optional<CalibrationResult> start,
      const std::vector<std::string>& sources) const {
    Rows kept;
    for (int step = 0; start && step < kMostSteps; ++step) {
      Rows next = nearest(farness(*start, few));
      if (next == kept) break;
      kept = std::move(next);
      const MeasurementBatch rows = only(few, kept);
      start = fitted(sources, rows);
      if (start && !has_enough(rows, *start)) return std::nullopt;
    }
    return start;
  }

  /// The rows that are no farther off than a good one may be.
  [[nodiscard]] Rows near(const CalibrationResult& found) const {
    const Eigen::VectorXd off = farness(found, batch_);
    Rows rows;
    for (Eigen::Index i = 0; i < off.size(); ++i)
      if (off(i) <= 1) rows.push_back(static_cast<std::size_t>(i));
    return rows;
  }

  struct Readmitted {
    CalibrationResult found;
    Rows rows;
  };
  /// All rows that fit as well as the kept ones, and the values of `sources` identified on them.
  [[nodiscard]] std::optional<Readmitted> readmitted(
      CalibrationResult found, const std::vector<std::string>& sources) const {
    Rows kept;
    for (int step = 0; step < kMostSteps; ++step) {
      Rows next = near(found);
      if (next == kept) break;
      kept = std::move(next);
      auto again = fitted(sources, only(batch_, kept));
      if (!again) return std::nullopt;
      found = std::move(*again);
    }
    return Readmitted{std::move(found), std::move(kept)};
  }

  /// The rows that fit a model of base and tool alone, for batches with too few rows to identify
  /// all sources on a part of them. A row disagrees if its misfit is that of a suspect, beyond the
  /// errors that a drawing leaves.
  [[nodiscard]] Rows led_to_by_frames(const MeasurementBatch& few) const {
    const std::vector<std::string> sources = frames();
    std::optional<CalibrationResult> found = concentrated(few, fitted(sources, few), sources);
    const std::optional<Readmitted> settled =
        found ? readmitted(std::move(*found), sources) : std::optional<Readmitted>();
    return settled ? enough(settled->rows) : all_rows(batch_.measurements.size());
  }

  /// `rows`, or all rows if these are too few to be right.
  [[nodiscard]] Rows enough(Rows rows) const {
    Rows all = all_rows(batch_.measurements.size());
    return static_cast<double>(rows.size()) < kAgreeing * static_cast<double>(all.size()) ? all
                                                                                          : rows;
  }

  const std::shared_ptr<const Cell>& cell_;
  const std::vector<std::string>& sources_;
  const MeasurementBatch& batch_;
  const double sigma_;
};

/// `cell` with its base wherever a session's rows say.
std::shared_ptr<const Cell> anywhere(const Cell& cell) {
  auto other = std::make_shared<Cell>(cell);
  other->X_WB.reset();
  return other;
}

/// The agreeing rows of each session, with the instrument placed by that session alone and the arm
/// as it was then.
Rows agreeing_in_sessions(const std::shared_ptr<const Cell>& cell,
                          const std::vector<std::string>& sources, const MeasurementBatch& batch) {
  const std::shared_ptr<const Cell> placed = anywhere(*cell);
  const std::vector<MeasurementBatch> sessions = by_session(batch);
  std::vector<Rows> rows_of(sessions.size());
  for (std::size_t i = 0; i < batch.measurements.size(); ++i)
    rows_of[static_cast<std::size_t>(batch.measurements[i].session)].push_back(i);
  Rows all;
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    if (rows_of[s].empty()) continue;
    const auto alone = calibrate(placed, sources, sessions[s], {});
    for (const std::size_t row : RowSearch(placed, sources, sessions[s]).agreeing(alone))
      all.push_back(rows_of[s][row]);
  }
  std::sort(all.begin(), all.end());
  return all;
}

/// m: the largest residual of a session beyond the stated sigma.
double most_left(const CalibrationResult& found) {
  double most = 0;
  for (const SessionSetting& session : found.sessions) most = std::max(most, session.own_noise);
  return std::hypot(found.discrepancy, most);
}

Rows agreeing_rows(const std::shared_ptr<const Cell>& cell, const std::vector<std::string>& sources,
                   const MeasurementBatch& batch, const Result<CalibrationResult>& plain) {
  if (!has_sessions(batch)) return RowSearch(cell, sources, batch).agreeing(plain);
  const double sigma = stated_sigma(batch, *cell);
  if (plain && std::hypot(sigma, most_left(*plain)) < kAsked * sigma)
    return all_rows(batch.measurements.size());
  return agreeing_in_sessions(cell, sources, batch);
}

}  // namespace

std::optional<Agreement> agreement_of(const std::shared_ptr<const Cell>& cell,
                                      const std::vector<std::string>& sources,
                                      const MeasurementBatch& batch,
                                      const Result<CalibrationResult>& plain) {
  if (batch.measurements.empty()) return std::nullopt;
  const Rows rows = agreeing_rows(cell, sources, batch, plain);
  if (rows.size() == batch.measurements.size()) return std::nullopt;
  Rows others;
  const Rows all = all_rows(batch.measurements.size());
  std::set_difference(all.begin(), all.end(), rows.begin(), rows.end(), std::back_inserter(others));
  return Agreement{only(batch, rows), only(batch, others)};
}

void add_suspects(const MeasurementBatch& others, CalibrationResult& found) {
  const MeasurementBatch here = aligned(others, found.sessions, found.model.cell->tracker);
  const Residuals r = residuals_of(found.model, here, found.model.values);
  std::vector<SuspectPose> named =
      off_by(here, r, {found.discrepancy, found.discrepancy_rotation, true});
  named.insert(named.end(), found.suspects.begin(), found.suspects.end());
  std::stable_sort(named.begin(), named.end(),
                   [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  found.suspects = std::move(named);
}

}  // namespace trammel
