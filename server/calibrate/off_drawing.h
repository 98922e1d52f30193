#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/calibration.h"

namespace trammel {

/// A number of the robot file that the data put farther off than any robot is off its drawing.
struct OffDrawing {
  std::string name;  ///< of the parameter: `d4`
  std::string text;  ///< `d4 20.012 mm (a robot may be 3 mm off its drawing)`
  double times = 0;  ///< of what a robot may be off
};

/// Those that are off by more than a robot may be (3 mm, 3 mrad, a zero of a joint 1 degree) and two standard
/// uncertainties, the farthest first. What a base or a tool that is found from the data takes up cannot be seen here.
///
/// Such a model is right about positions and of no use for corrected poses: the controller solves them with its own
/// lengths.
[[nodiscard]] std::vector<OffDrawing> off_drawing(const std::vector<IdentifiedParameter>& parameters);

/// One sentence that names the first three; empty where nothing is off.
[[nodiscard]] std::optional<std::string> off_drawing_text(const std::vector<IdentifiedParameter>& parameters);

}  // namespace trammel
