#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"

/// The words of a diagnosis about the robot file.
namespace trammel::cause_search {

/// Marks causes that always act in one of two parallel axes without a Hayati row as uncertain. No
/// number of the model describes the tilt of these axes, and the cause may be that tilt.
void doubt_beside_parallel_axes(const Chain& robot, Diagnosis& diagnosis);

/// Adds the doubts about the robot file to the notes: from the file alone, and from an
/// identification on `batch` with `sources`.
void tell_file_doubts(const std::shared_ptr<const Cell>& cell,
                      const std::vector<std::string>& sources, const MeasurementBatch& batch,
                      Diagnosis& diagnosis);

/// The notes, a sentence each, with a blank behind; empty where there are none.
[[nodiscard]] std::string file_doubts_said(const Diagnosis& diagnosis);

}  // namespace trammel::cause_search
