#pragma once

#include "server/diagnose/diagnosis.h"

namespace trammel::cause_search {

/// Stand-ins for what a batch does not record, made from the order of its rows. With them, causes
/// that depend on it are searched for all the same: each row is later than the one before, the arm
/// warms up from row to row, and a joint comes from the side on which it was before.
struct Surrogates {
  bool time = false, temperature = false, direction = false;  ///< which were put in
};
/// Fills in what no row has. `batch` is in its order of measuring; nothing is put into a continuous
/// path. Sides of approach are those of the gears of `robot`, or of the joints where none is given.
[[nodiscard]] Surrogates put_in_surrogates(MeasurementBatch& batch, const Chain& robot = {});

/// Copies what was put into the rows of `whole` to the same rows of `part`. In `part` rows have
/// been set aside or merged since, so that the row before no longer says where a joint came from.
void take_over_surrogates(const Surrogates& surrogates, const MeasurementBatch& whole,
                          MeasurementBatch& part);

/// Takes them out again.
void take_out_surrogates(const Surrogates& surrogates, MeasurementBatch& batch);

/// True if the cause was looked for by a surrogate only.
[[nodiscard]] bool is_by_surrogate(const Surrogates& surrogates, const Cause& cause);
/// True if its numbers are per hour or per kelvin that a surrogate made up.
[[nodiscard]] bool has_made_up_numbers(const Surrogates& surrogates, const Cause& cause);

/// Causes that depend on something that was recorded and never changed (one side of approach, one
/// temperature). The geometry of `model` explains all of their effect.
[[nodiscard]] std::vector<Inseparable> hidden_by_constancy(const PhysicalModel& model,
                                                           const MeasurementBatch& recorded);

}  // namespace trammel::cause_search
