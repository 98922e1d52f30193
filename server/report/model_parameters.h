#pragma once

#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Every parameter with its nominal value, correction and result, angles in degrees, ± U(k = 2), as
/// HTML.
[[nodiscard]] std::string parameter_table(const CompensatedModel& model);
/// The parameter combinations that the measurements leave undetermined, in words.
[[nodiscard]] std::string unidentifiable_text(const ModelParts& parts);

}  // namespace trammel
