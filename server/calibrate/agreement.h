#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds the rows of a batch that agree on one arm if many rows are bad.
namespace trammel {

struct Agreement {
  MeasurementBatch agreeing;  ///< rows that fit one arm
  MeasurementBatch others;    ///< rows that do not fit this arm, at most two in five
};

/// The rows of `batch` on which `sources` should be identified; empty means all rows. `plain` was
/// identified on all rows: if it leaves no more than 3 times the stated sigma, there is no search.
/// Otherwise the search is least trimmed squares (Rousseeuw 1984) by concentration steps (Rousseeuw
/// and Van Driessen 1999). It starts from all rows, and from base and tool alone. If no fit on all
/// rows succeeds, it starts from the small random set of rows that fits the most other rows.
/// Afterwards all rows return that fit as well as the kept ones. The search calls rows bad only if
/// the misfit of the others falls to a quarter: a model that lacks a cause leaves nearly the same
/// misfit at any rows. Rows that lie together in joint space stay, too: a missing cause makes a
/// region large, and a mistake one row. A batch may have too few rows for all sources, as some
/// batches of distances have. Then the bad rows are the ones that base and tool alone miss by far.
/// With several sessions, each session is searched by itself with a base of its own, since a
/// difference between sessions is a change. `go_on`: as CalibrateOptions::go_on.
[[nodiscard]] std::optional<Agreement> agreement_of(const std::shared_ptr<const Cell>& cell,
                                                    const std::vector<std::string>& sources,
                                                    const MeasurementBatch& batch,
                                                    const Result<CalibrationResult>& plain,
                                                    const std::function<Status()>& go_on = {});

/// True if a position `distance` (m) from where it is expected lies farther off than 1 in 10^6 good
/// ones would. `sigma`: m, expected standard deviation of one axis. One rule for rows that are
/// fitted and rows that judge.
[[nodiscard]] bool is_bad_row(double distance, double sigma);
/// True if `bad` of `rows` rows that were not fitted are more than may be bad: then the model is at
/// fault, and none of them is bad.
[[nodiscard]] bool are_too_many_bad(std::size_t bad, std::size_t rows);
/// The rows of `held_out`, in the world of `physics`, that are bad by the rule for fitted rows.
/// They leave `held_out`. `discrepancy`: m, of the fit.
[[nodiscard]] std::vector<SuspectPose> take_out_bad_rows(MeasurementBatch& held_out,
                                                         const PhysicalModel& physics,
                                                         double discrepancy);

/// Names `others` among the suspects of `found`, which was identified on the rows that agree. They
/// are `alike` if they are off by much the same, as seen from the instrument or from the tool: a
/// load or a tool that nobody recorded shifts rows like that, and no mistakes of single rows do.
void add_suspects(const MeasurementBatch& others, CalibrationResult& found);

}  // namespace trammel
