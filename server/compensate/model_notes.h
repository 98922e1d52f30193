#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// The note on a robot file that nobody compared with the controller: most models have it.
constexpr const char* kNotConfirmed = "robot_not_confirmed";
/// The note on joints that reached all training poses from one side: the accuracy from the other
/// side is unknown.
constexpr const char* kOneSide = "approached_from_one_side";

/// The notes for a user of the model, the gravest first. Every door asks here: command line,
/// service, pages, library.
///
/// `kStop`: a number of the robot file is farther off than a real robot is from its drawing (3 mm,
/// 3 mrad, 1 degree of a zero), so the controller must have another file, and it would compute
/// corrected poses with its own arm; a base that stands elsewhere as a wrong first length would
/// make it; lengths that are all off by a share beyond any warmth; or the residual is 30 times the
/// stated sigma. `kWarning`: any other base that stands elsewhere than in the cell file;
/// measurements that were rounded; lengths of the arm that are all off by one share; a residual of
/// 3 times the sigma, or with a bias of less than half of it; too few poses; poses approached from
/// one side; doubts of the files (cell_doubts.h). `kInfo`: a robot file that was not confirmed,
/// error sources without effect, a bias that was learned with a tool that has moved since, changes
/// between sessions.
[[nodiscard]] std::vector<Note> notes_of(const CompensatedModel& model);

/// The notes for a user of any result that rests on the cell's files and on no model yet.
[[nodiscard]] std::vector<Note> notes_of(const Cell& cell);

/// The first note that prevents the model from being put in force automatically.
[[nodiscard]] std::optional<Note> stop_of(const CompensatedModel& model);

/// `the bias does not help here: 0.0233 mm with it, 0.0229 mm without on 1000 poses`, if poses that
/// were not trained on show no gain beyond chance. Empty if they show one, and without a bias.
[[nodiscard]] std::optional<std::string> doubt_of_bias(const Evaluation& evaluation);

/// All notes of both kinds.
[[nodiscard]] std::vector<Note> warnings_of(const CompensatedModel& model,
                                            const std::optional<Evaluation>& evaluation);

}  // namespace trammel
