#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "clients/cli/studies/studies.h"

/// A study, told to people and to programs.
namespace trammel::cli {

/// The source's figures, ours and the aims, side by side; mm.
[[nodiscard]] std::string study_text(const Study& study);
/// The study with all its figures.
[[nodiscard]] nlohmann::ordered_json study_json(const Study& study);

}  // namespace trammel::cli
