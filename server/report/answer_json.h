#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/exchange/values.h"
#include "server/robot/chain.h"

/// Predictions and corrections as JSON: the command line and HTTP write the same members, those of
/// the tables of figures (exchange/values.h). mm and deg; a number that is not known is null.
namespace trammel {

/// `x_mm` ... `qz`.
[[nodiscard]] nlohmann::ordered_json pose_json(const exchange::Pose& pose);

/// What is written beside the usual figures.
struct MoreFigures {
  bool covariance = false;
  bool orientation = false;
};
/// Adds `dx_mm` ... `predicted`.
void put_figures(const exchange::Prediction& prediction, const MoreFigures& more,
                 nlohmann::ordered_json& json);
/// Adds `error_before_mm` ... `turn_after_deg`.
void put_figures(const exchange::CorrectedTarget& target, nlohmann::ordered_json& json);

/// True if there is a pose to command. Otherwise no numbers are written, since a program could take
/// them for a command.
[[nodiscard]] bool has_command(const exchange::CorrectedTarget& target);
/// Adds `commanded` and `joints` (`q1_deg`, of a rail `q1_mm`), where there is a command. A joint
/// beyond the end of `types` turns.
void put_command(const exchange::CorrectedTarget& target, const std::vector<JointType>& types,
                 nlohmann::ordered_json& json);

}  // namespace trammel
