#pragma once

#include <string>

#include "clients/cli/terminal/options.h"
#include "server/base/result.h"

namespace trammel::cli {

/// The recently requested poses of a service's cell, predicted by its model in force and by another
/// version.
struct RecentWorkArguments {
  std::string model;             ///< `cell` or `cell@version`
  std::string json, next_poses;  ///< where to write; empty: nowhere
};
/// Returns by how much the corrections of the two differ at most, mm; 0 where there is no other
/// version.
[[nodiscard]] Result<double> tell_recent_work(const RecentWorkArguments& arguments,
                                              const ServiceOptions& service);

}  // namespace trammel::cli
