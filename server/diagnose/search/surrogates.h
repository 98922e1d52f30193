#pragma once

#include "server/diagnose/diagnosis.h"

namespace trammel::cause_search {

/// Substitutes for quantities that a batch does not record, made from the order of its rows. With
/// them, causes that depend on these quantities are still searched for: each row is later than the
/// one before, the arm warms up from row to row, and a joint comes from its side of the previous
/// row.
struct Surrogates {
  bool time = false, temperature = false, direction = false;  ///< which were put in
};
/// Fills in the quantities that no row has. `batch` is in its order of measuring; a continuous path
/// gets none. Sides of approach are those of the gears of `robot`, or of the joints without a
/// robot.
[[nodiscard]] Surrogates put_in_surrogates(MeasurementBatch& batch, const Chain& robot = {});

/// Copies the substitutes in the rows of `whole` to the same rows of `part`. In `part` rows have
/// been set aside or merged, so the previous row no longer shows where a joint came from.
void take_over_surrogates(const Surrogates& surrogates, const MeasurementBatch& whole,
                          MeasurementBatch& part);

/// Takes them out again.
void take_out_surrogates(const Surrogates& surrogates, MeasurementBatch& batch);

/// True if the cause was looked for by a surrogate only.
[[nodiscard]] bool is_by_surrogate(const Surrogates& surrogates, const Cause& cause);
/// True if its numbers are per hour or per kelvin that a surrogate made up.
[[nodiscard]] bool has_made_up_numbers(const Surrogates& surrogates, const Cause& cause);

/// Causes that depend on a recorded quantity that never changed (one side of approach, one
/// temperature). The geometry of `model` explains all of their effect.
[[nodiscard]] std::vector<Inseparable> hidden_by_constancy(const PhysicalModel& model,
                                                           const MeasurementBatch& recorded);

}  // namespace trammel::cause_search
