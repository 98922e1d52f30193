#include "server/measurement/computed_positions.h"

#include <fmt/format.h>

#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr int kEnoughPoses = 10;  // with so many poses, close agreement is not chance, and no arm
                                  // model absorbs them all
constexpr double kNoArmRepeats = 2e-6;  // m

}  // namespace

std::optional<std::string> computed_not_measured(double rms, double sigma, int poses) {
  constexpr double kTooGood = 0.2;  // of the stated sigma, which may be several times too large
  const double left = rms / std::sqrt(3.0);
  if (poses < kEnoughPoses || !(left < kTooGood * sigma)) return std::nullopt;
  return fmt::format(
      "the positions are the model's to {:.4f} mm, and the instrument is said to measure to {:.3f} "
      "mm: these positions were computed, not measured",
      to_mm(rms), to_mm(sigma));
}

std::optional<std::string> computed_by_its_arm(double rms, int poses) {
  if (poses < kEnoughPoses || !(rms > 0 && rms < kNoArmRepeats)) return std::nullopt;
  return fmt::format(
      "the positions are the model's to {:.4f} mm, and no arm repeats to {:.3f} mm: these "
      "positions "
      "were computed, not measured",
      to_mm(rms), to_mm(kNoArmRepeats));
}

}  // namespace trammel
