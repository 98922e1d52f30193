#pragma once

#include <optional>
#include <string>

/// The size that the harmonics of a joint's map are expected to have.
namespace trammel {

/// The sine and the cosine of harmonic h are normal with standard deviation amplitude / (1 +
/// (h/knee)²)^(power/2): a random function of the joint's angle, the smoother the larger the power.
/// Amplitudes that fall as 1/h have power 1 and a knee of 1.
struct MapSpectrum {
  int harmonics = 48;
  double amplitude = 3e-4;  ///< rad, of slow harmonics
  double knee = 6;          ///< harmonic at which the amplitudes begin to fall
  double power = 2;         ///< of the variance, by 1 + (h/knee)²

  [[nodiscard]] double stddev(int harmonic) const;
};

/// The map of `joint` (0-based) with that spectrum, in the spelling of a source:
/// `joint_map:2@110+312.5+1.84+1.02`, harmonics, amplitude in µrad, knee and power.
[[nodiscard]] std::string spelled_map(int joint, const MapSpectrum& spectrum);

/// The joint (0-based) of a map without a stated spectrum, `joint_map:2`. Empty for any other
/// spelling.
[[nodiscard]] std::optional<int> joint_of_open_map(const std::string& spelling);

/// The spelling without a spectrum that was learned: `joint_map:2` of
/// `joint_map:2@110+312.5+1.84+1.02`. Any other spelling stays unchanged.
[[nodiscard]] std::string without_learned_spectrum(const std::string& spelling);

}  // namespace trammel
