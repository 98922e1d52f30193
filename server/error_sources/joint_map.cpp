#include "server/error_sources/joint_map.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "server/error_sources/error_source.h"
#include "server/error_sources/parameter.h"
#include "server/error_sources/shipped_causes.h"

namespace trammel {

namespace {

constexpr double kMicro = 1e-6;
constexpr int kMaxHarmonics = 500;
constexpr std::size_t kNumbersOfSpectrum = 4;
constexpr double kLeast = 1e-6;         // of amplitude and power
constexpr double kMostAmplitude = 1e6;  // urad
constexpr double kLeastKnee =
    0.01;  // with the most power a standard deviation is still a number above 0
constexpr double kMostKnee = 1e4;
constexpr double kMostPower = 50;

/// Sine and cosine of h q for h = 1, 2, ..., each the one before, turned by q.
class Harmonics {
 public:
  explicit Harmonics(double q) : sine_of_q_(std::sin(q)), cosine_of_q_(std::cos(q)) {}
  void next() {
    const double turned = cosine * cosine_of_q_ - sine * sine_of_q_;
    sine = sine * cosine_of_q_ + cosine * sine_of_q_;
    cosine = turned;
  }
  double sine = 0, cosine = 1;

 private:
  double sine_of_q_, cosine_of_q_;
};

/// An error of one joint's angle that depends on that angle alone: a Fourier series with period one
/// turn. The constant is the joint's zero.
class JointMap final : public ErrorSource {
 public:
  JointMap(const SourceSpec& spec, const MapSpectrum& spectrum)
      : name_(spec.text), joint_(spec.joint) {
    for (int h = 1; h <= spectrum.harmonics; ++h) {
      parameters_.push_back(
          angle_parameter(fmt::format("map{}_sin{}", joint_ + 1, h), spectrum.stddev(h)));
      parameters_.push_back(
          angle_parameter(fmt::format("map{}_cos{}", joint_ + 1, h), spectrum.stddev(h)));
    }
  }
  const CauseRecord& cause() const override { return causes::joint_map(); }
  std::string name() const override { return name_; }
  const std::vector<Parameter>& parameters() const override { return parameters_; }
  int joint() const override { return joint_; }
  std::string explanation() const override {
    return fmt::format("joint {} is off by a function of its own angle", joint_ + 1);
  }

  void apply(const PoseContext& context, const Eigen::Ref<const Eigen::VectorXd>& values,
             ArmState& state, StateJacobian* jacobian, int first_column) const override {
    Harmonics harmonic(context.q(joint_));
    double off = 0;
    for (int k = 0; k < static_cast<int>(parameters_.size()); k += 2) {
      harmonic.next();
      off += harmonic.sine * values(k) + harmonic.cosine * values(k + 1);
      if (jacobian == nullptr) continue;
      jacobian->add_to_joint(joint_, first_column + k, harmonic.sine);
      jacobian->add_to_joint(joint_, first_column + k + 1, harmonic.cosine);
    }
    state.add_to_joint(joint_, off);
  }

 private:
  std::string name_;
  int joint_;
  std::vector<Parameter> parameters_;
};

/// The spectrum in these numbers; empty if they have none.
std::optional<MapSpectrum> spectrum_of(const std::vector<double>& numbers) {
  MapSpectrum spectrum;
  if (numbers.empty()) return spectrum;
  if (numbers[0] != std::floor(numbers[0]) || numbers[0] > kMaxHarmonics) return std::nullopt;
  spectrum.harmonics = static_cast<int>(numbers[0]);
  if (numbers.size() == 1) return spectrum;
  if (numbers.size() != kNumbersOfSpectrum || numbers[1] > kMostAmplitude ||
      numbers[2] < kLeastKnee || numbers[2] > kMostKnee || numbers[3] > kMostPower)
    return std::nullopt;
  spectrum.amplitude = kMicro * numbers[1];
  spectrum.knee = numbers[2];
  spectrum.power = numbers[3];
  return spectrum;
}

Result<ErrorSourcePtr> make(const SourceSpec& spec, const Cell& cell) {
  if (cell.robot.joint(spec.joint).type != JointType::kRevolute) {
    return refused("error source '{}': joint {} does not turn", spec.text, spec.joint + 1);
  }
  const std::optional<MapSpectrum> spectrum = spectrum_of(spec.at);
  if (!spectrum) {
    return failure(
        ErrorCode::kUsage,
        "error source '{}': expected @harmonics, a whole number up to {}, or "
        "@harmonics+amplitude+knee+power, in urad up to {:g}, {:g} to {:g} and up to {:g}",
        spec.text, kMaxHarmonics, kMostAmplitude, kLeastKnee, kMostKnee, kMostPower);
  }
  return std::make_shared<JointMap>(spec, *spectrum);
}

/// The number with four significant digits. It has no exponent, since the sign of one would end the
/// number.
std::string in_digits(double value) {
  return fmt::format("{:.{}f}", value,
                     std::clamp(3 - static_cast<int>(std::floor(std::log10(value))), 0, 12));
}

/// True where `spelling` is a map of a joint.
bool is_map(const std::string& spelling) {
  return spelling.starts_with(fmt::format("{}:", causes::joint_map().spelling));
}

}  // namespace

double MapSpectrum::stddev(int harmonic) const {
  return amplitude / std::pow(1 + std::pow(harmonic / knee, 2), power / 2);
}

std::string spelled_map(int joint, const MapSpectrum& spectrum) {
  return fmt::format("{}:{}@{}+{}+{}+{}", causes::joint_map().spelling, joint + 1,
                     spectrum.harmonics,
                     in_digits(std::clamp(spectrum.amplitude / kMicro, kLeast, kMostAmplitude)),
                     in_digits(std::clamp(spectrum.knee, kLeastKnee, kMostKnee)),
                     in_digits(std::clamp(spectrum.power, kLeast, kMostPower)));
}

std::optional<int> joint_of_open_map(const std::string& spelling) {
  if (!is_map(spelling)) return std::nullopt;
  const char* const end = spelling.data() + spelling.size();
  int joint = 0;
  const auto [read, error] = std::from_chars(spelling.data() + spelling.find(':') + 1, end, joint);
  return error == std::errc() && read == end ? std::optional(joint - 1) : std::nullopt;
}

std::string without_learned_spectrum(const std::string& spelling) {
  const std::size_t at = spelling.find('@');
  const bool learned =
      is_map(spelling) && at != std::string::npos && spelling.find('+', at) != std::string::npos;
  return learned ? spelling.substr(0, at) : spelling;
}

const CauseRecord& causes::joint_map() {
  static const CauseRecord record = {
      .spelling = "joint_map",
      .plain_name = "angle error map",
      .plain_name_of_joint = "angle error map in joint {}",
      .scope = Scope::kJoint,
      .lasting = Lasting::kAlways,
      .needs = {},
      .search = SearchFamily::kMap,
      .acts = {ActsOn::kJoints, 2},
      .forms = {{"joint_map", make}},
      .rivals = {{.cause = "gear_transmission", .likeness = Likeness::kDoubtfulCase},
                 {.cause = "encoder_eccentricity", .likeness = Likeness::kSimplerCase},
                 {.cause = "geometry", .likeness = Likeness::kSpecialCase, .parameter = "q{}"}},
      .told_apart_by = remedies::kWiderRange,
      .shown_by = "more poses over this joint's range",
      .action = "compensate it; measure again after service of this joint",
      .figures = {{"peak_to_peak", "urad",
                   "how far apart the joint is off at the two poses that differ most"}},
      .summary = Summary::kPeakToPeak,
      .takes_numbers = true,
      .of_turning_joint = true,
  };
  return record;
}

}  // namespace trammel
