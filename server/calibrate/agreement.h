#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

/// Finds the rows of a batch that agree on one arm, where many are bad.
namespace trammel {

struct Agreement {
  MeasurementBatch agreeing;  ///< rows that one arm leads to
  MeasurementBatch others;    ///< rows that this arm does not lead to, at most two in five
};

/// The rows of `batch` on which `sources` should be identified alone; empty where that is all of
/// them. `plain` was identified on all: where it leaves no more than 3 times the stated sigma,
/// nothing is asked. Else least trimmed squares (Rousseeuw 1984) by concentration steps (Rousseeuw
/// and Van Driessen 1999), from all rows and from base and tool alone; where no fit on all rows
/// leads anywhere, from the few drawn rows that most others are near to. Then rows come back that
/// fit as well as those that were kept. There are bad rows only if the others are left with a
/// quarter of what was left: a model that lacks something leaves nearly as much at any rows. Where
/// the rows are too few for all sources, as some distances are, those are bad that base and tool
/// alone do not lead to, by far. Of several sessions each is asked by itself, with a base of its
/// own: what differs between them is a change.
[[nodiscard]] std::optional<Agreement> agreement_of(const std::shared_ptr<const Cell>& cell,
                                                    const std::vector<std::string>& sources,
                                                    const MeasurementBatch& batch,
                                                    const Result<CalibrationResult>& plain);

/// Names `others` among the suspects of `found`, which was identified on the rows that agree.
void add_suspects(const MeasurementBatch& others, CalibrationResult& found);

}  // namespace trammel
