#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trammel/result.h"
#include "trammel/values.h"

/// The types that predictions and corrections are made of, from a file or from a service.
namespace trammel::api {

using exchange::CorrectedTarget;
using exchange::Pose;
using exchange::Prediction;

/// The circumstances that hold for all poses of a call.
struct Context {
  std::string tool;     ///< id in the cell file; empty: the cell's only one
  std::string payload;  ///< likewise
  std::vector<int>
      directions;  ///< from which each joint is approached: -1, 0, +1; empty: not known
  std::optional<double> temperature_c;  ///< degrees Celsius; empty: the temperature of the training
};

/// A wanted pose of the tool, or joints whose nominal pose is wanted.
struct Target {
  std::optional<Pose> pose;  ///< X_BT; empty: the nominal pose at `joints_deg` is wanted
  std::vector<double>
      joints_deg;  ///< deg (of a rail mm): joints near the wanted branch; may be empty with `conf`
  std::optional<int>
      conf;  ///< branch 0..7: +4 wrist behind axis 1, +2 behind the lower arm, +1 joint 5 < 0
};

/// A note for users of a model, in the words of the command line and of the service.
struct Note {
  std::string code;      ///< for programs: `robot_not_confirmed`
  std::string severity;  ///< `info`; `warning`: figures mean less than they seem to; `stop`: a
                         ///< person must look first
  std::string text;      ///< for people
};

/// Which model answered.
struct ModelFacts {
  std::string id;          ///< first 12 characters of the hash
  std::string hash;        ///< SHA-256 of the model's content
  std::string cell;        ///< its cell
  std::string level;       ///< its error sources, joined by commas
  std::string batch;       ///< batch that it was trained on
  int training_poses = 0;  ///< the number of poses that it learned from
  int version = 0;         ///< of a service; 0: from a file
  bool in_force = false;   ///< of a service: true if its cell is served with it
  std::vector<Note>
      notes;  ///< the gravest first; in a service's list of versions only the one in force has them
  std::vector<std::string> budget;  ///< the first lines of the error budget, for people; from a
                                    ///< service only for the listed version in force
};

/// Receives the current step and the share done, [0, 1]. Returns false to give up (kBusy).
using Progress = std::function<bool(const std::string& stage, double share)>;

}  // namespace trammel::api
