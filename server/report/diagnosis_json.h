#pragma once

#include <nlohmann/json.hpp>

#include "server/base/note.h"
#include "server/diagnose/diagnosis.h"

namespace trammel {

/// A diagnosis for programs, with the keys of DESIGN section 4 and more. mm; joints of `next_poses`
/// in degrees (rails mm), joints counted from 1; `joint` is null where a cause concerns the whole
/// arm. `notes`: what a user of the cell should know.
[[nodiscard]] nlohmann::ordered_json diagnosis_json(const Diagnosis& diagnosis,
                                                    const std::vector<Note>& notes = {});

}  // namespace trammel
