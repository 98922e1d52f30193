#pragma once

#include <string>
#include <vector>

#include "clients/cam/dialect.h"
#include "clients/cli/files/files_of_program.h"
#include "server/base/result.h"

/// Reads the files of one program from files, folders or standard input, and writes them with their
/// originals.
namespace trammel::cli {

/// True if the inputs are a robot program. Otherwise they are one table of targets (.csv).
[[nodiscard]] bool is_program(const std::vector<std::string>& inputs, const std::string& format);

/// `inputs`: files, folders (with all their files of one dialect), or `-`. `format`: the dialect,
/// or empty: by the endings. `task`: the task of an ABB backup whose modules are taken; empty: all
/// tasks. Refuses files of several dialects, a folder without programs or without that task, and a
/// repeated name.
[[nodiscard]] Result<ProgramFiles> read_program_files(const std::vector<std::string>& inputs,
                                                      const std::string& format,
                                                      const std::string& task = "");

/// The program that cam::read_program() makes of the files. `frames`: a table with values of tools
/// and frames that they leave open, or empty (CSV: `name,x_mm,y_mm,z_mm,qw,qx,qy,qz`; frames seen
/// from the robot's base, tools from the flange; or a controller's own list: FANUC's SYSFRAME.VA,
/// Yaskawa's TOOL.CND or UFRAME.CND, as in a folder). Refuses a program without a single motion or
/// target in any of them, a backup of several robots of which no task is taken, and rows of
/// `frames` that nothing uses, unless their column `may_be_unused` says yes.
[[nodiscard]] Result<cam::Program> understood_program(const ProgramFiles& files,
                                                      cam::ReadOptions options,
                                                      const std::string& frames);

/// Takes the pulses of a degree from the robot file in the model at `model`, for Yaskawa jobs of
/// which `options` does not tell them.
[[nodiscard]] Status take_pulses(const ProgramFiles& files, const std::string& model,
                                 cam::ReadOptions& options);

/// The originals of a program that is marked as corrected: each file as it was before. Refuses a
/// file without its original beside it, or with another original than the mark names. `all`: also
/// if no file is marked, as for a new correction.
[[nodiscard]] Result<ProgramFiles> originals_of(const ProgramFiles& program, bool all);

/// The path of each output file: `output` itself for a single file, otherwise in the folder of that
/// name. Refuses to write over an input.
[[nodiscard]] Result<std::vector<std::string>> output_paths(const ProgramFiles& program,
                                                            const std::string& output);

}  // namespace trammel::cli
