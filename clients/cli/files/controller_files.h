#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "clients/cli/files/files_of_program.h"
#include "server/base/result.h"

/// Files that a controller keeps beside its programs.
namespace trammel::cli {

constexpr std::size_t kLargestProgram = std::size_t{1} << 28;  ///< bytes of a file

/// A file of a program or of a controller, its letters as readers take them. What cannot be turned
/// into UTF-8 stays as it is, for cam::check_files() to refuse.
[[nodiscard]] Result<cam::DecodedText> read_program_text(const std::string& path);

/// True if a file of a folder belongs to the controller and not to a program: KUKA's `$config.dat`
/// and its folders System, Mada and Steu, ABB's system modules and parameters.
[[nodiscard]] bool is_of_the_controller(const std::string& name);

/// The files of a folder with these names (in lower case), by their paths in it, sorted.
[[nodiscard]] Result<std::vector<cam::SourceFile>> files_called(const std::set<std::string>& names,
                                                                const std::string& folder);

/// Adds a folder's files beside its programs, for their dialect: parameters, lists of frames and
/// tools, and sentences on files that are not read.
[[nodiscard]] Status read_values(const std::string& folder, ProgramFiles& program);

/// True if --frames names a controller's own list, or one that it keeps in binary form.
[[nodiscard]] bool is_listing(const std::string& path);
/// A controller's own list of frames and tools, as --frames names it. Refuses one of another kind
/// of controller.
[[nodiscard]] Result<cam::SourceFile> read_listing(const std::string& path, cam::Dialect dialect);

}  // namespace trammel::cli
