#pragma once

#include <string>

#include "clients/cam/program.h"

namespace trammel::cam {

/// A sentence where the targets look as if they had been taught by jogging: such positions hold the
/// robot's errors already. Empty: they do not. Programs are told by their numbers alone, so a wrong
/// guess is possible both ways.
[[nodiscard]] std::string note_on_taught_targets(const Program& program);

}  // namespace trammel::cam
