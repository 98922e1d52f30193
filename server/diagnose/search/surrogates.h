#pragma once

#include "server/diagnose/diagnosis.h"

namespace trammel::cause_search {

/// What a batch does not record, put in from the order of its rows, so that its causes are looked for all the same:
/// the time goes on by the row, the arm warms up along it, and a joint comes from the side on which it was before.
struct Surrogates {
  bool time = false, temperature = false, direction = false;  ///< were put in
};
/// Fills in what no row has. `batch` is in its order of measuring; nothing is put into a continuous path.
[[nodiscard]] Surrogates put_in_surrogates(MeasurementBatch& batch);

/// Gives rows of `whole` that went into `part` what was put in there: by then some have been set aside or merged, and
/// none of them says where the joint was before.
void take_over_surrogates(const Surrogates& surrogates, const MeasurementBatch& whole, MeasurementBatch& part);

/// Takes them out again.
void take_out_surrogates(const Surrogates& surrogates, MeasurementBatch& batch);

/// Whether the cause was looked for by a surrogate only.
[[nodiscard]] bool is_by_surrogate(const Surrogates& surrogates, const Cause& cause);
/// Whether its numbers are per hour or per kelvin that a surrogate made up.
[[nodiscard]] bool has_made_up_numbers(const Surrogates& surrogates, const Cause& cause);

/// Causes whose circumstances were recorded and the same at all poses (one side of approach, one temperature), so that
/// the geometry of `model` takes them over whole.
[[nodiscard]] std::vector<Inseparable> hidden_by_constancy(const PhysicalModel& model,
                                                           const MeasurementBatch& recorded);

}  // namespace trammel::cause_search
