#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "server/compensate/budget/after_repair.h"

namespace trammel {

/// `"since"` of a diagnosis: the `model` before, the error beyond frames before and now, the
/// outcome of each line to be repaired (`lines`: before, moved, now with U, `helped`), the changes
/// line by line (`moved`, a budget), and the same in words (`sentences`).
[[nodiscard]] nlohmann::ordered_json after_repair_json(const AfterRepair& repair);

/// The outcome of a repair as a section of a page.
[[nodiscard]] std::string after_repair_section(const AfterRepair& repair);

}  // namespace trammel
