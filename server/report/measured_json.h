#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// `"measured"` of every result that rests on a model: its training poses, as far as they limit its
/// stated accuracy. For a model without such a record, it has only a sentence that says so.
[[nodiscard]] inline nlohmann::ordered_json measured_json(const CompensatedModel& model) {
  const std::optional<WhatWasMeasured>& measured = model.parts().measured;
  nlohmann::ordered_json json = {{"sentence", in_words(measured, model.cell())}};
  if (!measured) return json;
  const auto corner = [](const Vector3& p) {
    return std::vector{to_mm(p.x()), to_mm(p.y()), to_mm(p.z())};
  };
  json["poses"] = measured->poses;
  json["sides"] = nlohmann::ordered_json::array();
  for (const auto& one : measured->approaches)
    json["sides"].push_back({{"from_above", one.falling}, {"from_below", one.rising}});
  json["temperature_c"] = nullptr;
  if (measured->temperature)
    json["temperature_c"] = {{"min", measured->temperature->first},
                             {"max", measured->temperature->second}};
  json["box_mm"] = {{"lower", corner(measured->lower)}, {"upper", corner(measured->upper)}};
  json["volume_m3"] = measured->volume;
  json["reach_mm"] = nullptr;
  if (measured->reach) json["reach_mm"] = to_mm(*measured->reach);
  json["instrument"] = words_of(measured, model.cell()).instrument;
  return json;
}

}  // namespace trammel
