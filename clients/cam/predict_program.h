#pragma once

#include <functional>
#include <string>
#include <vector>

#include "clients/cam/cell_tools.h"
#include "clients/cam/program.h"
#include "clients/cam/receipt.h"
#include "server/exchange/answer.h"

/// The true path of the tool in an unchanged program.
namespace trammel::cam {

/// Predicts the error at joints with one tool and payload. All answers of one program come from one
/// model.
using AskPredictions = std::function<Result<exchange::Answer<exchange::Prediction>>(
    const std::string& tool, const std::string& payload,
    const std::vector<exchange::AskedJoints>& poses)>;

struct PredictedTarget {
  std::string name, file, motion, tool, frame;
  int line = 0;
  std::vector<int> used_at;
  std::string shown = {};  ///< its name for people and tables, see shown_name()
  std::string
      status;  ///< `ok`, `out_of_domain`, `joint_limit`, or `refused` where nothing can be said
  std::string message;                         ///< why not ok
  Vector3 p_B = Vector3::Constant(kNotKnown);  ///< m, as commanded
  exchange::Prediction predicted = {};         ///< not set where refused
};

struct PredictedProgram {
  std::string model_id;
  exchange::ModelInfo model;
  std::vector<PredictedTarget> targets;     ///< by file and line
  std::vector<std::string> contradictions;  ///< of the controller's files and the robot file
  std::vector<std::string> corrected;  ///< files that are marked as corrected, one sentence each
  std::vector<std::string> notes;
};

/// Predicts a program, corrected or not, as it is. Refuses the same as choose_tools() and `ask`.
[[nodiscard]] Result<PredictedProgram> predict_program(const Program& program, const Chain& robot,
                                                       const CellTools& cell,
                                                       const AskPredictions& ask,
                                                       const std::string& tool,
                                                       const std::string& payload);

}  // namespace trammel::cam
