#pragma once

#include <regex>
#include <string>
#include <vector>

#include "clients/cam/correct_program.h"
#include "clients/cam/dialect.h"
#include "server/base/units.h"
#include "tests/support/small_cell.h"

/// A stand-in for a model: it moves every target by the same vector in the robot's base, without a
/// turn, with an uncertainty of 10 µm. The corrected program can be computed by hand.
namespace trammel::test {

inline const Vector3 kShift_mm(0.1234567, -0.2345678, 0.3456789);

/// A cell with the tool `spindle` of the shipped cell on the shipped robot.
inline cam::CellTools spindle_only() {
  const Pose X_FT = make_pose(Eigen::Quaterniond(0.923879532511287, 0, -0.382683432365090, 0)
                                  .normalized()
                                  .toRotationMatrix(),
                              {.1, 0, .15});
  return {{{"spindle", X_FT}}, {{"spindle", {100, {0, 0, .1}}}}};
}

inline Result<exchange::Answer<exchange::CorrectedTarget>> shift(
    const std::string&, const std::string&, const std::vector<exchange::AskedTarget>& targets) {
  exchange::Answer<exchange::CorrectedTarget> answer;
  answer.model.id = "0123456789ab";
  for (const exchange::AskedTarget& target : targets) {
    exchange::CorrectedTarget item;
    item.status = target.seed_rad.empty() ? "unreachable" : "ok";
    item.message =
        target.seed_rad.empty() ? "no joints bring the tool there; conf 1 would reach it" : "";
    item.commanded = target.pose;
    for (int k = 0; k < 3; ++k) item.commanded.xyz_mm[static_cast<std::size_t>(k)] += kShift_mm(k);
    for (const double q : target.seed_rad)
      item.joints_deg.push_back(to_deg(q + from_deg(0.0123456)));
    item.error_before_mm = kShift_mm.norm();
    item.sigma_mm = 0.01;
    item.error_after_mm = 0.01 * std::sqrt(3.0);
    item.iterations = 2;
    answer.items.push_back(item);
  }
  return answer;
}

/// The corrected program, or the sentence of the refusal.
struct Corrected {
  cam::CorrectedProgram program;
  std::string refusal;
};
inline Corrected corrected_by_shift(cam::Dialect dialect, const std::vector<cam::SourceFile>& files,
                                    const cam::ReadOptions& read = {},
                                    cam::CorrectProgramOptions options = {},
                                    const cam::CellTools& cell = spindle_only()) {
  options.version = "0.1.0";
  options.date = "2026-11-22";
  auto done = cam::correct_program(cam::read_program(dialect, files, read),
                                   small_cell("cam")->robot, cell, shift, options);
  if (!done) return {{}, sentence(done.error())};
  return {std::move(*done), ""};
}

/// The corrected text without the lines that were inserted.
inline std::string without_inserted(const cam::CorrectedProgram& program, std::size_t file = 0) {
  const std::string& text = program.files[file].text;
  std::string kept;
  int number = 1;
  for (std::size_t at = 0; at < text.size(); ++number) {
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    const bool inserted =
        std::any_of(program.inserted.begin(), program.inserted.end(), [&](const auto& line) {
          return line.file == program.files[file].name && line.line == number;
        });
    if (!inserted) kept += text.substr(at, end - at);
    at = end;
  }
  return kept;
}

/// Every number of the text replaced by `#`.
inline std::string without_numbers(const std::string& text) {
  static const std::regex kNumber(R"([+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)");
  return std::regex_replace(text, kNumber, "#");
}

/// The first row with that name; without one, the empty status fails the test.
inline cam::ReceiptRow row_of(const cam::CorrectedProgram& program, const std::string& name) {
  for (const cam::ReceiptRow& row : program.rows) {
    if (row.name == name) return row;
  }
  return {};
}

/// The receipt's text for the target of that name.
inline std::string why(const Corrected& made, const std::string& name) {
  return row_of(made.program, name).message;
}

}  // namespace trammel::test
