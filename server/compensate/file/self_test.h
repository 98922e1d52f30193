#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

namespace trammel::model_file {

/// The largest accepted difference between a prediction and the stated one. Another processor adds
/// and multiplies in another order, and another release may compute the same differently.
/// kSelfTestMetres always applies, plus kErrorShare of the error and kStddevShare of a standard
/// deviation. Older files may state standard deviations that are too large by kStatedMoreShare.
constexpr double kSelfTestMetres = 1e-9;
constexpr double kErrorShare = 1e-8;
constexpr double kStddevShare = 1e-3;
constexpr double kStatedMoreShare = 0.03;

/// The `self_test` of a model file (MODEL_FILE.md): the model's predictions at a few joint vectors
/// in its range and one beside it.
[[nodiscard]] nlohmann::json self_test_of(const CompensatedModel& model);

/// Checks that the model still gives the predictions in `self_test`. Throws exceptions of nlohmann
/// as parts_from() does.
[[nodiscard]] Status check_self_test(const CompensatedModel& model,
                                     const nlohmann::json& self_test);

}  // namespace trammel::model_file
