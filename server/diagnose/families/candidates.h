#pragma once

#include <string>
#include <vector>

#include "server/diagnose/families/family.h"

namespace trammel::cause_search {

/// The error sources whose effect on the poses is needed: all that `cell` can have and `batch` can
/// show. Causes that the batch rules out by a missing quantity are added to `unseen`, with that
/// quantity.
[[nodiscard]] std::vector<std::string> candidate_sources(const Cell& cell,
                                                         const MeasurementBatch& batch,
                                                         std::vector<Unseen>* unseen);

/// True if the poses of the batch follow one another closely, as on a path measured in motion, and
/// nobody recorded when.
[[nodiscard]] bool is_path_without_times(const MeasurementBatch& batch);

/// Every cause that may be missing, and its anonymous rivals: smooth functions of each joint, of
/// each pair of joints and of time, and slow motions. `problem` was made with candidate_sources()
/// and outlives them.
[[nodiscard]] std::vector<FamilyPtr> make_families(const LinearProblem& problem);

/// True if the model has a source of that cause and joint.
[[nodiscard]] bool has_cause(const PhysicalModel& model, const Cause& cause);

/// The cause that a source in a model's list stands for.
[[nodiscard]] Cause cause_of(const ErrorSource& source, const MeasurementBatch& batch);

}  // namespace trammel::cause_search
