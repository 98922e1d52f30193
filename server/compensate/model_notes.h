#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// What a user of the model should know, one sentence each: first what guards_of() says, then error sources without
/// effect, a bias that was learned with a tool that has moved since.
[[nodiscard]] std::vector<std::string> notes_of(const CompensatedModel& model);

/// `the bias does not help here: 0.0233 mm with it, 0.0229 mm without on 1000 poses`, where poses that were not trained
/// on show no gain beyond chance. Empty where they do, and without a bias.
[[nodiscard]] std::optional<std::string> doubt_of_bias(const Evaluation& evaluation);

/// All of both.
[[nodiscard]] std::vector<std::string> warnings_of(const CompensatedModel& model,
                                                   const std::optional<Evaluation>& evaluation);

}  // namespace trammel
