#pragma once

#include <nlohmann/json.hpp>

#include "server/base/note.h"
#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A diagnosis for programs, with the keys of DESIGN section 4 and more. mm; joints of `next_poses`
/// in degrees (rails mm), joints counted from 1; `joint` is null for a cause of the whole arm.
/// `notes`: for users of the cell.
[[nodiscard]] nlohmann::ordered_json diagnosis_json(const Diagnosis& diagnosis,
                                                    const std::vector<Note>& notes = {});

}  // namespace trammel
