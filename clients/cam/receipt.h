#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "clients/cam/program.h"
#include "server/exchange/answer.h"

/// The outcome of a correction: for a program and for each of its targets.
namespace trammel::cam {

constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// The outcome of one target.
struct ReceiptRow {
  std::string name, file, motion, tool, frame;
  int line = 0;
  std::vector<int> used_at;
  std::string shown = {};  ///< its name for people and tables, see shown_name()
  std::string status;  ///< `ok`, `out_of_domain`, ...; `refused` if the program does not determine
                       ///< it
  std::string message, suggestion;
  Coordinates coordinates = Coordinates::kQuaternion;
  std::vector<double> before,
      after;  ///< numbers of the file, in its units; `after` as written, empty: left alone
  std::vector<double> joints;  ///< deg, mm: the joints that the controller will take; empty: left
                               ///< alone
  double error_before_mm = kNotKnown, error_after_mm = kNotKnown;
  double sigma_mm = kNotKnown;           ///< of the true error, per axis
  double sigma_measured_mm = kNotKnown;  ///< of one measurement
  double rounding_mm = kNotKnown;        ///< distance between the written and the computed target
  int iterations = 0;
  int lead_in = 0;        ///< motions that were inserted before each motion to it
  double turned_deg = 0;  ///< about the tool's axis, if that turn is free
  bool folded = false;
  bool moves_along = false;  ///< it is unchanged in the file, but moves with a corrected target
  /// Speed of the tool at which the first axis reaches its limit on the way from the target before;
  /// see path_check.h.
  double path_limit_before_mm_s = kNotKnown, path_limit_after_mm_s = kNotKnown;
  Vector3 p_B = Vector3::Constant(kNotKnown);  ///< m, the wanted position
  Vector3 correction_B = Vector3::Zero();      ///< m, commanded - wanted position
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
  exchange::ModelInfo model;
  std::vector<SourceFile> files;  ///< corrected
  std::vector<bool> changed;      ///< of each file
  std::vector<ReceiptRow> rows;   ///< by file and line
  std::vector<InsertedLine> inserted;
  std::vector<std::string> contradictions;  ///< of the controller's files and the robot file
  std::vector<std::string> notes;
  std::size_t moves = 0, moves_corrected = 0;
  std::size_t lead_ins = 0;  ///< motions that were inserted, of all rows
  /// Largest change of the correction from a target to the next on a straight path, mm, and the
  /// latter's place.
  double largest_step_mm = 0;
  std::string largest_step_file = {};
  int largest_step_line = 0;

  [[nodiscard]] std::size_t left_alone() const;
};

}  // namespace trammel::cam
