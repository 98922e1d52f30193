#include "server/report/answer_json.h"

#include <cmath>
#include <set>
#include <type_traits>

#include "server/exchange/columns.h"
#include "server/measurement/pose_columns.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

ordered_json number_json(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

/// Adds the figures of an answer at one of these places.
template <typename Figures, typename Answer>
void put_figures_at(const std::set<exchange::Place>& places, const Figures& figures,
                    const Answer& answer, ordered_json& json) {
  exchange::each_figure(figures, [&](const auto& figure) {
    const auto& value = answer.*figure.value;
    using Value = std::decay_t<decltype(value)>;
    if (!places.contains(figure.place)) return;
    if constexpr (std::is_same_v<Value, exchange::Pose>) {
      json[figure.name] = pose_json(value);
    } else if constexpr (std::is_integral_v<Value>) {
      json[figure.columns] = value;
    } else {
      exchange::each_column(figure.columns, value, [&](const std::string& name, double number) {
        json[name] = number_json(number);
      });
    }
  });
}

}  // namespace

nlohmann::ordered_json pose_json(const exchange::Pose& pose) {
  ordered_json json;
  exchange::each_column(exchange::kPoseColumns, pose,
                        [&](const std::string& name, double number) { json[name] = number; });
  return json;
}

void put_figures(const exchange::Prediction& prediction, const MoreFigures& more,
                 ordered_json& json) {
  std::set<exchange::Place> told = {exchange::Place::kInFront, exchange::Place::kBehind,
                                    exchange::Place::kJsonOnly};
  if (more.covariance) told.insert(exchange::Place::kCovariance);
  if (more.orientation) told.insert(exchange::Place::kOrientation);
  put_figures_at(told, exchange::kPredictionFigures, prediction, json);
}

void put_figures(const exchange::CorrectedTarget& target, ordered_json& json) {
  put_figures_at({exchange::Place::kInFront, exchange::Place::kBehind},
                 exchange::kCorrectionFigures, target, json);
}

bool has_command(const exchange::CorrectedTarget& target) {
  return target.status == "ok" || target.status == "out_of_domain" || target.status == "lead_in";
}

void put_command(const exchange::CorrectedTarget& target, const std::vector<JointType>& types,
                 ordered_json& json) {
  if (!has_command(target)) return;
  json["commanded"] = pose_json(target.commanded);
  json["joints"] = ordered_json::object();
  for (std::size_t j = 0; j < target.joints_deg.size(); ++j) {
    const JointType type = j < types.size() ? types[j] : JointType::kRevolute;
    json["joints"][joint_column(static_cast<int>(j), type)] = target.joints_deg[j];
  }
}

}  // namespace trammel
