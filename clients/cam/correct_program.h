#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/mark.h"
#include "clients/cam/program.h"
#include "clients/session/session_types.h"
#include "server/robot/cell.h"

/// A program in, a corrected program and its receipt out. The same for every dialect, and for a model in a file or
/// behind a service.
namespace trammel::cam {

/// Corrects targets with one tool and payload. All answers of one program come from one model.
using AskCorrections = std::function<Result<client::Answer<client::CorrectedTarget>>(
    const std::string& tool, const std::string& payload, const std::vector<client::TargetMm>& targets)>;

struct CorrectProgramOptions {
  std::string tool, payload;  ///< of the cell, as the user named them
  bool keep_digits = false;   ///< numbers keep their decimals, whatever rounding costs
  std::string version;        ///< of this program, for the mark
  std::string date;           ///< for the mark
};

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// What became of one target.
struct ReceiptRow {
  std::string name, file, motion, tool, frame;
  int line = 0;
  std::vector<int> used_at;
  std::string status;  ///< `ok`, `out_of_domain`, ...; `refused` where the program leaves it open
  std::string message, suggestion;
  Coordinates coordinates = Coordinates::kQuaternion;
  std::vector<double> before, after;  ///< numbers of the file, in its units; `after` as written, empty: left alone
  std::vector<double> joints;         ///< deg, mm: what the controller will take; empty: left alone
  double error_before_mm = kNotKnown, error_after_mm = kNotKnown;
  double sigma_mm = kNotKnown;           ///< of the true error, per axis
  double sigma_measured_mm = kNotKnown;  ///< of one measurement
  double rounding_mm = kNotKnown;        ///< distance of what is written from what was computed
  int iterations = 0;
  bool folded = false;
  Vector3 p_B = Vector3::Constant(kNotKnown);  ///< m, the wanted position
  std::size_t order = 0;                       ///< of its first motion in the program

  [[nodiscard]] bool corrected() const { return !after.empty(); }
};

struct InsertedLine {
  std::string file;
  int line = 0;  ///< of the corrected file
  std::string text;
};

struct CorrectedProgram {
  std::string model_id;
  client::ModelInfo model;
  std::vector<SourceFile> files;  ///< corrected
  std::vector<bool> changed;      ///< of each file
  std::vector<ReceiptRow> rows;   ///< by file and line
  std::vector<InsertedLine> inserted;
  std::vector<std::string> notes;
  std::size_t moves = 0, moves_corrected = 0;

  [[nodiscard]] std::size_t left_alone() const;
};

/// Refuses what choose_tools() refuses, a file that is marked as corrected, and what `ask` refuses.
[[nodiscard]] Result<CorrectedProgram> correct_program(const Program& program, const Chain& robot,
                                                       const CellTools& cell, const AskCorrections& ask,
                                                       const CorrectProgramOptions& options);

}  // namespace trammel::cam
