#pragma once

#include <cstdint>
#include <string>

#include "server/robot/cell.h"

namespace trammel {

/// The findings of a health check (report/README.md), for people, as sections of a page.
/// `findings`: the stored JSON, perhaps from an earlier version of the program; missing members are
/// left out. `links`: HTML below the verdict.
[[nodiscard]] std::string health_sections(const std::string& findings, const std::string& links);

/// The facts for a page that shows one health check alone.
struct HealthPageOf {
  std::string cell, batch;
  std::int64_t at = 0;  ///< when it was checked, Unix time, s
  const Cell* papers =
      nullptr;  ///< its file says which robot, instrument and operator; null: not known
};
[[nodiscard]] std::string health_page(const std::string& findings, const HealthPageOf& of);

}  // namespace trammel
