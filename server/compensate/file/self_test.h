#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

namespace trammel::model_file {

/// The most by which a prediction may differ from the stated one: another processor adds and
/// multiplies in another order, and another release may compute the same in another way.
/// kSelfTestMetres always; of the error kErrorShare; of a standard deviation kStddevShare. Files
/// from before may state standard deviations that are too large by kStatedMoreShare.
constexpr double kSelfTestMetres = 1e-9;
constexpr double kErrorShare = 1e-8;
constexpr double kStddevShare = 1e-3;
constexpr double kStatedMoreShare = 0.03;

/// The `self_test` of a model file (MODEL_FILE.md): what the model predicts at a few joints of its
/// range and one beside it.
[[nodiscard]] nlohmann::json self_test_of(const CompensatedModel& model);

/// Checks that the model predicts what `self_test` states. Throws exceptions of nlohmann as
/// parts_from() does.
[[nodiscard]] Status check_self_test(const CompensatedModel& model,
                                     const nlohmann::json& self_test);

}  // namespace trammel::model_file
