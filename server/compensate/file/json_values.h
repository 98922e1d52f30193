#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <vector>

#include "server/robot/pose.h"

/// Numbers, matrices and poses in the form of a model file. Their readers throw exceptions of
/// nlohmann; deserialize() (model_file.h) turns these into a refusal.
namespace trammel::model_file {

using Json = nlohmann::json;

/// `{"rows", "columns", "values"}`, row after row.
[[nodiscard]] Json matrix_json(const Eigen::Ref<const Eigen::MatrixXd>& m);
/// 3 x 4: rotation and translation, m.
[[nodiscard]] Json pose_json(const Pose& X);

/// Ends the reading with an error: `what` was expected or is wrong.
[[noreturn]] void wrong(const char* what, const Json& json);

/// A number, finite.
[[nodiscard]] double number_from(const Json& json);
[[nodiscard]] double number_from(const Json& json, const char* key);

/// Checks that the number fits into `Whole`.
template <typename Whole>
[[nodiscard]] Whole whole_from(const Json& json) {
  if (json.is_number_unsigned()) {
    if (json.get<std::uint64_t>() <= static_cast<std::uint64_t>(std::numeric_limits<Whole>::max()))
      return json.get<Whole>();
  } else if (json.is_number_integer() && std::is_signed_v<Whole>) {
    if (json.get<std::int64_t>() >= static_cast<std::int64_t>(std::numeric_limits<Whole>::min()))
      return json.get<Whole>();
  }
  wrong("expected a whole number within its range", json);
}
template <typename Whole>
[[nodiscard]] Whole whole_from(const Json& json, const char* key) {
  return whole_from<Whole>(json.at(key));
}

/// A count: whole and not below 0.
[[nodiscard]] int count_from(const Json& json, const char* key);
[[nodiscard]] const Json& list_from(const Json& json);
[[nodiscard]] std::vector<double> numbers_from(const Json& json);
[[nodiscard]] bool truth_from(const Json& json);
[[nodiscard]] Eigen::MatrixXd matrix_from(const Json& json);
/// One column.
[[nodiscard]] Eigen::VectorXd vector_from(const Json& json);
[[nodiscard]] Vector3 vector3_from(const Json& json);
[[nodiscard]] Pose pose_from(const Json& json);

}  // namespace trammel::model_file
