#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnose/diagnosis.h"

/// The words of a diagnosis about the robot file.
namespace trammel::cause_search {

/// Without a Hayati row between parallel axes no number of the model is their tilt: what always
/// acts in one of the two joints may be that. Its name is in doubt.
void doubt_beside_parallel_axes(const Chain& robot, Diagnosis& diagnosis);

/// Adds to the notes what is doubtful of the robot file: by itself, and by what is identified on
/// `batch` with `sources`.
void tell_file_doubts(const std::shared_ptr<const Cell>& cell,
                      const std::vector<std::string>& sources, const MeasurementBatch& batch,
                      Diagnosis& diagnosis);

/// The notes, a sentence each, with a blank behind; empty where there are none.
[[nodiscard]] std::string file_doubts_said(const Diagnosis& diagnosis);

}  // namespace trammel::cause_search
