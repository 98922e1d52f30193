#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clients/cam/program.h"

/// The kinds of programs that are read.
namespace trammel::cam {

enum class Dialect { kRapid, kKrl, kFanuc, kInform, kUrScript, kCamRob, kRoboDk };

/// The dialect by its name for --format: `rapid krl fanuc inform urscript camrob robodk`.
[[nodiscard]] std::optional<Dialect> dialect_called(const std::string& name);
[[nodiscard]] const char* name_of(Dialect dialect);
/// The motion words of this dialect, for messages: `movej, movel, movep or movec`.
[[nodiscard]] const char* motions_of(Dialect dialect);
/// By the ending of a file's name, whatever its case; empty: none, or one that several kinds share.
[[nodiscard]] std::optional<Dialect> dialect_of_file(const std::string& path);
/// True if a row of --frames with this name can be a tool or frame in this dialect.
[[nodiscard]] bool may_have_row(Dialect dialect, const std::string& name);
/// All names that --format takes, for messages.
[[nodiscard]] std::string dialect_names();

[[nodiscard]] Program read_program(Dialect dialect, std::vector<SourceFile> files,
                                   const ReadOptions& options);

}  // namespace trammel::cam
