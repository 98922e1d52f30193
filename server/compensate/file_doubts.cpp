#include "server/compensate/file_doubts.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "server/base/units.h"
#include "server/compensate/bias_physics.h"
#include "server/robot/robot_confirmation.h"

namespace trammel {

namespace {

using Severity = Note::Severity;

/// The largest credible deviation of a robot's number from its drawing, SI, and its unit for
/// people.
struct Drawing {
  const char* symbol;
  double limit;
  const char* unit;
  double per_si;
};
const Drawing kDrawing[] = {{"q", from_deg(1), "deg", to_deg(1)},
                            {"d", from_mm(3), "mm", to_mm(1)},
                            {"a", from_mm(3), "mm", to_mm(1)},
                            {"alpha", 3e-3, "deg", to_deg(1)},
                            {"beta", 3e-3, "deg", to_deg(1)}};

/// The kind of `d4`; none of `theta7` (of a rail, which stands as it was mounted) or `C2`.
const Drawing* drawing_of(const std::string& name) {
  const std::size_t digits = name.find_first_of("0123456789");
  if (digits == std::string::npos ||
      name.find_first_not_of("0123456789", digits) != std::string::npos)
    return nullptr;
  const std::string_view symbol = std::string_view(name).substr(0, digits);
  for (const Drawing& one : kDrawing)
    if (symbol == one.symbol) return &one;
  return nullptr;
}

/// The numbers that are farther off their drawing than a robot may be.
struct OffDrawing {
  std::string numbers;
  bool zeros_alone = true;
};

/// The parameters of an error source of the arm that are farther off than a robot may be by more
/// than their uncertainty.
OffDrawing off_drawing(const PhysicalModel& model,
                       const std::vector<IdentifiedParameter>& parameters) {
  OffDrawing off;
  std::size_t first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const std::size_t count = source->parameters().size();
    for (std::size_t i = first; i < first + count && source->cause().part == causes::Part::kLinks;
         ++i) {
      const IdentifiedParameter& one = parameters[i];
      const Drawing* drawing = drawing_of(one.parameter.name);
      if (drawing == nullptr || std::abs(one.value) - 2 * one.stddev <= drawing->limit) continue;
      const bool is_zero = drawing == kDrawing;
      off.zeros_alone = off.zeros_alone && is_zero;
      // A zero in the controller's sign, as in all other texts for people.
      const double sign =
          is_zero ? model.cell->robot.joint(std::stoi(one.parameter.name.substr(1)) - 1).sign : 1.0;
      off.numbers += fmt::format(
          "{}{} by {:.3g} {} (limit {:.3g})", off.numbers.empty() ? "" : ", ", one.parameter.name,
          sign * drawing->per_si * one.value, drawing->unit, drawing->per_si * drawing->limit);
    }
    first += count;
  }
  return off;
}

/// `3, 8, 11 and 4 more`
std::string rows_of(const std::vector<SuspectPose>& suspects) {
  constexpr std::size_t kMost = 40;
  std::vector<int> rows;
  for (const SuspectPose& pose : suspects) rows.push_back(pose.row);
  std::sort(rows.begin(), rows.end());
  const std::size_t shown = std::min(rows.size(), kMost);
  const std::string text =
      fmt::format("{}", fmt::join(rows.begin(), rows.begin() + static_cast<long>(shown), ", "));
  return shown < rows.size() ? fmt::format("{} and {} more", text, rows.size() - shown) : text;
}

}  // namespace

std::optional<Note> rows_that_do_not_fit(const std::vector<SuspectPose>& suspects, int others) {
  constexpr double kMany = 0.1;  // of all rows: more than single mistakes
  const std::size_t count = suspects.size();
  if (count == 0) return std::nullopt;
  const bool many = static_cast<double>(count) > kMany * (static_cast<double>(count) + others);
  double worst = 0;
  for (const SuspectPose& pose : suspects) worst = std::max(worst, pose.distance);
  return Note{
      "rows_do_not_fit", many ? Severity::kStop : Severity::kWarning,
      fmt::format("{} of the measured rows {} not fit the others, by up to {:.3g} mm, and hardly "
                  "{}: {} {}; measure {} again",
                  count, count == 1 ? "does" : "do", to_mm(worst), count == 1 ? "counts" : "count",
                  count == 1 ? "row" : "rows", rows_of(suspects), count == 1 ? "it" : "them")};
}

bool identifies_geometry(const PhysicalModel& model) {
  return std::any_of(model.sources.begin(), model.sources.end(), [](const ErrorSourcePtr& source) {
    return source->cause().part == causes::Part::kLinks;
  });
}

std::optional<Note> robot_off_drawing(const PhysicalModel& model,
                                      const std::vector<IdentifiedParameter>& parameters,
                                      double discrepancy) {
  constexpr double kMuchLeft = 3;  // times the stated sigma
  const OffDrawing off = off_drawing(model, parameters);
  if (off.numbers.empty()) return std::nullopt;
  const double stated = model.cell->tracker.sigma;
  const double times = std::hypot(discrepancy, stated) / stated;
  const std::string lacking =
      times < kMuchLeft
          ? ""
          : fmt::format(
                "{:.0f} times the stated sigma is left as well: is it something that the "
                "error sources lack, and the number makes up for (trammel diagnose)? Else ",
                times);
  // Lengths and angles that fit the drawing are this robot's: it lost its zeros.
  if (off.zeros_alone && lacking.empty())
    return Note{
        kOffDrawing, Severity::kStop,
        fmt::format("zeros are far off: {}; no mastered joint is. Re-master them and measure "
                    "again. Where they are mastered, the robot file counts from another zero "
                    "than the controller: compare them (trammel confirm-robot)",
                    off.numbers)};
  // A model of the wrong robot file fits positions and is of no use for corrected poses.
  return Note{
      kOffDrawing, Severity::kStop,
      fmt::format(
          "no robot is so far off its drawing: {}; {}is it this robot's file, and is the tool in "
          "the "
          "cell file the one that was measured (null in its place finds it)? Where the file is not "
          "the controller's, corrected poses land off by the difference, since the controller "
          "solves them with its own arm: compare them (trammel confirm-robot)",
          off.numbers, lacking)};
}

namespace {

/// Where the base was found, seen from where the cell file has it.
struct BaseShift {
  double away = 0, along = 0;    ///< m: in all; along the axis of joint 1
  double turned = 0, about = 0;  ///< rad: in all; about the axis of joint 1

  BaseShift(const Pose& said, const Pose& found) {
    const Pose shift = said.inverse() * found;
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(shift.linear()).normalized());
    away = shift.translation().norm();
    along = shift.translation().z();
    turned = turn.angle();
    about = turn.angle() * turn.axis().z();
  }
  /// True within what a base that was measured may be off.
  [[nodiscard]] bool is_set() const { return away < kSet && turned < kSetTurn; }
  [[nodiscard]] bool is_far() const { return away >= kFar || turned >= kFarTurn; }
  /// True if the first length of the robot file, or the zero of joint 1, explains the shift alone
  /// and is farther off than a robot may be. A base that stands elsewhere is also moved sideways.
  [[nodiscard]] bool may_be_the_arm() const {
    const bool aside = std::sqrt(std::max(0.0, away * away - along * along)) >= kSet;
    const bool tilted = std::sqrt(std::max(0.0, turned * turned - about * about)) >= kSetTurn;
    return !aside && !tilted && (std::abs(along) > kSet || std::abs(about) > kZero);
  }

  static constexpr double kSet = 3e-3, kFar = 50e-3;  // m
  static constexpr double kSetTurn = from_deg(0.5), kFarTurn = from_deg(5);
  static constexpr double kZero = from_deg(1);
};

/// What the shift of the base may be, and what to do.
std::string shift_explained(const BaseShift& shift, bool stops) {
  if (stops)
    return fmt::format(
        ". It may be the robot file as well, by {}, and the measurements do not tell which: then "
        "corrected poses land off by as much. Compare the file with the controller (trammel "
        "confirm-robot). Where the file is right, write",
        std::abs(shift.along) > BaseShift::kSet
            ? fmt::format("{:.1f} mm in its first length (d1 or d_mm of the base)",
                          to_mm(std::abs(shift.along)))
            : fmt::format("{:.2f} deg in the zero of joint 1", to_deg(std::abs(shift.about))));
  if (shift.is_far())
    return ". Was the instrument set up elsewhere, or is `base` of the cell file wrong? Write";
  return "; if it was measured and not drawn, the first length of the robot file is off by that; "
         "else write";
}

}  // namespace

std::optional<Note> base_elsewhere(const PhysicalModel& model) {
  const std::optional<Pose>& said = model.cell->X_WB;
  if (!said) return std::nullopt;
  const Pose found = served_base(model);
  const BaseShift shift(*said, found);
  if (shift.is_set()) return std::nullopt;
  const bool stops =
      shift.may_be_the_arm() && identifies_geometry(model) && !confirmation_of(*model.cell);
  const Eigen::Quaterniond q(found.linear());
  const Vector3 p = found.translation();
  return Note{
      kBaseElsewhere,
      stops            ? Severity::kStop
      : shift.is_far() ? Severity::kWarning
                       : Severity::kInfo,
      fmt::format("the robot's base stands {:.{}f} mm from where the cell file has it, turned by "
                  "{:.1f} deg, by the measurements, which the model follows{} base: {{xyz_mm: "
                  "[{:.1f}, {:.1f}, {:.1f}], q_wxyz: [{:.5f}, {:.5f}, {:.5f}, {:.5f}]}}, or null",
                  to_mm(shift.away), shift.is_far() ? 0 : 1, to_deg(shift.turned),
                  shift_explained(shift, stops), to_mm(p.x()), to_mm(p.y()), to_mm(p.z()), q.w(),
                  q.x(), q.y(), q.z())};
}

Note measurements_rounded(const Rounding& rounding) {
  return {"measurements_rounded", Severity::kWarning,
          fmt::format("the measured {} are whole multiples of {:g} mm, which alone makes {:.3f} mm "
                      "{}, and {:.3f} mm is stated: write them with all digits that the instrument "
                      "has; a controller's display is no instrument",
                      rounding.is_of_gauges ? "distances and touches" : "positions",
                      to_mm(rounding.step), to_mm(rounding.stddev()),
                      rounding.is_of_gauges ? "each" : "an axis", to_mm(rounding.sigma))};
}

namespace {

/// The identified lengths of the arm: their drawn values and their deviations.
struct Lengths {
  std::vector<Eigen::Index> parameters;
  Eigen::VectorXd drawn, off;  ///< m
};

Lengths identified_lengths(const PhysicalModel& model,
                           const std::vector<IdentifiedParameter>& parameters) {
  Lengths all;
  std::vector<double> drawn, off;
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : model.sources) {
    const auto end = first + static_cast<Eigen::Index>(source->parameters().size());
    for (Eigen::Index i = first; i < end && source->cause().part == causes::Part::kLinks; ++i) {
      const IdentifiedParameter& one = parameters[static_cast<std::size_t>(i)];
      const Drawing* drawing = drawing_of(one.parameter.name);
      if (drawing == nullptr || (drawing->symbol[0] != 'd' && drawing->symbol[0] != 'a') ||
          std::string_view(drawing->unit) != "mm")
        continue;
      const LinkGeometry& link =
          model.cell->robot.joint(std::stoi(one.parameter.name.substr(1)) - 1).link;
      const double length = drawing->symbol[0] == 'd' ? link.d : link.a;
      if (length == 0) continue;
      all.parameters.push_back(i);
      drawn.push_back(length);
      off.push_back(one.value);
    }
    first = end;
  }
  all.drawn = Eigen::VectorXd::Map(drawn.data(), static_cast<Eigen::Index>(drawn.size()));
  all.off = Eigen::VectorXd::Map(off.data(), static_cast<Eigen::Index>(off.size()));
  return all;
}

}  // namespace

std::optional<Note> lengths_scaled(const PhysicalModel& model,
                                   const std::vector<IdentifiedParameter>& parameters,
                                   const Eigen::MatrixXd& covariance) {
  constexpr double kOfMaking = 20e-6;        // m: no length is known better
  constexpr Eigen::Index kFewest = 3;        // lengths: two agree by chance
  constexpr double kLeast = 200e-6;          // of a length: an arm that is 17 K warmer than drawn
  constexpr double kGrowth = 12e-6;          // of steel and cast iron, 1/K
  constexpr double kWarmest = 50 * kGrowth;  // no arm in a hall is farther from its drawing
  constexpr double kSure = 5;                // standard deviations
  constexpr double kLeftOver = 0.02;  // of the squares: the largest part that may remain after one
                                      // common share
  const Lengths lengths = identified_lengths(model, parameters);
  if (lengths.drawn.size() < kFewest ||
      covariance.rows() < static_cast<Eigen::Index>(parameters.size()))
    return std::nullopt;
  Eigen::MatrixXd C = covariance(lengths.parameters, lengths.parameters);
  C.diagonal().array() += kOfMaking * kOfMaking;
  const Eigen::LDLT<Eigen::MatrixXd> solved(C);
  const Eigen::VectorXd weighed = solved.solve(lengths.drawn);
  const double precision = weighed.dot(lengths.drawn);
  const double share = weighed.dot(lengths.off) / precision;
  const Eigen::VectorXd left = lengths.off - share * lengths.drawn;
  const double before = lengths.off.dot(solved.solve(lengths.off)),
               after = left.dot(solved.solve(left));
  if (std::abs(share) < kLeast || std::abs(share) * std::sqrt(precision) < kSure ||
      after > kLeftOver * before)
    return std::nullopt;
  const bool warmth = std::abs(share) <= kWarmest;
  return Note{
      "lengths_scaled", warmth ? Severity::kWarning : Severity::kStop,
      fmt::format(
          "all {} lengths of the arm come out about {:.2f} % {} than drawn: one cause is likelier "
          "than as many errors of making. Is it the instrument's scale (hold it against a "
          "known length, give it the air's temperature), or {}? These positions do not tell; "
          "where it is {}, corrected targets land off by that share of their distance",
          lengths.drawn.size(), 100 * std::abs(share), share > 0 ? "longer" : "shorter",
          warmth ? fmt::format("an arm that is {:.0f} K {} than its drawing",
                               std::abs(share) / kGrowth, share > 0 ? "warmer" : "colder")
                 : "the file of another robot (no warmth makes as much)",
          warmth ? "the instrument" : "either")};
}

}  // namespace trammel
