#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/compensate/compensated_model.h"
#include "server/robot/cell_papers.h"

namespace trammel {

/// A parameter in one version, in people's units.
struct ParameterOnRecord {
  std::string cause;  ///< for people: `joint zeros and link lengths`
  std::string name, unit;
  double value = 0, u95 = 0;  ///< U(k = 2)
  bool identified = false;    ///< by the measurements, and not by the prior alone
  bool of_set_up = false;     ///< the place of the instrument, which does not describe the arm
};

/// A version of a cell's model.
struct VersionOnRecord {
  int version = 0;
  std::string id, batches;      ///< `lt-07+lt-08`
  std::int64_t trained_at = 0;  ///< Unix time, s
  int poses = 0;
  std::optional<double> validation_rms = {};  ///< m
  bool in_force = false;
  std::vector<ParameterOnRecord> parameters = {};  ///< empty if its file no longer exists
  std::vector<Note> notes = {};                    ///< the known changes, and notes for its user
  CellPapers papers = {};                          ///< of its cell file
};
/// Its parameters, notes and papers, from the model itself.
void put_on_record(const CompensatedModel& model, VersionOnRecord& version);

/// A model of a file as version number `version`.
[[nodiscard]] VersionOnRecord on_record(const CompensatedModel& model, int version);

/// A training, and how its model did on poses held out.
struct TrainingOnRecord {
  std::int64_t at = 0;  ///< Unix time, s, of its end
  std::string batches, verdict, why;
  std::optional<double> before, after;  ///< m rms, of the model in force and of the new one
};

/// An action of a person, or of the service by itself.
struct EventOnRecord {
  std::int64_t at = 0;  ///< Unix time, s
  std::string what, subject, why, who;
  std::string before = {}, after = {};  ///< `version 3` and `version 4`; empty: no such thing
};

/// The history of a cell, oldest first.
struct CellHistory {
  std::string cell;
  std::vector<VersionOnRecord> versions = {};
  std::vector<TrainingOnRecord> trainings = {};
  std::vector<EventOnRecord> events = {};
  bool of_files = false;  ///< the versions are model files, which do not state what is in force
};

/// A parameter of the arm that moved, between two consecutive versions on record, by more than both
/// uncertainties. Versions share measurements, so the difference is better known than these
/// uncertainties suggest: a listed parameter has really moved.
struct Moved {
  std::string cause, parameter, unit;
  int from_version = 0, to_version = 0;
  double from = 0, to = 0, u95 = 0;  ///< u95 of the difference, as of independent versions
};
[[nodiscard]] std::vector<Moved> moved_parameters(const CellHistory& history);

[[nodiscard]] nlohmann::ordered_json history_json(const CellHistory& history);

/// The history as a page that people look at: every parameter over the versions with its U, the
/// error before and after each training, events. HTML with everything inside; opens without a
/// network.
[[nodiscard]] std::string history_page(const CellHistory& history);

}  // namespace trammel
