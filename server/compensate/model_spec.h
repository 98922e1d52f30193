#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The settings that a training takes from the cell file if the request states none.
struct SpecUse {
  bool error_sources = true;
  bool bias = true;
};

/// The errors of the cell's own `model` for a training: an invalid bias, or an error source that is
/// unknown, repeated, or needs something the cell lacks. Each error is kRefused and names `file`,
/// row and key.
[[nodiscard]] std::vector<Error> check_model_spec(const Cell& cell, const std::string& file,
                                                  SpecUse use = {});

}  // namespace trammel
