#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/host/log_options.h"

/// The log of the process: one fact per line, as text for people or as JSON for programs. Nobody
/// waits for a line: a line that cannot be written at once is dropped and counted. For each kind of
/// fact at most LogLimit::kMost lines a minute are written (all at level debug); the next one
/// states how many were left out. Thread-safe, except start_log().
namespace trammel {

enum class LogLevel { kDebug, kInfo, kWarn, kError };

/// The subject of a fact, by name: `cell`, `who`, `trace`. Empty values are left out.
using LogAbout = std::vector<std::pair<const char*, std::string>>;

/// Call it before any other thread starts. Refuses a file that cannot be opened.
[[nodiscard]] Status start_log(const LogOptions& options);
/// Changes the options except the file.
void change_log(const LogOptions& options);
/// `kind`: one word for all facts of this kind. `text`: the fact for people, in one clause.
void tell(LogLevel level, const char* kind, const std::string& text, const LogAbout& about = {});
/// The members of a line of JSON that tell() writes, without time and level.
[[nodiscard]] std::string log_members(const char* kind, const std::string& text,
                                      const LogAbout& about);

}  // namespace trammel
