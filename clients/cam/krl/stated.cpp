#include "clients/cam/krl/stated.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/units.h"

namespace trammel::cam::krl {

namespace {

class Stated {
 public:
  Stated(const std::vector<std::vector<Line>>& lines, const ReadOptions& options, Variables& names,
         Program& program)
      : lines_(lines), options_(options), names_(names), program_(program) {}

  void read() {
    for (std::size_t f = 0; f < lines_.size(); ++f) {
      for (std::size_t k = 0; k < lines_[f].size(); ++k) note_robot(f, k);
    }
    find_base();
    find_numbers();
    find_limits();
  }

 private:
  /// Each value that a variable of the controller is given in the files.
  template <typename Work>
  void at_each(const std::string& name, const Work& work) const {
    for (const auto& [key, variable] : names_.all()) {
      if (key.second != name) continue;
      for (const Assigned& at : variable.values) {
        if (at.operands.size() == 1) work(at, at.operands[0]);
      }
    }
  }

  void find_base() {
    if (!on_rail_.empty()) {
      program_.notes.push_back(fmt::format(
          "an external axis carries the robot ({}): $ROBROOT moves and is not used", on_rail_));
      return;
    }
    at_each("$ROBROOT", [&](const Assigned& at, const Value&) {
      const Told<Pose> X_WB = names_.frame_of(at.operands, at.file);
      if (X_WB)
        program_.bases.push_back({*X_WB, "$ROBROOT", program_.files[at.file].name, line_at(at)});
    });
    if (const auto row = options_.frames.find(kRobotBase); row != options_.frames.end())
      names_.set_robroot(row->second);
    else if (!program_.bases.empty())
      names_.set_robroot(program_.bases.front().X_WB);
  }

  void find_numbers() {
    const auto add = [&](ArmNumber of, const char* name, const auto& value_of) {
      at_each(name, [&](const Assigned& at, const Value& value) {
        if (const std::optional<double> number = value_of(at, value))
          program_.numbers.push_back(
              {of, *number, name, program_.files[at.file].name, line_at(at)});
      });
    };
    const auto count = [](const Assigned&, const Value& value) -> std::optional<double> {
      return value.kind == Value::Kind::kNumber ? std::optional<double>(value.number)
                                                : std::nullopt;
    };
    const auto length = [](const Assigned&, const Value& value) -> std::optional<double> {
      // Arms of other kinds have zeros there.
      const bool said = value.kind == Value::Kind::kNumber && value.number != 0;
      return said ? std::optional<double>(from_mm(value.number)) : std::nullopt;
    };
    const auto along = [&](const Assigned& at, const Value&) -> std::optional<double> {
      const Told<Pose> X = names_.frame_of(at.operands, at.file);
      const bool said = X && !X->translation().isZero();
      return said ? std::optional<double>(X->translation().norm()) : std::nullopt;
    };
    // How the flange turns about the last axis is the zero of that axis.
    const auto tilt = [&](const Assigned& at, const Value&) -> std::optional<double> {
      const Told<Pose> X = names_.frame_of(at.operands, at.file);
      return X ? std::optional<double>(std::acos(std::clamp(X->linear()(2, 2), -1.0, 1.0)))
               : std::nullopt;
    };
    add(ArmNumber::kAxes, "$NUM_AX", count);
    add(ArmNumber::kHeightOfAxis2, "$TIRORO", along);
    add(ArmNumber::kAxis1ToAxis2, "$LENGTH_A", length);
    add(ArmNumber::kAxis2ToAxis3, "$LENGTH_B", length);
    add(ArmNumber::kAxis3ToWrist, "$TX3P3", along);
    add(ArmNumber::kWristToFlange, "$TFLWP", along);
    add(ArmNumber::kTiltOfFlange, "$TFLWP", tilt);
  }

  /// `$SOFTN_END[3]=-115.0`, of the axes of the arm.
  void find_limits() {
    constexpr int kOfTheArm = 6;
    for (int axis = 0; axis < kOfTheArm; ++axis) {
      for (const auto& [stem, upper] :
           {std::pair("$SOFTN_END", false), std::pair("$SOFTP_END", true)}) {
        const std::string name = fmt::format("{}[{}]", stem, axis + 1);
        const bool is_upper = upper;
        at_each(name, [&](const Assigned& at, const Value& value) {
          if (value.kind == Value::Kind::kNumber)
            program_.limits.push_back({axis, is_upper, from_deg(value.number), name,
                                       program_.files[at.file].name, line_at(at)});
        });
      }
    }
  }

  /// `$TRAFONAME[]="#KR210R2700 EXTRA C4 FLR"`, the same as `$MODEL_NAME[]`, `DECL EX_KIN
  /// $EX_KIN={ET1 #ERSYS,...}`
  void note_robot(std::size_t f, std::size_t k) {
    const Tokens& tokens = lines_[f][k].tokens;
    if (tokens.has("$EX_KIN") && tokens.has("ERSYS")) on_rail_ = names_.place(f, k);
    const Token name = tokens.back();
    const bool says = tokens.size() >= 3 &&
                      (tokens[0].is("$TRAFONAME") || tokens[0].is("$MODEL_NAME")) &&
                      name.is_text() && name.text[0] == '"';
    if (!says) return;
    const SourceFile& file = program_.files[f];
    program_.types.push_back(
        {file.text.substr(name.begin + 1, std::max<std::size_t>(name.text.size(), 2) - 2),
         std::string(tokens[0].text), file.name, lines_[f][k].number});
  }

  [[nodiscard]] int line_at(const Assigned& at) const { return lines_[at.file][at.line].number; }

  const std::vector<std::vector<Line>>& lines_;
  const ReadOptions& options_;
  Variables& names_;
  Program& program_;
  std::string on_rail_;  ///< the place of a statement that an external axis carries the robot;
                         ///< empty: none
};

}  // namespace

void read_stated(const std::vector<std::vector<Line>>& lines, const ReadOptions& options,
                 Variables& names, Program& program) {
  Stated(lines, options, names, program).read();
}

}  // namespace trammel::cam::krl
