#pragma once

#include <string>
#include <vector>

#include "server/dds/gateway/service_calls.h"
#include "server/gateway/json_reader.h"

/// Questions in JSON as the values of server/exchange: mm and deg; the service judges the values.
namespace trammel {

/// `tool payload controller_compensates model` of a body.
[[nodiscard]] CallAbout about_in(JsonReader& body, const std::string& cell);
/// `{"poses": [{"joints_deg": [...], "directions", "temperature_c", "time_s"}]}`
[[nodiscard]] Result<std::vector<exchange::AskedJoints>> poses_in(JsonReader& body,
                                                                  const exchange::Rails& rails);
/// `{"targets": [{"x_mm" ... "qz", "conf" or "joints_deg", ...}]}`; a target with joints and
/// without a pose is a joint target.
[[nodiscard]] Result<std::vector<exchange::AskedTarget>> targets_in(JsonReader& body,
                                                                    const exchange::Rails& rails);

}  // namespace trammel
